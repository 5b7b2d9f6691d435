"""Weakly compressible SPH in Warp: continuity density, delta-SPH diffusion, the common material law.

One substep: lists, pack (rows that neighbours are asked for), strain (continuity, velocity gradient, stress), force
(momentum), move; between ticks settling (settling.py). Materials that carry tension use corrected gradients for strain
and stress (see corrected.py), others the symmetric form of Monaghan (2005, Rep. Prog. Phys. 68:1703). Sums over pairs
are those of pairs.py.
"""

import functools
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import PERIODIC, Box, Force, Phase, force_at, too_fast
from fluidbench.native.vector_access import store_vec4

from ..aging import rest_density
from ..images import WALL_INSET, contained
from ..tool import keep_out
from .force_warp import force_pass
from .settling_warp import settle_pass, tell_pass
from .strain_warp import strain_pass

wp.set_module_options({"enable_backward": False, "fast_math": True})


@functools.cache
def passes(
    strength: bool, tensile: bool, viscous: bool, changing: bool, settling: bool, tooled: bool, cpu: bool
) -> SimpleNamespace:
    """The passes for materials with or without shear stiffness, tension, viscosity, parameters or rest densities that
    differ between particles, anything that settles, and a rigid body that is carried along: unused physics costs
    nothing."""
    name = "strength" if strength else "tensile" if tensile else "liquid"
    name += "_viscous" if viscous else "_inviscid"
    name += "_changing" * changing + "_tooled" * tooled
    strain = strain_pass(strength, tensile, viscous, changing, tooled).compiled(f"strain_{name}", cpu)
    force = force_pass(strength, tensile, viscous, changing, tooled).compiled(f"force_{name}", cpu)
    more = {"keep_out": keep_out} if tooled else {}
    if settling:
        more["tell"] = tell_pass(tensile, tooled).compiled("tell" + "_tensile" * tensile + "_tooled" * tooled, cpu)
        more["settle"] = settle_pass(tensile).compiled("settle" + "_tensile" * tensile, cpu)
    return SimpleNamespace(pack=pack, strain=strain, force=force, move=move, **more)


@wp.kernel
def pack(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    density: wp.array(dtype=float),
    carried_gradient: wp.array(dtype=wp.vec3),
    # outputs
    matter: wp.array(dtype=wp.vec4),
):
    """Rows of `strain`."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        x, v, g = position[i], velocity[i], carried_gradient[i]
        store_vec4(matter, 3 * i, wp.vec4(x[0], x[1], x[2], mass[i]))
        store_vec4(matter, 3 * i + 1, wp.vec4(v[0], v[1], v[2], density[i]))
        store_vec4(matter, 3 * i + 2, wp.vec4(g[0], g[1], g[2], rest_density(mass, volume, i)))


@wp.kernel
def move(
    share: wp.vec3i,
    box: Box,
    spacing: float,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    acceleration: wp.array(dtype=wp.vec3),
    tensile: int,
    new_density: wp.array(dtype=float),
    shift: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    density: wp.array(dtype=float),
    carried_gradient: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
):
    """Symplectic Euler; a particle that would cross a wall stops at it.

    `carried_gradient` is half the density gradient of the pressure that carries the particle, rho^2 (g - a) / K: that
    of hydrostatic equilibrium for a liquid at rest (Fourtakas et al. 2019, Comput. Fluids 190:346), none in free fall.
    What carries tension has it of `strain`: shear stress carries it, too.
    """
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        carried = wp.vec3(0.0, 0.0, 0.0)
        if held[i] == FREE:
            v += h * acceleration[i]
            phase = phases[world, phase_of[i]]
            rest = rest_density(mass, volume, i)
            stiffness = 0.5 * rest * rest / phase.bulk_modulus
            carried = stiffness * (force_at(force[world], position[i]) - acceleration[i])
        if tensile == 0:
            carried_gradient[i] = carried
        free = position[i] + h * v
        if held[i] == FREE and tensile == 1:
            free += shift[i]
        if too_fast(v, box.top_speed):
            raise_fault(fault, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * spacing)
        for axis in range(3):
            if x[axis] != free[axis] and box.lower_kind[axis] != PERIODIC:
                v[axis] = 0.0
        position[i] = x
        velocity[i] = v
        density[i] = new_density[i]
