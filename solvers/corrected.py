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

# Least eigenvalue of moments, as bounded by `least_eigenvalue`, between which the correction fades in. In a cubic
# lattice (SPH at h = 1.3 to 1.5 d, PBD at H = 2.4 d) it is 0.44 inside, 0.28 on a face, 0.17 on an edge, 0.10 in a
# corner. The correction multiplies stiffness by up to the inverse square: a straggler with 0.02 breaks any bound on dt.
SINGULAR, SOUND = wp.constant(0.08), wp.constant(0.12)


@wp.func
def least_eigenvalue(m: wp.mat33):
    """4 det / trace^2: a lower bound on the least eigenvalue of a positive symmetric matrix."""
    trace = wp.trace(m)
    return 4.0 * wp.determinant(m) / wp.max(trace * trace, 1.0e-12)


@wp.func
def symmetric_inverse(m: wp.mat33):
    """Inverse of a moment matrix; it fades into the identity where too few neighbours make it ill-conditioned."""
    inverse = wp.identity(n=3, dtype=float)
    least = least_eigenvalue(m)
    if least > SINGULAR:
        share = wp.min((least - SINGULAR) / (SOUND - SINGULAR), 1.0)
        inverse = share * wp.inverse(m) + (1.0 - share) * inverse
    return inverse


@wp.func
def elastic_stress(modulus: float, b: wp.vec3, s: wp.vec3, pressure: float):
    """modulus dev(b) - pressure 1 [Pa], the elastic tensor given by its diagonal b and by s: xy, xz, yz."""
    m = modulus * (b[0] + b[1] + b[2]) / 3.0 + pressure
    xy, xz, yz = modulus * s[0], modulus * s[1], modulus * s[2]
    return wp.mat33(modulus * b[0] - m, xy, xz, xy, modulus * b[1] - m, yz, xz, yz, modulus * b[2] - m)


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
