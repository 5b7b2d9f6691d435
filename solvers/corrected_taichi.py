"""Corrected kernel gradients and stresses seen in walls, in Taichi: see corrected.py."""

from fluidbench.native.scene import FRICTION, SLIP

from .corrected import SINGULAR, SOUND
from .neighbours_taichi import face_kind
from .taichi_bridge import symmetric, ti


@ti.func
def least_eigenvalue(m):
    """4 det / trace^2: a lower bound on the least eigenvalue of a positive symmetric matrix."""
    trace = m.trace()
    return 4.0 * m.determinant() / ti.max(trace * trace, 1.0e-12)


@ti.func
def symmetric_inverse(m):
    """Inverse of a moment matrix, held back along what no neighbour spans as 4 det / trace^2, a bound on its least
    eigenvalue, falls from SOUND to SINGULAR."""
    share = ti.math.clamp((SOUND - least_eigenvalue(m)) / (SOUND - SINGULAR), 0.0, 1.0)
    return m @ (m @ m + share * SOUND * SOUND * ti.Matrix.identity(ti.f32, 3)).inverse()


@ti.func
def spanned(m, inverse):
    """The share of each direction that neighbours span."""
    share = ti.Matrix.identity(ti.f32, 3)
    if least_eigenvalue(m) < SOUND:
        share = m @ inverse
    return share


@ti.func
def strain_by_chords(span, gradient, h):
    """Rate of logarithmic strain [1/s] of the step that ends here, along the chords by which particles came."""
    along = span @ gradient
    strain = 0.5 * (along + along.transpose() - h * gradient.transpose() @ gradient)
    return strain + h * strain @ strain


@ti.func
def from_before(strain, along, h):
    """Velocity gradient over where matter was a step ago [1/s]."""
    spin = 0.5 * (along - along.transpose())
    return strain + spin + h * (strain @ spin + 0.5 * (strain @ strain + spin @ spin))


@ti.func
def elastic_stress(modulus, b, s, pressure):
    """modulus dev(b) - pressure 1 [Pa]."""
    unit = ti.Matrix.identity(ti.f32, 3)
    return modulus * (symmetric(b, s) - (b.sum() / 3.0) * unit) - pressure * unit


@ti.func
def mirrored_stress(box, stress, code):
    """A stress seen in slip or friction walls: entries that pair the normal with a tangent change sign."""
    out = stress
    for axis in ti.static(range(3)):
        kind = face_kind(box, code, axis)
        if kind == SLIP or kind == FRICTION:
            for other in ti.static(range(3)):
                if ti.static(other != axis):
                    out[axis, other] = -out[axis, other]
                    out[other, axis] = -out[other, axis]
    return out
