"""Position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp.

One substep: predict, lists, then per iteration multipliers and correction, then velocity from the change of position.
What is elastic answers strain by the common law (elastic_warp.py), implicit in time as Newtonian viscosity is
(../viscosity.py). Sums over pairs are those of pairs.py.
"""

import functools
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import Box, Force, force_at, too_fast
from fluidbench.native.vector_access import store_vec4

from ..images import WALL_INSET, contained, walled
from ..tool import Tool, outside
from .constraints_warp import constraints
from .elastic_warp import elastic
from .numbers import Numbers
from .surroundings_warp import pack, surroundings
from .walls import pushed, wall_friction

wp.set_module_options({"enable_backward": False, "fast_math": True})

HURRIED = wp.constant(10.0)  # corrections of a crowded start are this much faster, for a substep, than any matter
FARTHEST = wp.constant(1.0e3)  # spacings beyond which no constraint wants a particle to move


@wp.kernel
def predict(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    velocity: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    pulled: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Position under the present velocity, gravity and elastic stress. `motion` carries the displacement of the substep
    by itself: as a difference of float32 positions it would lose the velocity at small dt."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        if held[i] == FREE:
            v += h * (force_at(force[world], position[i]) + pulled[i])
        free = position[i] + h * v
        if too_fast(v, HURRIED * box.top_speed):
            raise_fault(fault, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * num.spacing)
        motion[i] = h * v + pushed(box, free, x)
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@wp.kernel
def apply(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    correction: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Move by the correction, at most a spacing, and stay inside the walls."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        shift = correction[i]
        length = wp.length(shift)
        limit = num.spacing
        if length > limit:
            shift = shift * (limit / length)
        free = position[i] + shift
        if not (length <= FARTHEST * num.spacing):
            raise_fault(fault, FAULT_ASTRAY)
        x = walled(box, free, WALL_INSET * num.spacing)
        motion[i] = motion[i] + shift + pushed(box, free, x)
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@wp.kernel
def velocities(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    motion: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
):
    """v = displacement / dt."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        velocity[i] = motion[i] / dt[world]


@wp.kernel
def follow(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    drag: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
):
    """Viscosity holds back what gravity and constraints have moved in the substep, too, by drag dt^2: matter goes where
    its velocity takes it after the solve."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        free = position[i] + (dt[world] * dt[world]) * drag[i]
        position[i] = walled(box, free, WALL_INSET * num.spacing)


@wp.kernel
def keep_out(
    share: wp.vec3i,
    tool: Tool,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
):
    """What would enter a rigid body stays in front of it."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        x = outside(tool, position[i])
        motion[i] = motion[i] + x - position[i]
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@functools.cache
def passes(strength: bool, drawn: bool, tooled: bool, cpu: bool) -> SimpleNamespace:
    """The passes for one kind of device, of what has strength or has none, is drawn together or is not, beside a rigid
    body or without one."""
    over_pairs = constraints(drawn, tooled)
    if drawn:
        over_pairs |= elastic(tooled) if strength else surroundings(tooled)
    names = {key: "tooled_" * tooled + key for key in over_pairs}
    names |= {key: "drawing_" * drawn + names[key] for key in ("multipliers", "correct")}
    return SimpleNamespace(
        predict=predict,
        apply=apply,
        velocities=velocities,
        follow=follow,
        wall_friction=wall_friction,
        **({"keep_out": keep_out} if tooled else {}),
        **({"pack": pack} if drawn else {}),
        **{key: one.compiled(names[key], cpu) for key, one in over_pairs.items()},
    )
