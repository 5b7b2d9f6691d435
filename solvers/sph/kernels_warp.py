"""Weakly compressible SPH in Warp: continuity density, delta-SPH diffusion, the common material law.

One substep: lists, strain (continuity, velocity gradient, stress), force (momentum), move. Materials with shear
stiffness use corrected gradients for strain and stress (see corrected.py), liquids the symmetric form of Monaghan
(2005, Rep. Prog. Phys. 68:1703).
"""

import functools
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE
from fluidbench.native.scene import FRICTION, PERIODIC, Box, Force, Phase, force_at, is_solid, too_fast

from .. import constitutive
from ..aging import DISORDER, rest_density
from ..bind import warp_func
from ..corrected import elastic_stress, mirrored_stress, symmetric_inverse
from ..neighbours import (
    INDEX_BITS,
    INDEX_MASK,
    WALL_INSET,
    Lists,
    contained,
    face_kind,
    image_gradient,
    image_position,
    image_rate,
    image_velocity,
)
from ..smoothing import wendland, wendland_slope

wp.set_module_options({"enable_backward": False, "fast_math": True})

pressure = warp_func(constitutive.pressure)
strain_and_flow = warp_func(constitutive.strain_and_flow, constitutive.flow_stress)
kernel = warp_func(wendland)
slope = warp_func(wendland_slope)


@wp.struct
class Smoothing:
    """Numbers of the discretisation."""

    h: float  # smoothing length [m]
    spacing: float  # [m]
    viscous_lattice: float  # makes the viscosity of a shear flow on a lattice exact [-]
    lattice: float  # makes the second moment of a lattice exactly its density [-]
    density_diffusion: float  # delta [-]
    artificial_viscosity: float  # alpha [-]
    artificial_stress: float  # epsilon [-]
    density_tolerance: float  # gap between the two that is left alone, over the density [-]
    density_feedback: float  # rate at which the integrated density follows the summed one, in c / h [-]


FLOOR = wp.constant(0.1)  # least density over that at rest
CRUSHED = wp.constant(1.0e3)  # density over that at rest that no matter reaches
WHOLE = wp.constant(0.15)  # a flat free surface leans by 0.6, the layer below it by 0.04 to 0.1 (h / d = 1.3 to 1.5)


