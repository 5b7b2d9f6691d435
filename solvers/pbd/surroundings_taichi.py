"""Surroundings of particles of position-based dynamics in Taichi: the passes of surroundings_warp.py with the same
arguments, written anew from the same equations."""

from ..corrected import SINGULAR, SOUND
from ..corrected_taichi import least_eigenvalue, symmetric_inverse
from ..neighbours_taichi import BoxT, ListsT
from ..pairs_taichi import over_pairs, reader, symmetric_at, vector_at, vector_into
from ..smoothing import cusp, poly6, spiky_slope
from ..taichi_bridge import Floats, Ints, Quads, Vectors, struct_of, taichi_func, ti, vec3, vec4
from .numbers import MOVING, Numbers

NumbersT = struct_of(Numbers)
gradient = taichi_func(spiky_slope)
summed, flat = taichi_func(cusp), taichi_func(poly6)
moving_of = reader(MOVING)


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
def own_density(num, volume):
    """What a particle adds to its own density: its volume counts by half."""
    return 0.5 * (volume + num.spacing**3) * summed(0.0, num.support)


@ti.func
def levels(num, other, r):
    """A partner's share of both densities and of the over-reading."""
    level = flat(r.norm(), num.support)
    return other[3] * vec3(summed(r.norm(), num.support), level, level * other[7])


@ti.func
def density_around(num, own, moment, found):
    """(bias, enclosure, over-reading)"""
    own_level = own[3] * flat(0.0, num.support)
    level = found[1] + own_level
    least = least_eigenvalue(moment)
    beyond_face = ti.math.clamp((least - num.face_moment) / (num.halfway - num.face_moment), 0.0, 1.0)
    alike = 27.0 * moment.determinant() / ti.max(moment.trace(), 1.0e-12) ** 3
    enclosure = beyond_face * ti.math.clamp((alike - num.uneven) / (num.even - num.uneven), 0.0, 1.0)
    dense = num.weight * (found[0] + own_density(num, own[3]))
    return (found[2] + own_level * own[7]) / level, enclosure, beyond_face * (dense / (num.flat_weight * level) - 1.0)


@ti.func
def fabric_around(num, moment, correction):
    """Normal and shear parts of the inverse of the fabric."""
    evened = num.evened * ti.math.clamp((least_eigenvalue(moment) - SINGULAR) / (SOUND - SINGULAR), 0.0, 1.0)
    fabric = evened * moment.trace() / 3.0 * correction
    normal = vec3(fabric[0, 0], fabric[1, 1], fabric[2, 2]) + (1.0 - evened)
    return normal, vec3(fabric[0, 1], fabric[0, 2], fabric[1, 2])


@ti.func
def surround_pair(num, own, begun, other, r):
    square = -sloping(num, other, r).outer_product(r)
    sums = vector_into(ti.Vector.zero(ti.f32, 9), 0, vec3(square[0, 0], square[1, 1], square[2, 2]))
    sums = vector_into(sums, 3, vec3(square[0, 1], square[0, 2], square[1, 2]))
    return vector_into(sums, 6, levels(num, other, r))


surrounded_by = over_pairs(MOVING, 9, surround_pair)


@ti.kernel
def surround(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    enclosure: Floats,
    overread: Floats,
    bias: Floats,
    fabric_normal: Vectors,
    fabric_shear: Vectors,
):
    for i in range(enclosure.shape[0]):
        if i % capacity < count[i // capacity]:
            own = moving_of(rows, i)
            sums = surrounded_by(num, box, lists, entries, number, rows, enclosure, i, own, vec4(0.0))
            moment = symmetric_at(sums, 0)
            bias[i], enclosure[i], overread[i] = density_around(num, own, moment, vector_at(sums, 6))
            fabric_normal[i], fabric_shear[i] = fabric_around(num, moment, symmetric_inverse(moment))


KERNELS = {"pack": pack, "surround": surround}
