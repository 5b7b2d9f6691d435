"""Walls of PBD beyond mirror images: how far they push, and what friction they exert."""

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.scene import FRICTION, PERIODIC, Box, Force, force_at

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def pushed(box: Box, free: wp.vec3, inside: wp.vec3):
    """How far walls have moved a particle back inside; a periodic wrap is no motion."""
    back = inside - free
    for axis in range(3):
        if box.lower_kind[axis] == PERIODIC:
            back[axis] = 0.0
    return back


@wp.func
def rubbing(kind: int, gap: float, spacing: float):
    """Whether a particle this far from a face feels its friction."""
    return gap < spacing and kind == FRICTION


@wp.kernel
def wall_friction(
    share: wp.vec3i,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    spacing: float,
    force: wp.array(dtype=Force),
    position: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
):
    """Particles touching a friction wall lose tangential speed by Coulomb's law."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        v = velocity[i]
        x = position[i]
        for axis in range(3):
            friction = box.lower_friction[axis]
            touching = rubbing(box.lower_kind[axis], x[axis] - box.lower[axis], spacing)
            if rubbing(box.upper_kind[axis], box.upper[axis] - x[axis], spacing):
                friction = box.upper_friction[axis]
                touching = True
            if touching:
                normal = v[axis]
                slide = v
                slide[axis] = 0.0
                speed = wp.length(slide)
                grip = wp.min(friction * wp.abs(force_at(force[world], x)[axis]) * dt[world], speed)
                v = slide * (1.0 - grip / wp.max(speed, 1.0e-12))
                v[axis] = normal
        velocity[i] = v
