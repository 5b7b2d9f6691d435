"""Elastic stress of position-based dynamics in Taichi: the passes of elastic_warp.py with the same arguments, written
anew from the same equations."""

from fluidbench.method.frame import CARRIED, FREE

from ..corrected import SOUND
from ..corrected_taichi import (
    elastic_stress,
    from_before,
    least_eigenvalue,
    mirrored_stress,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)
from ..flow_taichi import pressure, strained
from ..hourglass_taichi import off_linear_after
from ..neighbours_taichi import BoxT, ListsT, image_traction, image_velocity
from ..pairs_taichi import matrix_into, over_pairs, reader, stressed, symmetric_at, vector_at, vector_into, writer
from ..smoothing import drag_tail, drag_weight
from ..taichi_bridge import (
    Floats,
    Ints,
    Phases,
    Quads,
    Vectors,
    is_solid,
    mat3,
    phase_at,
    rest_density,
    taichi_func,
    ti,
    vec3,
    vec4,
)
from .numbers import MOVING, PULLING
from .surroundings_taichi import NumbersT, density_around, fabric_around, levels, moving_of, sloping

weight = taichi_func(drag_weight, drag_tail)
pulling_of = reader(PULLING)
write_pulling = writer(PULLING)


@ti.func
def holding(num, other, r):
    """V_j w of hourglass control."""
    return other[3] * weight(r.norm() / num.support, num.support)


@ti.func
def moving_seen(box, extra: ti.template(), row, j, code):
    return vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))


@ti.func
def pulling_seen(box, extra: ti.template(), row, j, code):
    out = matrix_into(row, 4, mirrored_stress(box, stressed(row, 4), code))
    return vector_into(out, 13, image_traction(box, vector_at(row, 13), code))


@ti.func
def strain_pair(num, own, begun, other, r):
    g = sloping(num, other, r)
    square = -g.outer_product(r)
    u = vector_at(own, 4) - vector_at(other, 4)
    sums = matrix_into(ti.Vector.zero(ti.f32, 24), 0, -u.outer_product(g))
    sums = vector_into(sums, 9, vec3(square[0, 0], square[1, 1], square[2, 2]))
    sums = vector_into(sums, 12, vec3(square[0, 1], square[0, 2], square[1, 2]))
    sums = vector_into(sums, 15, holding(num, other, r) * r)
    sums = vector_into(sums, 21, levels(num, other, r))
    return vector_into(sums, 18, holding(num, other, r) * u)


strained_by = over_pairs(MOVING, 24, strain_pair, moving_seen)


@ti.kernel
def strain(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    volume: Floats,
    volume_ratio: Floats,
    elastic_normal: Vectors,
    elastic_shear: Vectors,
    off_linear: Vectors,
    plastic: Floats,
    kept: Floats,
    enclosure: Floats,
    overread: Floats,
    bias: Floats,
    fabric_normal: Vectors,
    fabric_shear: Vectors,
    pulling: Quads,
    pulled: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            phase = phase_at(phases, world, phase_of[i])
            own = moving_of(rows, i)
            carried, back = mat3(0.0), vec3(0.0)
            sums = strained_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
            moment = symmetric_at(sums, 9)
            correction = symmetric_inverse(moment)
            bias[i], enclosure[i], overread[i] = density_around(num, own, moment, vector_at(sums, 21))
            fabric_normal[i], fabric_shear[i] = fabric_around(num, moment, correction)
            if phase.shear_modulus > 0.0:
                span = spanned(moment, correction)
                slope = stressed(sums, 0) @ correction
                along = span @ slope
                slope = from_before(strain_by_chords(span, slope, dt[world]), along, dt[world])
                leaning, z = vector_at(sums, 15), off_linear[i]
                off = vector_at(sums, 18) - along @ leaning
                if least_eigenvalue(moment) < SOUND:
                    off, z = vec3(0.0), vec3(0.0)
                b, s, share, ratio, push = elastic_normal[i], elastic_shear[i], kept[i], volume_ratio[i], 0.0
                if held[i] != CARRIED:
                    b, s, share = strained(phase, phase.shear_modulus, slope, b, s, dt[world], i, plastic)
                    z = off_linear_after(z, along, off, share, dt[world])
                    elastic_normal[i], elastic_shear[i], off_linear[i], kept[i] = b, s, z, share
                    if is_solid(phase):
                        ratio *= (ti.Matrix.identity(ti.f32, 3) + dt[world] * slope).determinant()
                        volume_ratio[i] = ratio
                if is_solid(phase):
                    push = ratio * pressure(1.0 / ratio - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
                packing = ti.max(num.lattice * moment.trace() / 3.0, 1.0)
                back = share * phase.shear_modulus * num.hourglass / packing**2 * z
                carried = elastic_stress(share * phase.shear_modulus, b, s, push) - back.outer_product(leaning)
                carried = span @ carried @ correction
            row = ti.Vector.zero(ti.f32, PULLING)
            for c in ti.static(range(4)):
                row[c] = own[c]
            write_pulling(pulling, i, vector_into(matrix_into(row, 4, carried), 13, back))


@ti.func
def pull_pair(num, own, begun, other, r):
    back = vector_at(other, 13) - vector_at(own, 13)
    return (stressed(own, 4) + stressed(other, 4)) @ sloping(num, other, r) + holding(num, other, r) * back


pulled_by = over_pairs(PULLING, 3, pull_pair, pulling_seen)


@ti.kernel
def pull(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    volume: Floats,
    volume_ratio: Floats,
    elastic_normal: Vectors,
    elastic_shear: Vectors,
    off_linear: Vectors,
    plastic: Floats,
    kept: Floats,
    enclosure: Floats,
    overread: Floats,
    bias: Floats,
    fabric_normal: Vectors,
    fabric_shear: Vectors,
    pulling: Quads,
    pulled: Vectors,
):
    for i in range(held.shape[0]):
        if i % capacity < count[i // capacity] and held[i] == FREE:
            own = pulling_of(rows, i)
            sums = pulled_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
            pulled[i] = sums / rest_density(mass, volume, i)


KERNELS = {"strain": strain, "pull": pull}
