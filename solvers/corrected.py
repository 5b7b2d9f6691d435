"""What SPH and PBD share to carry stress: corrected kernel gradients and stresses seen in walls.

A velocity gradient with the kernel's gradient corrected by the inverse moment B (Randles & Libersky 1996, CMAME
139:375) makes no strain of a rigid rotation. Stress times B, summed with the plain kernel gradient over both partners
of a pair, does on the particles exactly the work of that strain: momentum and angular momentum stay (Bonet & Lok 1999,
CMAME 180:97).
"""

import warp as wp

from fluidbench.scene import FRICTION, SLIP, Box

from .neighbours import face_kind

wp.set_module_options({"enable_backward": False})

# Determinant of the moments of a particle in a cubic lattice, SPH at h = 1.5 d and PBD at H = 2.4 d alike: 1 inside,
# 0.28 on a face, 0.07 to 0.08 on an edge, 0.017 to 0.023 in a corner.
SINGULAR = wp.constant(0.02)


@wp.func
def symmetric_inverse(m: wp.mat33):
    """Inverse of a moment matrix; the identity where too few neighbours make it ill-conditioned."""
    inverse = wp.identity(n=3, dtype=float)
    if wp.determinant(m) > SINGULAR:
        inverse = wp.inverse(m)
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
