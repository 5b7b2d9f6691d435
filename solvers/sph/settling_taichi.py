"""Settling of SPH in Taichi: settling_warp.py, written anew from the same equations."""

from typing import Any

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.scene import PERIODIC

from ..aging import GROWN
from ..flow_taichi import shear_rate
from ..images import WALL_INSET
from ..neighbours_taichi import BoxT, ListsT, contained, face_kind, image_gradient
from ..pairs_taichi import matrix_into, over_pairs, reader, stressed, vector_at, vector_into, writer
from ..smoothing import wendland
from ..taichi_bridge import Floats, Ints, Phases, Quads, Vectors, is_solid, phase_at, taichi_func, ti, vec3, vec4
from . import settling
from .particle import PARTED
from .particle_taichi import SmoothingT, damped, excess, slope
from .settling_warp import told_of
from .strain_taichi import matter_seen
from .strain_warp import MATTER

weight = taichi_func(wendland)
leaning = taichi_func(settling.leaning)
drift = taichi_func(settling.drift)
heard = taichi_func(settling.heard)
AVERAGED = settling.AVERAGED
matter_at = reader(MATTER)


def tell_pass(tensile: bool) -> Any:
    """The kernel, see settling_warp.py."""
    width, many = told_of(tensile), 4 if tensile else 16
    write = writer(width)

    @ti.func
    def pair(num, own, begun, other, r):
        w = slope(r.norm() / num.h, num.h) * other[3] / other[11]
        sums = ti.Vector.zero(ti.f32, many)
        sums[0] = -w * r.norm_sqr()
        sums = vector_into(sums, 1, w * r)
        if ti.static(not tensile):
            sums = vector_into(sums, 4, excess(num, r) * w * r)
            sums = matrix_into(sums, 7, -w * (vector_at(own, 4) - vector_at(other, 4)).outer_product(r))
        return sums

    @ti.func
    def uncrowded(num, box, code, own, begun, other, r, sums):
        """Walls crowd no liquid that cavitates."""
        out = sums
        if ti.static(not tensile):
            for axis in ti.static(range(3)):
                if face_kind(box, code, axis) != PERIODIC:
                    out = vector_into(out, 4, vec3(0.0))
        return out

    summed = over_pairs(MATTER, many, pair, matter_seen, uncrowded)

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
        position: Vectors,
    ):
        for i in range(held.shape[0]):
            if i % capacity < count[i // capacity]:
                own = matter_at(matter, i)
                sums = summed(num, box, lists, entries, number, matter, held, i, own, vec4(0.0))
                row = ti.Vector.zero(ti.f32, width)
                row = vector_into(row, 0, vector_at(own, 0))
                row[3], row[4] = own[3] / own[11], sums[0] * num.lattice / 3.0
                row = vector_into(row, 5, num.h * vector_at(sums, 1))
                if ti.static(not tensile):
                    phase = phase_at(phases, i // capacity, phase_of[i])
                    stirred = held[i] != CARRIED and not is_solid(phase)
                    sheared = shear_rate(stressed(sums, 7)) if stirred else 0.0
                    flowing[i] = damped(num, phase, own[7], sheared)
                    strain = ti.min(PARTED * num.settling * sheared, num.farthest)
                    row = vector_into(row, 8, -strain * num.h * num.h * vector_at(sums, 4))
                write(told, i, row)

    return tell


def settle_pass(tensile: bool) -> Any:
    """The kernel, see settling_warp.py."""
    width, many = told_of(tensile), 6 if tensile else 9
    told_at = reader(width)

    @ti.func
    def told_by(num, w, row):
        lean = leaning(vector_at(row, 5).norm_sqr(), num.disorder)
        means = ti.Vector([1.0, row[4], row[5], row[6], row[7], lean])
        sums = ti.Vector.zero(ti.f32, many)
        for c in ti.static(range(6)):
            sums[c] = w * means[c]
        return sums

    @ti.func
    def pair(num, own, begun, other, r):
        sums = told_by(num, other[3] * weight(r.norm() / num.h, num.h), other)
        if ti.static(not tensile):
            share = -num.evened * other[3] * slope(r.norm() / num.h, num.h)
            sums = vector_into(sums, 6, share * (vector_at(own, 8) - vector_at(other, 8)))
        return sums

    @ti.func
    def seen(box, extra: ti.template(), row, j, code):
        out = vector_into(row, 5, image_gradient(box, vector_at(row, 5), code))
        if ti.static(not tensile):
            out = vector_into(out, 8, image_gradient(box, vector_at(row, 8), code))
        return out

    summed = over_pairs(width, many, pair, seen)

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
        position: Vectors,
    ):
        for i in range(held.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world] and held[i] == FREE:
                own, phase = told_at(rows, i), phase_at(phases, world, phase_of[i])
                sums = summed(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                if ti.static(not tensile):
                    free = vector_at(own, 0) + vector_at(sums, 6)
                    position[i] = contained(box, free, WALL_INSET * num.spacing)
                rest = mass[i] / own[3]
                if rest >= GROWN * phase.density and not is_solid(phase):
                    sums += told_by(num, own[3] * weight(0.0, num.h), own)
                    filled, rho = sums[1] / sums[0], density[i]
                    mean = vec3(sums[2], sums[3], sums[4]) / sums[0]
                    lean = leaning(mean.norm_sqr(), AVERAGED * num.disorder)
                    off = drift(filled - rho / rest, lean, sums[5] / sums[0], num.density_tolerance * num.disorder)
                    if phase.relaxation_rate > 0.0:
                        off = ti.max(off, ti.min(1.0 - rho / rest, 0.0))
                    density[i] = rho + rest * heard(filled) * ti.min(num.settling * flowing[i], 1.0) * off

    return settle
