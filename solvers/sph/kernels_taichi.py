"""Weakly compressible SPH in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

import functools
from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE
from fluidbench.native.scene import FRICTION, PERIODIC

from ..aging import DISORDER
from ..corrected_taichi import elastic_stress, mirrored_stress, symmetric_inverse
from ..flow_taichi import pressure, strained
from ..neighbours import INDEX_BITS, INDEX_MASK, WALL_INSET
from ..neighbours_taichi import (
    BoxT,
    ListsT,
    contained,
    face_kind,
    image_gradient,
    image_position,
    image_rate,
    image_velocity,
)
from ..smoothing import wendland, wendland_slope
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Matrices,
    Phases,
    Vectors,
    beyond,
    force_at,
    is_solid,
    mat3,
    phase_at,
    rest_density,
    struct_of,
    taichi_func,
    ti,
    too_fast,
    vec3,
)
from .kernels_warp import CRUSHED, FLOOR, WHOLE, Smoothing

kernel = taichi_func(wendland)
slope = taichi_func(wendland_slope)
SmoothingT = struct_of(Smoothing)


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
    new_density: Floats,
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
            carried_gradient[i] = carried
            free = position[i] + h * v
            if too_fast(v, box.top_speed):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x = contained(box, free, WALL_INSET * spacing)
            for axis in ti.static(range(3)):
                if x[axis] != free[axis] and box.lower_kind[axis] != PERIODIC:
                    v[axis] = 0.0
            position[i], velocity[i], density[i] = x, v, new_density[i]


@ti.func
def rubbed(box, x, v, inward_pull, walls, h):
    """Acceleration by friction walls, from what pairs across them push: never pulled, and rubbed by Coulomb's law up to
    what stops the slide within h."""
    a = inward_pull
    gained = vec3(0.0)
    for axis in ti.static(range(3)):
        if walls[axis] != 0.0:
            inward, friction = 1.0, box.lower_friction[axis]
            if 0.5 * (box.lower[axis] + box.upper[axis]) < x[axis]:
                inward, friction = -1.0, box.upper_friction[axis]
            normal = ti.max(inward * walls[axis], 0.0)
            slide = v + h * (a + gained)
            slide[axis] = 0.0
            speed = slide.norm()
            gained -= ti.min(friction * normal, speed / h) / ti.max(speed, 1.0e-12) * slide
            gained[axis] += inward * normal
    return gained


@functools.cache
def passes(strength: bool, viscous: bool, changing: bool) -> SimpleNamespace:
    """All passes, for materials with or without shear stiffness, viscosity, and parameters or rest densities that
    differ between particles."""

    @ti.kernel
    def strain(
        num: SmoothingT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        capacity: int,
        count: Ints,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        held: Ints,
        position: Vectors,
        velocity: Vectors,
        mass: Floats,
        volume: Floats,
        density: Floats,
        carried_gradient: Vectors,
        elastic_normal: Vectors,
        elastic_shear: Vectors,
        new_density: Floats,
        pressure_term: Floats,
        stress: Matrices,
        rate: Matrices,
        fault: Ints,
    ):
        for i in range(position.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[i])
                rho, rest, sound = density[i], phase.density, phase.wave_speed
                if ti.static(changing):
                    rest = rest_density(mass, volume, i)
                    sound *= ti.sqrt(phase.density / rest)
                approach, spread, second = 0.0, 0.0, 0.0
                first_moment = vec3(0.0)
                gradient, moment = mat3(0.0), mat3(0.0)
                for k in range(number[i]):
                    entry = entries[i * lists.row + k * lists.column]
                    j, code = entry & INDEX_MASK, entry >> INDEX_BITS
                    xj, vj, partner_gradient = position[j], velocity[j], carried_gradient[j]
                    if code > 0:
                        xj, vj = image_position(box, xj, code), image_velocity(box, vj, code)
                        partner_gradient = image_gradient(box, partner_gradient, code)
                    r, u = position[i] - xj, velocity[i] - vj
                    w, partner = mass[j] * slope(r.norm() / num.h, num.h), density[j]
                    if ti.static(changing):  # in volumes and compressions
                        relative = rest / rest_density(mass, volume, j)
                        w, partner, partner_gradient = w * relative, partner * relative, partner_gradient * relative
                    approach += w * u.dot(r)
                    spread += w * (rho - partner - (carried_gradient[i] + partner_gradient).dot(r))
                    second -= w * r.norm_sqr()
                    first_moment += w * r
                    if ti.static(strength):
                        gradient -= w * u.outer_product(r)
                        moment -= w * r.outer_product(r)
                correction = ti.Matrix.identity(ti.f32, 3)
                if ti.static(strength):
                    correction = symmetric_inverse(moment / rho)
                    gradient = gradient @ correction / rho
                    rate[i] = gradient
                    approach = -rho * gradient.trace()
                # What is summed against what is integrated, where the neighbourhood is whole or too crowded.
                drift = second * num.lattice / 3.0 - rho
                whole = 1.0
                if drift <= 0.0:
                    whole = ti.max(1.0 - first_moment.norm() * num.h / (WHOLE * rho), 0.0)
                grown = rest < 0.99 * phase.density
                tolerance = num.density_tolerance
                if grown:
                    tolerance = ti.max(tolerance, DISORDER)
                gap = ti.max(ti.abs(drift) - tolerance * rho, 0.0)
                drift = gap if drift > 0.0 else -gap
                if phase.relaxation_rate > 0.0 or grown:
                    drift = ti.max(drift, ti.min(rest - rho, 0.0))
                if is_solid(phase):
                    drift, spread = 0.0, 0.0
                h = dt[world]
                growth = approach + num.density_feedback * sound / num.h * whole * drift
                growth += 2.0 * num.density_diffusion * num.h * sound * spread / rho
                rho += h * growth
                if rho <= -rest or beyond(rho, CRUSHED * rest):
                    ti.atomic_or(fault[0], FAULT_STATE)
                rho = ti.max(rho, FLOOR * rest)
                new_density[i] = rho
                p = pressure(rho / rest - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
                scale = 1.0
                if ti.static(not changing):
                    scale = 1.0 / (rho * rho)
                if ti.static(strength):
                    b, s = elastic_normal[i], elastic_shear[i]
                    if held[i] != CARRIED:
                        b, s = strained(phase, phase.shear_modulus, gradient, b, s, h)
                        elastic_normal[i], elastic_shear[i] = b, s
                    cauchy = elastic_stress(phase.shear_modulus * rho / rest, b, s, p)
                    stress[i] = scale * (cauchy @ correction)
                else:
                    pressure_term[i] = scale * p

    @ti.kernel
    def force(
        num: SmoothingT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        capacity: int,
        count: Ints,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        forces: Forces,
        position: Vectors,
        velocity: Vectors,
        mass: Floats,
        volume: Floats,
        density: Floats,
        pressure_term: Floats,
        stress: Matrices,
        rate: Matrices,
        acceleration: Vectors,
    ):
        for i in range(position.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[i])
                x, v, rho = position[i], velocity[i], density[i]
                tiny = 0.01 * num.h * num.h
                # Pi_ij per velocity difference: alpha h c / rho (Monaghan 1992), and 2 (d + 2) mu / (rho_i rho_j)
                shock = num.artificial_viscosity * num.h * phase.wave_speed / rho
                drag = 10.0 * num.viscous_lattice * phase.viscosity / (phase.density * phase.density)
                rest, sound = phase.density, phase.wave_speed
                if ti.static(changing):
                    rest = rest_density(mass, volume, i)
                    sound *= ti.sqrt(phase.density / rest)
                lattice = kernel(num.spacing / num.h, num.h)
                pull = force_at(forces, world, x)
                a, walls = vec3(0.0), vec3(0.0)
                for k in range(number[i]):
                    entry = entries[i * lists.row + k * lists.column]
                    j, code = entry & INDEX_MASK, entry >> INDEX_BITS
                    xj, vj = position[j], velocity[j]
                    if code > 0:
                        xj, vj = image_position(box, xj, code), image_velocity(box, vj, code)
                    r, u = x - xj, v - vj
                    r2, ur = r.norm_sqr(), u.dot(r)
                    q = ti.sqrt(r2) / num.h
                    if ti.static(changing):
                        # means of both partners, for both must find the same force
                        partner = phase_at(phases, world, phase_of[j])
                        other_rest = rest_density(mass, volume, j)
                        fast = 0.5 * (sound + partner.wave_speed * ti.sqrt(partner.density / other_rest))
                        shock = num.artificial_viscosity * num.h * fast / ti.max(rho, density[j])
                        total = ti.max(phase.viscosity + partner.viscosity, 1.0e-30)
                        thin = 2.0 * phase.viscosity * partner.viscosity / total
                        drag = 10.0 * num.viscous_lattice * thin / (rest * other_rest)
                    along = 0.0  # what acts along the line of centres
                    push = vec3(0.0)
                    if ti.static(strength):
                        flow, other = rate[j], stress[j]
                        if code > 0:
                            flow, other = image_rate(box, flow, code), mirrored_stress(box, other, code)
                        along = shock * (ur - 0.5 * r.dot((rate[i] + flow) @ r)) / (r2 + tiny)
                        other += stress[i]
                        if ti.static(changing):
                            other /= rho * density[j]
                        push = other @ r
                        tension = other.trace() / 3.0
                        if tension > 0.0:
                            along -= num.artificial_stress * tension * (kernel(q, num.h) / lattice) ** 4
                    else:
                        both = pressure_term[i] + pressure_term[j]
                        if ti.static(changing):
                            both /= rho * density[j]
                        along = shock * ti.min(ur, 0.0) / (r2 + tiny) - both
                    if ti.static(viscous):
                        along += drag * ur / (r2 + 0.01 * tiny)
                    push = mass[j] * slope(q, num.h) * (push + along * r)
                    for axis in ti.static(range(3)):
                        if code > 0 and face_kind(box, code, axis) == FRICTION:
                            walls[axis] += push[axis]
                            push[axis] = 0.0
                    a += push
                acceleration[i] = a + pull + rubbed(box, x, v, a + pull, walls, dt[world])

    return SimpleNamespace(strain=strain, force=force, move=move)
