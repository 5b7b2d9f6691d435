"""Settling of SPH in Taichi: settling_warp.py, written anew from the same equations."""

from fluidbench.method.frame import FREE

from ..aging import GROWN
from ..neighbours_taichi import BoxT, ListsT, image_gradient
from ..pairs_taichi import over_pairs, reader, vector_at, vector_into
from ..smoothing import wendland
from ..taichi_bridge import Floats, Ints, Phases, Quads, is_solid, phase_at, taichi_func, ti, vec3, vec4
from . import settling
from .particle_taichi import SmoothingT, slope
from .strain_warp import MATTER

weight = taichi_func(wendland)
leaning = taichi_func(settling.leaning)
drift = taichi_func(settling.drift)
heard = taichi_func(settling.heard)
AVERAGED, TOLD = settling.AVERAGED, settling.TOLD
matter_at, told_at = reader(MATTER), reader(TOLD)


@ti.func
def tell_pair(num, own, begun, other, r):
    w = slope(r.norm() / num.h, num.h) * other[3] / other[11]
    return vec4(-w * r.norm_sqr(), w * r[0], w * r[1], w * r[2])


@ti.func
def told_by(num, w, row):
    lean = leaning(vector_at(row, 5).norm_sqr(), num.disorder)
    return w * ti.Vector([1.0, row[4], row[5], row[6], row[7], lean])


@ti.func
def settle_pair(num, own, begun, other, r):
    return told_by(num, other[3] * weight(r.norm() / num.h, num.h), other)


@ti.func
def told_seen(box, extra: ti.template(), row, j, code):
    return vector_into(row, 5, image_gradient(box, vector_at(row, 5), code))


told_of = over_pairs(MATTER, 4, tell_pair)
settled_by = over_pairs(TOLD, 6, settle_pair, told_seen)


@ti.kernel
def tell(
    num: SmoothingT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    matter: Quads,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    flowing: Floats,
    told: Quads,
    density: Floats,
):
    for i in range(held.shape[0]):
        if i % capacity < count[i // capacity]:
            own = matter_at(matter, i)
            sums = told_of(num, box, lists, entries, number, matter, held, i, own, vec4(0.0))
            filled, lean = sums[0] * num.lattice / 3.0, num.h * vector_at(sums, 1)
            told[2 * i] = vec4(own[0], own[1], own[2], own[3] / own[11])
            told[2 * i + 1] = vec4(filled, lean[0], lean[1], lean[2])


@ti.kernel
def settle(
    num: SmoothingT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    flowing: Floats,
    told: Quads,
    density: Floats,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            own, phase = told_at(rows, i), phase_at(phases, world, phase_of[i])
            rest = mass[i] / own[3]
            if held[i] == FREE and rest >= GROWN * phase.density and not is_solid(phase):
                sums = settled_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                sums += told_by(num, own[3] * weight(0.0, num.h), own)
                filled, rho = sums[1] / sums[0], density[i]
                mean = vec3(sums[2], sums[3], sums[4]) / sums[0]
                lean = leaning(mean.norm_sqr(), AVERAGED * num.disorder)
                off = drift(filled - rho / rest, lean, sums[5] / sums[0], num.density_tolerance * num.disorder)
                if phase.relaxation_rate > 0.0:
                    off = ti.max(off, ti.min(1.0 - rho / rest, 0.0))
                rate = heard(filled) * ti.min(num.settling * flowing[i], 1.0)
                density[i] = rho + rest * rate * off
