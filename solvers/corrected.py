"""What SPH and PBD share to carry stress: corrected kernel gradients and stresses seen in walls.

A velocity gradient with the kernel's gradient corrected by the inverse moment B (Randles & Libersky 1996, CMAME
139:375) makes no strain of a rigid rotation. Stress times B, summed with the plain kernel gradient over both partners
of a pair, does on the particles exactly the work of that strain: momentum and angular momentum stay (Bonet & Lok 1999,
CMAME 180:97).
"""

import warp as wp

from fluidbench.native.scene import FRICTION, SLIP, Box

from .images import face_kind

wp.set_module_options({"enable_backward": False})

# Least eigenvalue of moments, as bounded by `least_eigenvalue`, between which the correction is held back. In a cubic
# lattice (SPH at h = 1.3 to 1.5 d, PBD at H = 2.4 d) it is 0.44 inside, 0.28 on a face, 0.17 on an edge, 0.10 in a
# corner. The correction multiplies stiffness by up to the inverse square: a straggler with 0.02 breaks any bound on dt.
# Below that of an edge SPH's particles are stragglers.
SINGULAR, SOUND, EDGE = wp.constant(0.08), wp.constant(0.12), wp.constant(0.17)
INSIDE, LEANING = wp.constant(0.44), wp.constant(0.36)  # halfway to a face


@wp.func
def least_eigenvalue(m: wp.mat33):
    """4 det / trace^2: a lower bound on the least eigenvalue of a positive symmetric matrix."""
    trace = wp.trace(m)
    return 4.0 * wp.determinant(m) / wp.max(trace * trace, 1.0e-12)


@wp.func
def enclosed(least: float):
    """How far a particle is from any free surface [-], by the least eigenvalue of its moment: 1 where it has neighbours
    all round, 0 from halfway to a face on. (Marrone et al. 2010, J. Comput. Phys. 229:3652, tell surfaces by it.)

    What has grown is evened out there, and in SPH all that has strength and flows (crowding.py). The halves of split
    particles lie as they were born, and no stress says where they should: a kernel three spacings wide does not see how
    far above a floor a row is. Nothing held the lowest row of rising foam down; a gap of half a spacing opened under
    it, and the foam slid off. Rows of paste that slide along a no-slip wall came nearer to their images than to the
    next row, and carried 0.85 of the wall's stress.
    """
    return wp.clamp((least - LEANING) / (INSIDE - LEANING), 0.0, 1.0)


@wp.func
def symmetric_inverse(m: wp.mat33):
    """Inverse of a moment matrix; where too few neighbours make it ill-conditioned, m (m^2 + SOUND^2)^-1 (Tikhonov),
    which nowhere exceeds 1 / (2 SOUND) and is near zero along what no neighbour spans."""
    share = wp.clamp((SOUND - least_eigenvalue(m)) / (SOUND - SINGULAR), 0.0, 1.0)
    held = share * SOUND * SOUND
    return m * wp.inverse(m * m + wp.diag(wp.vec3(held, held, held)))


@wp.func
def spanned(m: wp.mat33, inverse: wp.mat33):
    """The share of each direction that neighbours span, m times its `symmetric_inverse`: 1 but for stragglers.

    A gradient that is complete along some directions alone takes a rotation for strain. Taken times this from the
    left as well, that of a rotation stays antisymmetric whatever is spanned: what matter of few particles, a thread or
    a splash, does to itself has no torque and does no work on a rotation.
    """
    share = wp.diag(wp.vec3(1.0, 1.0, 1.0))
    if least_eigenvalue(m) < SOUND:
        share = m * inverse
    return share


@wp.func
def strain_by_chords(span: wp.mat33, gradient: wp.mat33, h: float):
    """Rate of logarithmic strain [1/s] of the step h [s] that ends here, from the gradient of the velocities by which
    particles came, corrected but not yet `spanned`.

    A particle comes along a chord, x - h v before: that of a rotation has a divergence of h w^2. Almansi's strain of
    those chords, sym(S L) - h/2 L^T L, has none. Without, what turns expands at h w^2, is pulled together, and turns
    the faster: splashes of three to ten particles sped up until they were lost.
    """
    along = span * gradient
    strain = 0.5 * (along + wp.transpose(along)) - (0.5 * h) * (wp.transpose(gradient) * gradient)
    return strain + h * (strain * strain)


@wp.func
def from_before(strain: wp.mat33, along: wp.mat33, h: float):
    """Velocity gradient l over where matter was h [s] ago [1/s], from its rate of strain and its spanned gradient:
    1 + h l is exp(h strain) exp(h spin) to second order."""
    spin = 0.5 * (along - wp.transpose(along))
    return strain + spin + h * (strain * spin + 0.5 * (strain * strain + spin * spin))


@wp.func
def symmetric(normal: wp.vec3, shear: wp.vec3):
    """The matrix with a diagonal, and off it xy, xz, yz."""
    return wp.mat33(
        normal[0], shear[0], shear[1], shear[0], normal[1], shear[2], shear[1], shear[2], normal[2]
    )  # fmt: skip


@wp.func
def elastic_stress(modulus: float, b: wp.vec3, s: wp.vec3, pressure: float):
    """modulus dev(b) - pressure 1 [Pa], the elastic tensor given by its diagonal b and by s: xy, xz, yz."""
    m = modulus * (b[0] + b[1] + b[2]) / 3.0 + pressure
    return symmetric(modulus * b - wp.vec3(m, m, m), modulus * s)


@wp.func
def mirrored_stress(box: Box, m: wp.mat33, code: int):
    """A stress seen in slip or friction walls: entries that pair the normal with a tangent change sign."""
    sign = wp.vec3(1.0, 1.0, 1.0)
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind == SLIP or kind == FRICTION:
            sign[axis] = -1.0
    out = m
    for a in range(3):
        for b in range(3):
            out[a, b] = sign[a] * sign[b] * m[a, b]
    return out