@functools.cache
def passes(strength: bool, viscous: bool, changing: bool) -> SimpleNamespace:
    """The passes for materials with or without shear stiffness, viscosity, and parameters or rest densities that differ
    between particles: unused physics costs nothing."""
    name = f"{'strength' if strength else 'liquid'}_{'viscous' if viscous else 'inviscid'}"
    name += "_changing" if changing else ""

    def strain(
        num: Smoothing,
        box: Box,
        lists: Lists,
        capacity: int,
        count: wp.array(dtype=int),
        dt: wp.array(dtype=float),
        phases: wp.array2d(dtype=Phase),
        phase_of: wp.array(dtype=int),
        held: wp.array(dtype=int),
        position: wp.array(dtype=wp.vec3),
        velocity: wp.array(dtype=wp.vec3),
        mass: wp.array(dtype=float),
        volume: wp.array(dtype=float),
        density: wp.array(dtype=float),
        carried_gradient: wp.array(dtype=wp.vec3),
        # outputs
        elastic_normal: wp.array(dtype=wp.vec3),
        elastic_shear: wp.array(dtype=wp.vec3),
        new_density: wp.array(dtype=float),
        pressure_term: wp.array(dtype=float),
        stress: wp.array(dtype=wp.mat33),
        rate: wp.array(dtype=wp.mat33),
        fault: wp.array(dtype=int),
    ):
        """Continuity with density diffusion (Monaghan 2005, eq. 2.17; Antuono et al. 2010), then the material law.

        Diffusion must not level the gradient that carries pressure, which is `carried_gradient` from both partners (see
        `move`).
        """
        i = wp.tid()
        world = i / capacity
        if i - world * capacity < count[world]:
            phase = phases[world, phase_of[i]]
            x = position[i]
            v = velocity[i]
            rho = density[i]
            rest, sound = float(phase.density), float(phase.wave_speed)
            if wp.static(changing):
                rest = rest_density(mass, volume, i)
                sound = phase.wave_speed * wp.sqrt(phase.density / rest)
            own_gradient = carried_gradient[i]
            inv_h = 1.0 / num.h
            inflow = float(0.0)
            spread = float(0.0)
            gradient = wp.mat33()
            moment = wp.mat33()
            second = float(0.0)
            first_moment = wp.vec3(0.0, 0.0, 0.0)
            start = i * lists.row
            for k in range(lists.number[i]):
                entry = lists.entries[start + k * lists.column]
                j = entry & INDEX_MASK
                code = entry >> INDEX_BITS
                xj = position[j]
                vj = velocity[j]
                if code > 0:
                    xj = image_position(box, xj, code)
                    vj = image_velocity(box, vj, code)
                r = x - xj
                u = v - vj
                w = mass[j] * slope(wp.sqrt(wp.dot(r, r)) * inv_h, num.h)
                partner_gradient = carried_gradient[j]
                if code > 0:
                    partner_gradient = image_gradient(box, partner_gradient, code)
                partner = density[j]
                if wp.static(changing):
                    # in volumes and compressions: partners may be at rest at another density
                    share = rest / rest_density(mass, volume, j)
                    w *= share
                    partner *= share
                    partner_gradient *= share
                spread += w * (rho - partner - wp.dot(own_gradient + partner_gradient, r))
                second -= w * wp.dot(r, r)
                first_moment += w * r
                inflow += w * wp.dot(u, r)
                if wp.static(strength):
                    gradient -= wp.outer(w * u, r)
                    moment -= wp.outer(w * r, r)
            if wp.static(strength):
                # density from the corrected gradient, too: the same strain for pressure and for shear
                correction = symmetric_inverse(moment / rho)
                gradient = gradient * correction / rho
                rate[i] = gradient
                inflow = -rho * wp.trace(gradient)
            # The density that particles really have, against the one they integrate, which drifts: applied where the
            # neighbourhood is complete (it leans to no side), or too crowded for any.
            drift = second * num.lattice / 3.0 - rho
            whole = wp.max(1.0 - wp.length(first_moment) * num.h / (WHOLE * rho), 0.0)
            if drift > 0.0:
                whole = 1.0
            tolerance = float(num.density_tolerance)
            if rest < 0.99 * phase.density:
                tolerance = wp.max(tolerance, DISORDER)
            drift = wp.sign(drift) * wp.max(wp.abs(drift) - tolerance * rho, 0.0)
            if phase.relaxation_rate > 0.0 or rest < 0.99 * phase.density:
                # in a stretched thread, and among the halves of split particles, a pair too close reads as thin, and
                # would be pulled closer
                drift = wp.max(drift, wp.min(rest - rho, 0.0))
            if is_solid(phase):
                drift = 0.0  # density is its strain: nothing may level it
                spread = 0.0
            inflow += num.density_feedback * sound / num.h * whole * drift
            h = dt[world]
            growth = inflow + 2.0 * num.density_diffusion * num.h * sound * spread / rho
            rho += h * growth
            if not (rho > -rest and rho < CRUSHED * rest):
                wp.atomic_or(fault, 0, FAULT_STATE)
            rho = wp.max(rho, FLOOR * rest)
            new_density[i] = rho
            p = pressure(rho / rest - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
            scale = 1.0 / (rho * rho)
            if wp.static(changing):
                scale = 1.0  # partners of another density: see `force`
            if wp.static(strength):
                b = elastic_normal[i]
                s = elastic_shear[i]
                if held[i] != CARRIED:
                    b_xx, b_yy, b_zz, b_xy, b_xz, b_yz = strain_and_flow(
                        gradient[0, 0],
                        gradient[0, 1],
                        gradient[0, 2],
                        gradient[1, 0],
                        gradient[1, 1],
                        gradient[1, 2],
                        gradient[2, 0],
                        gradient[2, 1],
                        gradient[2, 2],
                        b[0],
                        b[1],
                        b[2],
                        s[0],
                        s[1],
                        s[2],
                        phase.shear_modulus,
                        phase.yield_stress,
                        phase.plastic_viscosity,
                        phase.flow_index,
                        phase.relaxation_rate,
                        h,
                    )
                    b = wp.vec3(b_xx, b_yy, b_zz)
                    s = wp.vec3(b_xy, b_xz, b_yz)
                    elastic_normal[i] = b
                    elastic_shear[i] = s
                g = phase.shear_modulus * rho / rest  # Cauchy from Kirchhoff: divide by J
                # With the correction of its gradient stress does on the particles exactly the work of the strain.
                stress[i] = scale * (elastic_stress(g, b, s, p) * correction)
            else:
                pressure_term[i] = scale * p

    def force(
        num: Smoothing,
        box: Box,
        lists: Lists,
        capacity: int,
        count: wp.array(dtype=int),
        dt: wp.array(dtype=float),
        phases: wp.array2d(dtype=Phase),
        phase_of: wp.array(dtype=int),
        force: wp.array(dtype=Force),
        position: wp.array(dtype=wp.vec3),
        velocity: wp.array(dtype=wp.vec3),
        mass: wp.array(dtype=float),
        volume: wp.array(dtype=float),
        density: wp.array(dtype=float),
        pressure_term: wp.array(dtype=float),
        stress: wp.array(dtype=wp.mat33),
        rate: wp.array(dtype=wp.mat33),
        # outputs
        acceleration: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        world = i / capacity
        if i - world * capacity < count[world]:
            phase = phases[world, phase_of[i]]
            x = position[i]
            v = velocity[i]
            rho = density[i]
            own = pressure_term[i]
            own_stress, own_rate = wp.mat33(), wp.mat33()
            if wp.static(strength):
                own_stress = stress[i]
                own_rate = rate[i]
            inv_h = 1.0 / num.h
            tiny = 0.01 * num.h * num.h
            shock = num.artificial_viscosity * num.h * phase.wave_speed / rho
            drag = 10.0 * num.viscous_lattice * phase.viscosity / (phase.density * phase.density)
            rest = float(phase.density)
            if wp.static(changing):
                rest = rest_density(mass, volume, i)
                shock = phase.wave_speed * wp.sqrt(phase.density / rest)
            inv_w = 1.0 / kernel(num.spacing * inv_h, num.h)
            pull = force_at(force[world], x)
            a = wp.vec3(0.0, 0.0, 0.0)
            wall = wp.vec3(0.0, 0.0, 0.0)
            start = i * lists.row
            for k in range(lists.number[i]):
                entry = lists.entries[start + k * lists.column]
                j = entry & INDEX_MASK
                code = entry >> INDEX_BITS
                xj = position[j]
                vj = velocity[j]
                if code > 0:
                    xj = image_position(box, xj, code)
                    vj = image_velocity(box, vj, code)
                r = x - xj
                u = v - vj
                r2 = wp.dot(r, r)
                q = wp.sqrt(r2) * inv_h
                f = mass[j] * slope(q, num.h)
                ur = wp.dot(u, r)
                wall_friction_acts, flows = float(shock), float(drag)
                if wp.static(changing):
                    # both partners must find the same force: means of what differs between them
                    other_phase = phases[world, phase_of[j]]
                    other_rest = rest_density(mass, volume, j)
                    fast = shock + other_phase.wave_speed * wp.sqrt(other_phase.density / other_rest)
                    wall_friction_acts = 0.5 * num.artificial_viscosity * num.h * fast / wp.max(rho, density[j])
                    thin = phase.viscosity * other_phase.viscosity
                    thin *= 2.0 / wp.max(phase.viscosity + other_phase.viscosity, 1.0e-30)
                    flows = 10.0 * num.viscous_lattice * thin / (rest * other_rest)
                scalar = float(0.0)
                if wp.static(strength):
                    # artificial viscosity on what the velocity gradients of both do not explain, such as rows that slip
                    # past each other: a smooth flow feels none (Frontiere, Raskin & Owen 2017)
                    flow = rate[j]
                    if code > 0:
                        flow = image_rate(box, flow, code)
                    scalar = wall_friction_acts * (ur - 0.5 * wp.dot(r, (own_rate + flow) * r)) / (r2 + tiny)
                else:
                    # for approaching particles (Monaghan 1992)
                    scalar = wall_friction_acts * wp.min(ur, 0.0) / (r2 + tiny)
                if wp.static(viscous):
                    # Monaghan & Gingold 1983: 2 (d + 2) mu / (rho_i rho_j), at rest density: a cavitated liquid, whose
                    # density is low, would break the bound on dt
                    scalar += flows * ur / (r2 + 0.01 * tiny)
                push = wp.vec3(0.0, 0.0, 0.0)
                if wp.static(strength):
                    other = stress[j]
                    if code > 0:
                        other = mirrored_stress(box, other, code)
                    other += own_stress
                    if wp.static(changing):
                        # (sigma_i + sigma_j) / (rho_i rho_j): light matter must not feel its heavy partner's mass
                        other *= 1.0 / (rho * density[j])
                    push = other * r
                    # artificial stress against the tensile instability (Monaghan 2000; Gray et al. 2001)
                    tension = wp.trace(other) / 3.0
                    if tension > 0.0:
                        ratio = kernel(q, num.h) * inv_w
                        scalar -= num.artificial_stress * tension * ratio * ratio * ratio * ratio
                else:
                    both = own + pressure_term[j]
                    if wp.static(changing):
                        both *= 1.0 / (rho * density[j])
                    scalar -= both
                push = f * (push + scalar * r)
                if code > 0:
                    for axis in range(3):
                        if face_kind(box, code, axis) == FRICTION:
                            wall[axis] = wall[axis] + push[axis]
                            push[axis] = 0.0
                a += push
            # Friction walls push but never pull, and wall_friction by Coulomb's law.
            for axis in range(3):
                if wall[axis] != 0.0:
                    inward = wp.sign(0.5 * (box.lower[axis] + box.upper[axis]) - x[axis])
                    normal = wp.max(inward * wall[axis], 0.0)
                    wall_friction = box.lower_friction[axis]
                    if inward < 0.0:
                        wall_friction = box.upper_friction[axis]
                    slide = v + dt[world] * (a + pull)
                    slide[axis] = 0.0
                    speed = wp.length(slide)
                    grip = wp.min(wall_friction * normal, speed / dt[world])
                    a -= (grip / wp.max(speed, 1.0e-12)) * slide
                    a[axis] = a[axis] + inward * normal
            acceleration[i] = a + pull

    return SimpleNamespace(
        strain=_named(strain, name),
        force=_named(force, name),
        move=move,
    )


def _named(function, name: str) -> wp.Kernel:
    """A kernel in a module of its own, under a name that tells its variant."""
    function.__name__ = f"{function.__name__}_{name}"
    return wp.kernel(function, module="unique", enable_backward=False)


@wp.kernel
def move(
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
    new_density: wp.array(dtype=float),
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
    """
    i = wp.tid()
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
        carried_gradient[i] = carried
        free = position[i] + h * v
        if too_fast(v, box.top_speed):
            wp.atomic_or(fault, 0, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * spacing)
        for axis in range(3):
            if x[axis] != free[axis] and box.lower_kind[axis] != PERIODIC:
                v[axis] = 0.0
        position[i] = x
        velocity[i] = v
        density[i] = new_density[i]
