"""Weakly compressible SPH in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

import functools
from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE
from fluidbench.native.scene import PERIODIC

from ..aging import DISORDER, GROWN
from ..corrected import EDGE, INSIDE, LEANING, SOUND
from ..corrected_taichi import (
    elastic_stress,
    from_before,
    least_eigenvalue,
    mirrored_stress,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)
from ..crowding import FARTHEST
from ..flow_taichi import pressure, shear_rate, strained
from ..hourglass_taichi import off_linear_after
from ..images import WALL_INSET
from ..neighbours_taichi import BoxT, ListsT, contained, image_gradient, image_traction, image_velocity
from ..pairs_taichi import (
    matrix_into,
    over_pairs,
    reader,
    stressed,
    symmetric_at,
    vector_at,
    vector_into,
    writer,
)
from ..smoothing import wendland, wendland_slope
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Phases,
    Quads,
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
    vec4,
)
from .force_warp import width_of
from .particle import WHOLE, Smoothing
from .strain_warp import CRUSHED, FLOOR, MATTER

kernel = taichi_func(wendland)
slope = taichi_func(wendland_slope)
SmoothingT = struct_of(Smoothing)
matter_at = reader(MATTER)


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
            carried_gradient[i] = carried
            free = position[i] + h * v
            if held[i] == FREE:
                free += shift[i]
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


@ti.func
def drifted(num, phase, rho, rest, grown, flows, second, first_moment):
    """What is summed beyond what is integrated, where the neighbourhood is whole or too crowded: see particle.py."""
    drift = second * num.lattice / 3.0 - rho
    whole = 1.0
    if drift <= 0.0:
        whole = ti.max(1.0 - first_moment.norm() * num.h / (WHOLE * rho), 0.0)
    tolerance = num.density_tolerance
    if grown:
        tolerance = ti.max(tolerance, DISORDER)
    gap = ti.max(ti.abs(drift) - tolerance * rho, 0.0)
    drift = gap if drift > 0.0 else -gap
    if phase.relaxation_rate > 0.0 or grown:
        drift = ti.max(drift, ti.min(rest - rho, 0.0))
    if not flows:
        drift = ti.max(drift, 0.0)
    return whole * drift


@ti.func
def matter_seen(box, extra: ti.template(), row, j, code):
    """A row of `strain` in the walls."""
    moved = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
    return vector_into(moved, 8, image_gradient(box, vector_at(row, 8), code))


@functools.cache
def passes(strength: bool, tensile: bool, viscous: bool, changing: bool) -> SimpleNamespace:
    """All passes, for materials with or without shear stiffness, tension, viscosity, and parameters or rest densities
    that differ between particles."""
    width = width_of(strength, tensile, changing)
    last, many = width - 4, 25 if strength else 22 if tensile else 10
    state_at, write_state = reader(width), writer(width)

    @ti.func
    def strain_pair(num, own, begun, other, r):
        u = vector_at(own, 4) - vector_at(other, 4)
        w, partner, partner_gradient = other[3] * slope(r.norm() / num.h, num.h), other[7], vector_at(other, 8)
        if ti.static(changing):  # in volumes and compressions
            relative = own[11] / other[11]
            w, partner, partner_gradient = w * relative, partner * relative, partner_gradient * relative
        sums = ti.Vector.zero(ti.f32, many)
        sums[0] = w * (own[7] - partner - (vector_at(own, 8) + partner_gradient).dot(r))
        sums = vector_into(sums, 1, w * r)
        near = (kernel(r.norm() / num.h, num.h) / num.near) ** 4
        sums = vector_into(sums, 4, ti.max(near - 1.0, 0.0) * w * r)
        if ti.static(strength):
            sums = vector_into(sums, 22, w * u)
        if ti.static(tensile):
            sums = matrix_into(sums, 7, -w * u.outer_product(r))
            square = -w * r.outer_product(r)
            sums = vector_into(sums, 16, vec3(square[0, 0], square[1, 1], square[2, 2]))
            sums = vector_into(sums, 19, vec3(square[0, 1], square[0, 2], square[1, 2]))
        else:
            ur, r2 = u.dot(r), r.norm_sqr()
            sums[7], sums[8], sums[9] = -w * r2, w * ur, -w * ur * ur / (r2 + 0.01 * num.h * num.h)
        return sums

    strained_by = over_pairs(MATTER, many, strain_pair, matter_seen)

    @ti.kernel
    def strain(
        num: SmoothingT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        inside: Ints,
        capacity: int,
        count: Ints,
        matter: Quads,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        held: Ints,
        growth: Floats,
        elastic_normal: Vectors,
        elastic_shear: Vectors,
        off_linear: Vectors,
        plastic: Floats,
        new_density: Floats,
        state: Quads,
        shift: Vectors,
        fault: Ints,
    ):
        for i in range(held.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[i])
                own = matter_at(matter, i)
                rho, rest, sound = own[7], phase.density, phase.wave_speed
                if ti.static(changing):
                    rest = own[11]
                    sound *= ti.sqrt(phase.density / rest)
                grown = rest < GROWN * phase.density
                sums = strained_by(num, box, lists, entries, number, matter, held, i, own, vec4(0.0))
                spread, first_moment = sums[0], vector_at(sums, 1)
                second, approach, sheared, alone, least, flows, h = 0.0, 0.0, 0.0, 0.0, 0.0, True, dt[world]
                gradient, deformation, correction, span = mat3(0.0), mat3(0.0), mat3(0.0), mat3(0.0)
                b, s, z, off = vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0)
                if ti.static(tensile):
                    moment = symmetric_at(sums, 16)
                    second = moment.trace()
                    correction = symmetric_inverse(moment / rho)
                    gradient = stressed(sums, 7) @ correction / rho
                    span = spanned(moment / rho, correction)
                    deformation = strain_by_chords(span, gradient, h)
                    gradient = span @ gradient
                    approach = -rho * deformation.trace()
                    sheared = shear_rate(gradient)
                    least = least_eigenvalue(moment / rho)
                else:
                    second, approach = sums[7], sums[8]
                    sheared = ti.sqrt(5.0 * ti.max(sums[9], 0.0) / rho)
                if ti.static(strength):
                    b, s, z = elastic_normal[i], elastic_shear[i], off_linear[i]
                    off = (vector_at(sums, 22) - gradient @ first_moment) / rho
                    alone = ti.math.clamp((EDGE - least) / (EDGE - SOUND), 0.0, 1.0)
                    if least < SOUND:
                        off, z = vec3(0.0), vec3(0.0)
                        if ti.static(changing):
                            approach -= rho * growth[i]
                    if held[i] != CARRIED:
                        kept = 1.0
                        turned = from_before(deformation, gradient, h)
                        b, s, kept = strained(phase, phase.shear_modulus, turned, b, s, h, i, plastic)
                        flows = kept < 1.0 or phase.shear_modulus <= 0.0
                        z = off_linear_after(z, gradient, off, kept, h)
                        elastic_normal[i], elastic_shear[i], off_linear[i] = b, s, z
                inflow, crowd = approach, vector_at(sums, 4) / rho
                flows = flows and not is_solid(phase)
                if flows:
                    if ti.static(strength and changing):
                        enclosed = ti.math.clamp((least - LEANING) / (INSIDE - LEANING), 0.0, 1.0)
                        crowd += grown * enclosed / rho * first_moment
                    inflow += 2.0 * num.density_diffusion * num.h * sound * spread / rho
                else:
                    crowd *= ti.max(1.0 - num.broken / ti.max(crowd.norm(), 1.0e-12), 0.0)
                if flows or grown:
                    drift = drifted(num, phase, rho, rest, grown, flows, second, first_moment)
                    inflow += num.density_feedback * sound / num.h * drift
                shift[i] = -ti.min(num.shifting * h * sheared, FARTHEST) * num.h * num.h * crowd
                rho += h * inflow
                if rho <= -rest or beyond(rho, CRUSHED * rest):
                    ti.atomic_or(fault[0], FAULT_STATE)
                rho = ti.max(rho, FLOOR * rest)
                new_density[i] = rho
                p = pressure(rho / rest - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
                scale = 1.0 / (rho * rho)
                if ti.static(changing):
                    scale *= rest
                row = ti.Vector.zero(ti.f32, width)
                for c in ti.static(range(7)):
                    row[c] = own[c]
                cauchy = mat3(0.0)
                for c in ti.static(range(3)):
                    cauchy[c, c] = -p
                if ti.static(strength):
                    damping = 0.1 * num.artificial_viscosity * num.h * sound * rho
                    packing = ti.max(num.lattice * second / (3.0 * rho), 1.0)
                    pull = num.compact / packing**2 * (num.hourglass * phase.shear_modulus * z + damping * off)
                    cauchy = elastic_stress(phase.shear_modulus * rho / rest, b, s, p)
                    cauchy -= pull.outer_product(first_moment / own[7])
                    row = vector_into(row, 16, scale * pull)
                    row[19] = alone
                if ti.static(tensile):
                    row = matrix_into(row, 7, scale * (span @ cauchy @ correction))
                else:
                    row[7] = scale * p
                if ti.static(changing):
                    row = vector_into(row, last, vec3(rho, rest, phase.viscosity))
                    row[last + 3] = sound
                write_state(state, i, row)

    @ti.func
    def state_seen(box, extra: ti.template(), row, j, code):
        out = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
        if ti.static(tensile):
            out = matrix_into(out, 7, mirrored_stress(box, stressed(row, 7), code))
        if ti.static(strength):
            out = vector_into(out, 16, image_traction(box, vector_at(row, 16), code))
        return out

    @ti.func
    def force_pair(num, own, begun, other, r):
        u = vector_at(own, 4) - vector_at(other, 4)
        r2, ur, tiny = r.norm_sqr(), u.dot(r), 0.01 * num.h * num.h
        q = ti.sqrt(r2) / num.h
        shock, drag = begun[0], begun[1]
        mine, theirs = 1.0, 1.0
        if ti.static(changing):
            mine, theirs = 1.0 / other[last + 1], 1.0 / own[last + 1]
            # means of both partners, for both must find the same force
            fast = 0.5 * (own[last + 3] + other[last + 3])
            shock = num.artificial_viscosity * num.h * fast / ti.max(own[last], other[last])
            thin = 2.0 * own[last + 2] * other[last + 2] / ti.max(own[last + 2] + other[last + 2], 1.0e-30)
            drag = 10.0 * num.viscous_lattice * thin / (own[last + 1] * other[last + 1])
        along = 0.0  # what acts along the line of centres
        push = vec3(0.0)
        if ti.static(tensile):
            push = (mine * stressed(own, 7) + theirs * stressed(other, 7)) @ r
        else:
            along = -(mine * own[7] + theirs * other[7])
        if ti.static(strength):
            push += theirs * vector_at(other, 16) - mine * vector_at(own, 16)
            along += ti.max(own[19], other[19]) * shock * ur / (r2 + tiny)
        else:
            along += shock * ti.min(ur, 0.0) / (r2 + tiny)
        if ti.static(viscous):
            along += drag * ur / (r2 + 0.01 * tiny)
        return vector_into(ti.Vector.zero(ti.f32, 6), 0, other[3] * slope(q, num.h) * (push + along * r))

    pushed_by = over_pairs(width, 6, force_pair, state_seen, rough=True)

    @ti.kernel
    def force(
        num: SmoothingT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        inside: Ints,
        capacity: int,
        count: Ints,
        state: Quads,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        forces: Forces,
        density: Floats,
        acceleration: Vectors,
    ):
        for i in range(phase_of.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[i])
                own = state_at(state, i)
                # Pi_ij per velocity difference: alpha h c / rho (Monaghan 1992), and 2 (d + 2) mu / (rho_i rho_j)
                shock = num.artificial_viscosity * num.h * phase.wave_speed / phase.density
                drag = 10.0 * num.viscous_lattice * phase.viscosity / (phase.density * phase.density)
                begun = vec4(shock, drag, 0.0, 0.0)
                sums = pushed_by(num, box, lists, entries, number, state, density, i, own, begun)
                a = vector_at(sums, 0) + force_at(forces, world, vector_at(own, 0))
                rub = rubbed(box, vector_at(own, 0), vector_at(own, 4), a, vector_at(sums, 3), dt[world])
                acceleration[i] = a + rub

    return SimpleNamespace(pack=pack, strain=strain, force=force, move=move)
