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
    """Inverse of a moment matrix, faded into the identity as 4 det / trace^2, a bound on its least eigenvalue, falls
    from SOUND to SINGULAR."""
    inverse = ti.Matrix.identity(ti.f32, 3)
    least = least_eigenvalue(m)
    if least > SINGULAR:
        share = ti.min((least - SINGULAR) / (SOUND - SINGULAR), 1.0)
        inverse = share * m.inverse() + (1.0 - share) * inverse
    return inverse


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
