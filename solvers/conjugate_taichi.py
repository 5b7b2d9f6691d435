"""Conjugate gradients in Taichi: the kernels of conjugate_warp.py with the same arguments, written anew."""

from fluidbench.method.frame import FREE

from .conjugate_warp import CHUNK, Ending
from .taichi_bridge import Floats, Forces, Ints, Quads, Vectors, force_at, struct_of, ti, vec2, vec3, vec4

EndingT = struct_of(Ending)
Twos = ti.types.ndarray(dtype=vec2, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)  # a row a world
Counts = ti.types.ndarray(dtype=ti.i32, ndim=2)
LEFT, RIGHT, STEP, TURN, ITERATIONS = range(5)  # columns of the totals, as in conjugate_warp.Totals


@ti.kernel
def residual_of(
    capacity: int,
    count: Ints,
    held: Ints,
    mass: Floats,
    dt: Floats,
    force: Forces,
    position: Vectors,
    aim: Vectors,
    found: Vectors,
    residual: Vectors,
    rows: Quads,
    partial: Twos,
    past: Ints,
):
    for chunk in range(partial.shape[0]):
        world, sums = chunk * CHUNK // capacity, vec2(0.0)
        if chunk * CHUNK == world * capacity:
            past[world] = chunk + (count[world] + CHUNK - 1) // CHUNK
        for lane in range(CHUNK):
            i = chunk * CHUNK + lane
            if i - world * capacity < count[world]:
                r = vec3(0.0)
                if held[i] == FREE:
                    r = aim[i] - found[i]
                residual[i] = r
                rows[3 * i + 1] = vec4(r[0], r[1], r[2], rows[3 * i + 1][3])
                given = dt[world] * force_at(force, world, position[i])
                sums += mass[i] * vec2(r.norm_sqr(), aim[i].norm_sqr() + given.norm_sqr())
        partial[chunk] = sums


@ti.kernel
def along(capacity: int, count: Ints, mass: Floats, rows: Quads, found: Vectors, partial: Twos):
    for chunk in range(partial.shape[0]):
        world, total = chunk * CHUNK // capacity, 0.0
        for lane in range(CHUNK):
            i = chunk * CHUNK + lane
            if i - world * capacity < count[world]:
                total += mass[i] * rows[3 * i + 1].xyz.dot(found[i])
        partial[chunk] = vec2(total, 0.0)


@ti.kernel
def descend(
    capacity: int,
    count: Ints,
    mass: Floats,
    rows: Quads,
    found: Vectors,
    totals: Table,
    trial: Vectors,
    residual: Vectors,
    partial: Twos,
):
    for chunk in range(partial.shape[0]):
        world, total = chunk * CHUNK // capacity, 0.0
        for lane in range(CHUNK):
            i = chunk * CHUNK + lane
            if i - world * capacity < count[world]:
                trial[i] += totals[world, STEP] * rows[3 * i + 1].xyz
                residual[i] -= totals[world, STEP] * found[i]
                total += mass[i] * residual[i].norm_sqr()
        partial[chunk] = vec2(total, 0.0)


@ti.kernel
def turn(capacity: int, count: Ints, totals: Table, residual: Vectors, rows: Quads):
    for i in range(residual.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            p = residual[i] + totals[world, TURN] * rows[3 * i + 1].xyz
            rows[3 * i + 1] = vec4(p[0], p[1], p[2], rows[3 * i + 1][3])


@ti.func
def summed(partial: ti.template(), first, end):
    """The sum over a world's chunks, in double precision."""
    left, right = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
    ti.loop_config(serialize=True)
    for k in range(first, end):
        left += partial[k][0]
        right += partial[k][1]
    return vec2(left, right)


@ti.func
def no_number(value):
    """By its bits: Taichi compares as if there were none."""
    return (ti.bit_cast(value, ti.i32) & 0x7F800000) == 0x7F800000


@ti.func
def unsolved(end: ti.template(), left, right):
    """See conjugate_warp.py."""
    return left > end.tolerance * end.tolerance * right or no_number(left)


@ti.kernel
def weigh_start(end: EndingT, begin: Ints, past: Ints, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, begin[world], past[world])
        for k in ti.static(range(5)):
            totals[world, k] = 0.0
        totals[world, LEFT], totals[world, RIGHT] = sums[0], sums[1]
        if unsolved(end, sums[0], sums[1]):
            ti.atomic_or(going[0], 1)


@ti.kernel
def weigh_step(end: EndingT, begin: Ints, past: Ints, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, begin[world], past[world])
        totals[world, STEP] = 0.0
        if unsolved(end, totals[world, LEFT], totals[world, RIGHT]):
            totals[world, ITERATIONS] += 1.0
            totals[world, STEP] = totals[world, LEFT] / sums[0]
        if world == 0:
            going[0] = 0


@ti.kernel
def weigh_turn(end: EndingT, begin: Ints, past: Ints, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, begin[world], past[world])
        totals[world, TURN] = 0.0
        if totals[world, STEP] != 0.0 or no_number(totals[world, STEP]):
            totals[world, TURN] = sums[0] / totals[world, LEFT]
            totals[world, LEFT] = sums[0]
            more = not no_number(sums[0]) and totals[world, ITERATIONS] < ti.cast(end.most, ti.f32)
            if more and unsolved(end, sums[0], totals[world, RIGHT]):
                ti.atomic_or(going[0], 1)


@ti.kernel
def note(end: EndingT, totals: Table, going: Ints, counted: Counts, worst: Floats):
    for world in range(totals.shape[0]):
        if totals[world, RIGHT] > 0.0 or no_number(totals[world, RIGHT]):
            counted[world, 0] += 1
            counted[world, 1] += ti.cast(totals[world, ITERATIONS], ti.i32)
            if unsolved(end, totals[world, LEFT], totals[world, RIGHT]):
                counted[world, 2] += 1
            worst[world] = ti.max(worst[world], ti.sqrt(totals[world, LEFT] / totals[world, RIGHT]))
        if world == 0:
            going[0] = 0


KERNELS = {
    "residual_of": residual_of,
    "along": along,
    "descend": descend,
    "turn": turn,
    "weigh_start": weigh_start,
    "weigh_step": weigh_step,
    "weigh_turn": weigh_turn,
    "note": note,
}
