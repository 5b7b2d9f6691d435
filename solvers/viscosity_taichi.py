"""Viscosity implicit in time, in Taichi: the kernels of viscosity_warp.py with the same arguments, written anew from
the same equations (viscosity.py)."""

from types import SimpleNamespace

from fluidbench.method.frame import FREE
from fluidbench.native.scene import STICK

from .neighbours_taichi import BoxT, ListsT, face_kind, image_velocity
from .pairs_taichi import over_pairs, reader, vector_at, vector_into
from .smoothing import drag_weight
from .taichi_bridge import (
    Floats,
    Ints,
    Phases,
    Quads,
    Vectors,
    phase_at,
    rest_density,
    struct_of,
    taichi_func,
    ti,
    vec2,
    vec3,
    vec4,
)
from .viscosity_warp import CHUNK, DIRECTION, Viscous

ViscousT = struct_of(Viscous)
Twos = ti.types.ndarray(dtype=vec2, ndim=1)
Table = ti.types.ndarray(dtype=ti.f32, ndim=2)  # a row a world
Counts = ti.types.ndarray(dtype=ti.i32, ndim=2)
LEFT, RIGHT, STEP, TURN, ITERATIONS = range(5)  # columns of the totals, as in viscosity_warp.Totals
weight = taichi_func(drag_weight)
direction_at = reader(DIRECTION)


@ti.func
def seen(box, extra: ti.template(), row, j, code):
    out = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
    for axis in ti.static(range(3)):
        if face_kind(box, code, axis) == STICK:
            out[9 + axis] = -out[9 + axis]
    return out


@ti.func
def pair(num, own, begun, other, r):
    u, s, r2 = vector_at(own, 4) - vector_at(other, 4), vector_at(other, 9) * r, r.norm_sqr()
    viscosity = 2.0 * own[7] * other[7] / ti.max(own[7] + other[7], 1.0e-30)
    drag = 5.0 * viscosity / (own[8] * other[8] * ti.max(r2, 1.0e-6 * num.support * num.support))
    return -other[3] * weight(ti.sqrt(r2) / num.support, num.support) * drag * (r.dot(u) * r + s.dot(u) * s)


summed_over = over_pairs(DIRECTION, 3, pair, seen)


@ti.kernel
def image(
    num: ViscousT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    held: Ints,
    found: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            out = vec3(0.0)
            if held[i] == FREE:
                own = direction_at(rows, i)
                sums = summed_over(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                out = vector_at(own, 4) - dt[world] * sums
            found[i] = out


@ti.kernel
def open_solve(
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    position: Vectors,
    velocity: Vectors,
    acceleration: Vectors,
    mass: Floats,
    volume: Floats,
    drag: Vectors,
    aim: Vectors,
    trial: Vectors,
    rows: Quads,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            x, given, guess = position[i], velocity[i], velocity[i]
            if held[i] == FREE:
                given += dt[world] * acceleration[i]
                guess = given + dt[world] * drag[i]
            aim[i], trial[i] = given, guess
            viscosity = phase_at(phases, world, phase_of[i]).viscosity
            rows[3 * i] = vec4(x[0], x[1], x[2], mass[i])
            rows[3 * i + 1] = vec4(guess[0], guess[1], guess[2], viscosity)
            rows[3 * i + 2] = vec4(rest_density(mass, volume, i), 1.0, 1.0, 1.0)


@ti.kernel
def residual_of(
    capacity: int,
    count: Ints,
    held: Ints,
    mass: Floats,
    aim: Vectors,
    found: Vectors,
    residual: Vectors,
    rows: Quads,
    partial: Twos,
):
    for chunk in range(partial.shape[0]):
        world, sums = chunk * CHUNK // capacity, vec2(0.0)
        for lane in range(CHUNK):
            i = chunk * CHUNK + lane
            if i - world * capacity < count[world]:
                r = vec3(0.0)
                if held[i] == FREE:
                    r = aim[i] - found[i]
                residual[i] = r
                rows[3 * i + 1] = vec4(r[0], r[1], r[2], rows[3 * i + 1][3])
                sums += mass[i] * vec2(r.norm_sqr(), aim[i].norm_sqr())
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


@ti.kernel
def close_solve(
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    aim: Vectors,
    trial: Vectors,
    impulse: int,
    drag: Vectors,
    target: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            change = trial[i] - aim[i]
            drag[i] = change / dt[world]
            if impulse == 0:
                change /= dt[world]
            target[i] += change


@ti.func
def summed(partial: ti.template(), world, chunks):
    """The sum over a world's chunks, in double precision."""
    left, right = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
    ti.loop_config(serialize=True)
    for k in range(world * chunks, (world + 1) * chunks):
        left += partial[k][0]
        right += partial[k][1]
    return vec2(left, right)


@ti.kernel
def weigh_start(num: ViscousT, chunks: int, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, world, chunks)
        for k in ti.static(range(5)):
            totals[world, k] = 0.0
        totals[world, LEFT], totals[world, RIGHT] = sums[0], sums[1]
        if sums[0] > num.tolerance * num.tolerance * sums[1]:
            ti.atomic_or(going[0], 1)


@ti.kernel
def weigh_step(num: ViscousT, chunks: int, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, world, chunks)
        totals[world, STEP] = 0.0
        wanted = totals[world, LEFT] > num.tolerance * num.tolerance * totals[world, RIGHT]
        if wanted:
            totals[world, ITERATIONS] += 1.0
            if sums[0] > 0.0:
                totals[world, STEP] = totals[world, LEFT] / sums[0]
        if world == 0:
            going[0] = 0


@ti.kernel
def weigh_turn(num: ViscousT, chunks: int, team: int, partial: Twos, totals: Table, going: Ints):
    for world in range(totals.shape[0]):
        sums = summed(partial, world, chunks)
        totals[world, TURN] = 0.0
        if totals[world, STEP] > 0.0:
            totals[world, TURN] = sums[0] / totals[world, LEFT]
            totals[world, LEFT] = sums[0]
            more = totals[world, ITERATIONS] < ti.cast(num.most, ti.f32)
            if more and sums[0] > num.tolerance * num.tolerance * totals[world, RIGHT]:
                ti.atomic_or(going[0], 1)


@ti.kernel
def note(num: ViscousT, totals: Table, going: Ints, counted: Counts, worst: Floats):
    for world in range(totals.shape[0]):
        over = ti.sqrt(totals[world, LEFT] / ti.max(totals[world, RIGHT], 1.0e-30))
        counted[world, 0] += 1
        counted[world, 1] += ti.cast(totals[world, ITERATIONS], ti.i32)
        if over > num.tolerance:
            counted[world, 2] += 1
        worst[world] = ti.max(worst[world], over)
        if world == 0:
            going[0] = 0


PASSES = SimpleNamespace(
    image=image,
    open_solve=open_solve,
    residual_of=residual_of,
    along=along,
    descend=descend,
    turn=turn,
    close_solve=close_solve,
    weigh_start=weigh_start,
    weigh_step=weigh_step,
    weigh_turn=weigh_turn,
    note=note,
)
