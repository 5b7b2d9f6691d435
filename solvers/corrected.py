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

# A particle inside a lattice has moments of determinant 1, on a face 0.2, on an edge 0.06, in a corner 0.02.
SINGULAR = wp.constant(0.02)


@wp.func
def symmetric_inverse(m: wp.mat33):
    """Inverse of a moment matrix; the identity where too few neighbours make it ill-conditioned."""
    inverse = wp.identity(n=3, dtype=float)
    if wp.determinant(m) > SINGULAR:
        inverse = wp.inverse(m)
    return inverse


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
