"""Elastic stress of position-based dynamics in Taichi: the passes of elastic_warp.py with the same arguments, written
anew from the same equations."""

from fluidbench.method.frame import CARRIED, FREE

from ..corrected import SINGULAR, SOUND
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
from ..smoothing import cusp, drag_weight, poly6, spiky_slope
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
    struct_of,
    taichi_func,
    ti,
    vec3,
    vec4,
)
from .numbers import MOVING, PULLING, Numbers

NumbersT = struct_of(Numbers)
gradient, weight = taichi_func(spiky_slope), taichi_func(drag_weight)
summed, flat = taichi_func(cusp), taichi_func(poly6)
moving_of, pulling_of = reader(MOVING), reader(PULLING)
write_pulling = writer(PULLING)


@ti.kernel
def pack(
    capacity: int, count: Ints, position: Vectors, volume: Floats, velocity: Vectors, overread: Floats, moving: Quads
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity]:
            x, v = position[i], velocity[i]
            moving[2 * i] = vec4(x[0], x[1], x[2], volume[i])
            moving[2 * i + 1] = vec4(v[0], v[1], v[2], overread[i])


@ti.func
def sloping(num, other, r):
    """V_j grad W, over the kernel's normalisation."""
    return other[3] * gradient(r.norm(), num.support) / ti.max(r.norm(), 1.0e-9) * r


@ti.func
def holding(num, other, r):
    """V_j w of hourglass control."""
    return other[3] * weight(r.norm() / num.support, num.support)


@ti.func
def own_density(num, volume):
    """What a particle adds to its own density: its volume counts by half."""
    return 0.5 * (volume + num.spacing**3) * summed(0.0, num.support)


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
    level = flat(r.norm(), num.support)
    sums = vector_into(sums, 21, other[3] * vec3(summed(r.norm(), num.support), level, level * other[7]))
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
            if phase.shear_modulus > 0.0:
                sums = strained_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                moment = symmetric_at(sums, 9)
                correction = symmetric_inverse(moment)
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
                own_level = own[3] * flat(0.0, num.support)
                level = sums[22] + own_level
                least = least_eigenvalue(moment)
                evened = num.evened * ti.math.clamp((least - SINGULAR) / (SOUND - SINGULAR), 0.0, 1.0)
                fabric = evened * moment.trace() / 3.0 * correction
                fabric_normal[i] = vec3(fabric[0, 0], fabric[1, 1], fabric[2, 2]) + (1.0 - evened)
                fabric_shear[i] = vec3(fabric[0, 1], fabric[0, 2], fabric[1, 2])
                beyond_face = least - num.face_moment
                enclosure[i] = ti.math.clamp(beyond_face / (num.halfway - num.face_moment), 0.0, 1.0)
                bias[i] = (sums[23] + own_level * own[7]) / level
                dense = num.weight * (sums[21] + own_density(num, own[3]))
                overread[i] = enclosure[i] * (dense / (num.flat_weight * level) - 1.0)
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


KERNELS = {"pack": pack, "strain": strain, "pull": pull}
