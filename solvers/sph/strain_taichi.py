"""The first sum over neighbours of SPH in Taichi: strain_warp.py, written anew from the same equations."""

from typing import Any

from fluidbench.method.frame import CARRIED
from fluidbench.native.pool import FAULT_STATE

from ..aging import GROWN
from ..corrected import EDGE, INSIDE, LEANING, SOUND
from ..corrected_taichi import (
    elastic_stress,
    from_before,
    least_eigenvalue,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)
from ..flow_taichi import pressure, shear_rate, strained
from ..hourglass_taichi import off_linear_after
from ..neighbours_taichi import BoxT, ListsT, image_gradient, image_velocity, turned_back
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
from ..taichi_bridge import (
    Floats,
    Ints,
    Phases,
    Quads,
    Vectors,
    beyond,
    is_solid,
    mat3,
    phase_at,
    ti,
    vec3,
    vec4,
)
from ..viscosity_taichi import weight
from .force_warp import width_of
from .particle import FARTHEST, LEVELLED, THINNEST
from .particle_taichi import SmoothingT, crowded, damped, excess, slope
from .strain_warp import CRUSHED, FLOOR, MATTER

matter_at = reader(MATTER)


@ti.func
def matter_seen(box, extra: ti.template(), row, j, code):
    """A row of `strain` in the walls."""
    moved = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
    return vector_into(moved, 8, image_gradient(box, vector_at(row, 8), code))


def strain_pass(strength: bool, tensile: bool, viscous: bool, changing: bool) -> Any:
    """The kernel, see strain_warp.py."""
    width = width_of(strength, tensile, viscous, changing)
    last, drags = width_of(strength, tensile, False, False), width - 4
    full = 28 if strength else 22 if tensile else 3
    many = full + viscous
    write_state = writer(width)

    @ti.func
    def strain_pair(num, own, begun, other, r):
        u = vector_at(own, 4) - vector_at(other, 4)
        w, partner, partner_gradient = other[3] * slope(r.norm() / num.h, num.h), other[7], vector_at(other, 8)
        if ti.static(changing):  # in volumes and compressions
            relative = own[11] / other[11]
            w, partner, partner_gradient = w * relative, partner * relative, partner_gradient * relative
        sums = ti.Vector.zero(ti.f32, many)
        sums[0] = w * (own[7] - partner - (vector_at(own, 8) + partner_gradient).dot(r))
        if ti.static(strength):
            sums = vector_into(vector_into(sums, 22, w * u), 25, w * r)
        if ti.static(tensile):
            sums = matrix_into(sums, 1, -w * u.outer_product(r))
            square = -w * r.outer_product(r)
            sums = vector_into(sums, 10, vec3(square[0, 0], square[1, 1], square[2, 2]))
            sums = vector_into(sums, 13, vec3(square[0, 1], square[0, 2], square[1, 2]))
            sums = vector_into(sums, 16, (partner - own[7]) * w * r)
            sums = vector_into(sums, 19, excess(num, r) * w * r)
        else:
            sums[1], sums[2] = w * u.dot(r), -w * r.norm_sqr()
        if ti.static(viscous):
            near = weight(r.norm() / (2.0 * num.h), 2.0 * num.h)
            sums[full] = other[3] / other[11] * near * r.norm_sqr() / 3.0
        return sums

    @ti.func
    def strain_across(num, box, code, own, begun, other, r, sums):
        out = sums
        w = other[3] * slope(r.norm() / num.h, num.h)
        if ti.static(changing):
            w *= own[11] / other[11]
        v, m = vector_at(other, 4), w * turned_back(box, code) * r
        if ti.static(tensile):
            out = matrix_into(out, 1, stressed(out, 1) - v.outer_product(m))
        else:
            out[1] += v.dot(m)
        return out

    strained_by = over_pairs(MATTER, many, strain_pair, matter_seen, strain_across)

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
        carried_gradient: Vectors,
        flowing: Floats,
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
                spread, first_moment = sums[0], vec3(0.0)
                second, alone, least, flows, h = sums[2], 0.0, 0.0, True, dt[world]
                deformation, correction, span = mat3(0.0), mat3(0.0), mat3(0.0)
                b, s, z, off = vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0)
                gradient, approach, sheared = mat3(0.0), sums[1], 0.0
                if ti.static(tensile):
                    gradient = stressed(sums, 1) / rho
                    moment = symmetric_at(sums, 10)
                    second = moment.trace()
                    correction = symmetric_inverse(moment / rho)
                    gradient = gradient @ correction
                    span = spanned(moment / rho, correction)
                    deformation = strain_by_chords(span, gradient, h)
                    gradient = span @ gradient
                    approach = -rho * deformation.trace()
                    least = least_eigenvalue(moment / rho)
                    carried_gradient[i] = 0.5 / rho * (correction @ vector_at(sums, 16))
                    sheared = shear_rate(gradient)
                if ti.static(strength):
                    b, s, z = elastic_normal[i], elastic_shear[i], off_linear[i]
                    first_moment = vector_at(sums, 25)
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
                inflow, crowd = approach, vec3(0.0)
                if ti.static(tensile):
                    crowd = vector_at(sums, 19) / rho
                flows = flows and not is_solid(phase)
                if flows:
                    if ti.static(strength):
                        enclosed = ti.math.clamp((least - LEANING) / (INSIDE - LEANING), 0.0, 1.0)
                        crowd += enclosed / rho * first_moment
                    rate = num.density_diffusion * sound / num.h
                    if ti.static(tensile):
                        stirred = sheared
                        if ti.static(changing):
                            stirred += growth[i]
                        rate = ti.min(rate, LEVELLED * stirred)
                    inflow += 2.0 * num.h * num.h * rate * spread / rho
                elif ti.static(tensile):
                    crowd *= ti.max(1.0 - num.broken / ti.max(crowd.norm(), 1.0e-12), 0.0)
                if flows or grown:
                    inflow += num.density_feedback * sound / num.h * crowded(num, rho, second)
                if ti.static(tensile):
                    flowing[i] = damped(num, phase, rho, sheared) if flows and held[i] != CARRIED else 0.0
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
                if ti.static(viscous):
                    row[drags] = 1.0 / ti.sqrt(ti.max(sums[full], THINNEST))
                    if ti.static(changing):
                        row[drags + 1] = growth[i]
                write_state(state, i, row)

    return strain
