"""Weakly compressible SPH in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

import functools
from types import SimpleNamespace

from fluidbench.method.frame import FREE
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import PERIODIC

from ..images import WALL_INSET
from ..neighbours_taichi import BoxT, contained
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Phases,
    Quads,
    Vectors,
    force_at,
    phase_at,
    rest_density,
    ti,
    too_fast,
    vec3,
    vec4,
)
from .force_taichi import force_pass
from .settling_taichi import settle_pass, tell_pass
from .strain_taichi import strain_pass


@functools.cache
def passes(strength: bool, tensile: bool, viscous: bool, changing: bool, settling: bool) -> SimpleNamespace:
    """All passes, for materials with or without shear stiffness, tension, viscosity, parameters or rest densities that
    differ between particles, and anything that settles."""
    variant = strength, tensile, viscous, changing
    strain, force = strain_pass(*variant), force_pass(*variant)
    more = {"tell": tell_pass(tensile), "settle": settle_pass(tensile)} if settling else {}
    return SimpleNamespace(pack=pack, strain=strain, force=force, move=move, **more)


@ti.kernel
def pack(
    capacity: int,
    count: Ints,
    position: Vectors,
    velocity: Vectors,
    mass: Floats,
    volume: Floats,
    density: Floats,
    carried_gradient: Vectors,
    matter: Quads,
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity]:
            x, v, g = position[i], velocity[i], carried_gradient[i]
            matter[3 * i] = vec4(x[0], x[1], x[2], mass[i])
            matter[3 * i + 1] = vec4(v[0], v[1], v[2], density[i])
            matter[3 * i + 2] = vec4(g[0], g[1], g[2], rest_density(mass, volume, i))


@ti.kernel
def move(
    box: BoxT,
    spacing: float,
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    force: Forces,
    held: Ints,
    mass: Floats,
    volume: Floats,
    acceleration: Vectors,
    tensile: int,
    new_density: Floats,
    shift: Vectors,
    position: Vectors,
    velocity: Vectors,
    density: Floats,
    carried_gradient: Vectors,
    fault: Ints,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            h, v, carried = dt[world], velocity[i], vec3(0.0)
            if held[i] == FREE:
                v += h * acceleration[i]
                rest = rest_density(mass, volume, i)
                phase = phase_at(phases, world, phase_of[i])
                weight = force_at(force, world, position[i]) - acceleration[i]
                carried = 0.5 * rest * rest / phase.bulk_modulus * weight
            if tensile == 0:
                carried_gradient[i] = carried
            free = position[i] + h * v
            if held[i] == FREE and tensile == 1:
                free += shift[i]
            if too_fast(v, box.top_speed):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x = contained(box, free, WALL_INSET * spacing)
            for axis in ti.static(range(3)):
                if x[axis] != free[axis] and box.lower_kind[axis] != PERIODIC:
                    v[axis] = 0.0
            position[i], velocity[i], density[i] = x, v, new_density[i]
