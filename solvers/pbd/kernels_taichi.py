"""Position-based fluids in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

from functools import cache
from types import SimpleNamespace

from fluidbench.method.frame import FREE
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import FRICTION, PERIODIC

from ..images import WALL_INSET
from ..neighbours_taichi import BoxT, contained, walled
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Quads,
    Vectors,
    beyond,
    force_at,
    ti,
    too_fast,
    vec4,
)
from . import elastic_taichi, surroundings_taichi
from .constraints_taichi import constraints
from .kernels_warp import FARTHEST, HURRIED
from .surroundings_taichi import NumbersT


@ti.func
def moved_back(box, free, inside):
    """How far walls have moved a particle back inside; a periodic wrap is no motion."""
    back = inside - free
    for axis in ti.static(range(3)):
        if box.lower_kind[axis] == PERIODIC:
            back[axis] = 0.0
    return back


@ti.kernel
def predict(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    force: Forces,
    held: Ints,
    velocity: Vectors,
    volume: Floats,
    pulled: Vectors,
    position: Vectors,
    motion: Vectors,
    places: Quads,
    fault: Ints,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            v = velocity[i]
            if held[i] == FREE:
                v += dt[world] * (force_at(force, world, position[i]) + pulled[i])
            free = position[i] + dt[world] * v
            if too_fast(v, HURRIED * box.top_speed):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x = contained(box, free, WALL_INSET * num.spacing)
            position[i], motion[i] = x, dt[world] * v + moved_back(box, free, x)
            places[i] = vec4(x[0], x[1], x[2], volume[i])


@ti.kernel
def apply(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    held: Ints,
    correction: Vectors,
    volume: Floats,
    position: Vectors,
    motion: Vectors,
    places: Quads,
    fault: Ints,
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity] and held[i] == FREE:
            shift = correction[i]
            limit = num.spacing
            wanted = shift.norm()
            if shift.norm() > limit:
                shift *= limit / shift.norm()
            free = position[i] + shift
            if beyond(wanted, FARTHEST * num.spacing):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x = walled(box, free, WALL_INSET * num.spacing)
            position[i] = x
            motion[i] += shift + moved_back(box, free, x)
            places[i] = vec4(x[0], x[1], x[2], volume[i])


@ti.kernel
def velocities(capacity: int, count: Ints, dt: Floats, held: Ints, motion: Vectors, velocity: Vectors):
    for i in range(velocity.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            velocity[i] = motion[i] / dt[world]


@ti.kernel
def follow(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    drag: Vectors,
    position: Vectors,
):
    for i in range(drag.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            free = position[i] + dt[world] * dt[world] * drag[i]
            position[i] = walled(box, free, WALL_INSET * num.spacing)


@ti.func
def wall_friction_acts(kind, gap, spacing):
    """Whether a particle this far from a face feels its friction."""
    return gap < spacing and kind == FRICTION


@ti.kernel
def wall_friction(
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    spacing: float,
    force: Forces,
    position: Vectors,
    velocity: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            v, x = velocity[i], position[i]
            weight = force_at(force, world, x)
            for axis in ti.static(range(3)):
                low = wall_friction_acts(box.lower_kind[axis], x[axis] - box.lower[axis], spacing)
                high = wall_friction_acts(box.upper_kind[axis], box.upper[axis] - x[axis], spacing)
                if low or high:
                    friction = box.lower_friction[axis]
                    if high:
                        friction = box.upper_friction[axis]
                    slide = v
                    slide[axis] = 0.0
                    speed = slide.norm()
                    lost = ti.min(friction * ti.abs(weight[axis]) * dt[world], speed)
                    slide *= 1.0 - lost / ti.max(speed, 1.0e-12)
                    slide[axis] = v[axis]
                    v = slide
            velocity[i] = v


@cache
def passes(strength: bool, drawn: bool) -> SimpleNamespace:
    """The passes, of what has strength or has none, is drawn together or is not."""
    around = surroundings_taichi.KERNELS if drawn else {}
    return SimpleNamespace(
        predict=predict,
        apply=apply,
        velocities=velocities,
        follow=follow,
        wall_friction=wall_friction,
        **constraints(drawn),
        **around,
        **(elastic_taichi.KERNELS if strength else {}),
    )
