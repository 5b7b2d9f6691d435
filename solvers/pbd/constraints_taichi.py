"""The constraints of position-based fluids in Taichi: the passes of constraints_warp.py with the same arguments,
written anew from the same equations."""

from collections.abc import Callable

from fluidbench.method.frame import FREE

from ..neighbours_taichi import BoxT, ListsT, image_gradient
from ..pairs_taichi import over_pairs, reader, symmetric_at, vector_at, vector_into, writer
from ..taichi_bridge import Floats, Ints, Phases, Quads, Vectors, is_solid, phase_at, ti, vec3, vec4
from .constraints_warp import CROWDED, DRAWN, NEAREST, PARTED, SCARCE, SLACK_SOLID
from .numbers import PLACE, push_row
from .surroundings_taichi import NumbersT, flat, gradient, own_density, sloping, summed

place_of = reader(PLACE)


@ti.func
def multiplier_pair(num, own, begun, other, r):
    g = num.slope_weight * sloping(num, other, r)
    sums = ti.Vector.zero(ti.f32, 5)
    sums[0], sums[4] = other[3] * summed(r.norm(), num.support), g.norm_sqr()
    return vector_into(sums, 1, g)


constrained_by = over_pairs(PLACE, 5, multiplier_pair)


def multipliers_of(drawn: bool) -> Callable:
    length = push_row(drawn)
    write = writer(length)

    @ti.kernel
    def multipliers(
        num: NumbersT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        inside: Ints,
        capacity: int,
        count: Ints,
        places: Quads,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        held: Ints,
        mass: Floats,
        motion: Vectors,
        pushes: Quads,
        fill: Floats,
        bias: Floats,
        enclosure: Floats,
        fabric_normal: Vectors,
        fabric_shear: Vectors,
        lack: Floats,
        correction: Vectors,
    ):
        for i in range(held.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                own = place_of(places, i)
                sums = constrained_by(num, box, lists, entries, number, places, held, i, own, vec4(0.0))
                dense = num.weight * (sums[0] + own_density(num, own[3]))
                phase = phase_at(phases, world, phase_of[i])
                flows = not is_solid(phase)
                if ti.static(drawn):
                    if flows:
                        dense /= 1.0 + bias[i]
                fill[i] = dense
                slope = vector_at(sums, 1).norm() * num.spacing
                metric = num.response * (sums[4] * num.spacing * num.spacing + slope * slope) + num.relaxation
                excess = dense - 1.0 - (SLACK_SOLID if is_solid(phase) else num.slack)
                multiplier = -ti.math.clamp(excess, 0.0, CROWDED) / metric
                row = vector_into(ti.Vector.zero(ti.f32, length), 4, motion[i])
                for c in ti.static(range(4)):
                    row[c] = own[c]
                row[7] = mass[i] / (own[3] * phase.density)
                if ti.static(drawn):
                    normal, shear = vec3(1.0), vec3(0.0)
                    if flows:
                        within = ti.math.clamp(2.0 * (dense - num.face) / (1.0 - num.face), 0.0, 1.0)
                        wave = dt[world] / num.spacing
                        compliance = num.iterations * mass[i] / (own[3] * phase.bulk_modulus * wave * wave)
                        row[15] = enclosure[i] * within
                        row[14] = row[15] * (1.0 - num.slack - dense)
                        answered = ti.math.clamp(lack[i], 0.0, phase.tension_limit / phase.bulk_modulus)
                        multiplier += DRAWN * row[15] * answered / (metric + compliance)
                        normal, shear = fabric_normal[i], fabric_shear[i]
                    row = vector_into(vector_into(row, 8, multiplier * normal), 11, multiplier * shear)
                else:
                    row[8] = multiplier
                write(pushes, i, row)

    return multipliers


def pushing_seen_of(drawn: bool) -> Callable:
    @ti.func
    def seen(box, extra: ti.template(), row, j, code):
        out = vector_into(row, 4, image_gradient(box, vector_at(row, 4), code))
        if ti.static(drawn):
            sign = image_gradient(box, vec3(1.0), code)
            mixed = vec3(sign[0] * sign[1], sign[0] * sign[2], sign[1] * sign[2])
            out = vector_into(out, 11, mixed * vector_at(row, 11))
        return out

    return seen


def correct_pair_of(drawn: bool, sums_of: int) -> Callable:
    @ti.func
    def pair(num, own, begun, other, r):
        weight = 2.0 * other[7] / (own[7] + other[7]) * num.slope_weight * other[3]
        lap, mass = ti.max(NEAREST * num.spacing - r.norm(), 0.0), other[3] * other[7]
        parted = PARTED * lap * mass / ((own[3] * own[7] + mass) * num.spacing * num.spacing)
        before = r - (vector_at(own, 4) - vector_at(other, 4))
        line = before / ti.max(before.norm(), 1.0e-9)
        sums = ti.Vector.zero(ti.f32, sums_of)
        if ti.static(drawn):
            pressed = (symmetric_at(own, 8) + symmetric_at(other, 8)) @ line
            level = other[3] * flat(r.norm(), num.support)
            sums = vector_into(sums, 0, weight * gradient(before.norm(), num.support) * pressed + parted * line)
            sums[3], sums[4] = level * other[15], level * other[14]
        else:
            push = weight * gradient(r.norm(), num.support)
            sums = vector_into(sums, 0, (push * (own[8] + other[8]) + parted) * line)
        return sums

    return pair


def correct_of(drawn: bool) -> Callable:
    row, sums_of = push_row(drawn), 5 if drawn else 3
    row_of = reader(row)
    corrected_by = over_pairs(row, sums_of, correct_pair_of(drawn, sums_of), pushing_seen_of(drawn))

    @ti.kernel
    def correct(
        num: NumbersT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        inside: Ints,
        capacity: int,
        count: Ints,
        pushes: Quads,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        held: Ints,
        mass: Floats,
        motion: Vectors,
        pushed: Quads,
        fill: Floats,
        bias: Floats,
        enclosure: Floats,
        fabric_normal: Vectors,
        fabric_shear: Vectors,
        lack: Floats,
        correction: Vectors,
    ):
        for i in range(held.shape[0]):
            if i % capacity < count[i // capacity]:
                own = row_of(pushes, i)
                sums = corrected_by(num, box, lists, entries, number, pushes, held, i, own, vec4(0.0))
                if ti.static(drawn):
                    own_level = own[3] * flat(0.0, num.support)
                    lack[i] = (sums[4] + own_level * own[14]) / ti.max(sums[3] + own_level * own[15], SCARCE)
                if held[i] == FREE:
                    correction[i] = num.over_relaxation * num.spacing * num.spacing * vector_at(sums, 0)

    return correct


def constraints(drawn: bool) -> dict[str, Callable]:
    """The passes of an iteration, where matter is drawn together or is not."""
    return {"multipliers": multipliers_of(drawn), "correct": correct_of(drawn)}
