"""Viscosity implicit in time, in Warp: the operator on pairs, and what conjugate gradients ask of particles and sums
(viscosity.py has the equations)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.scene import STICK, Box, Phase
from fluidbench.native.vector_access import joined, load_vec4, store_vec4

from .aging import rest_density
from .bind import warp_func
from .images import face_kind, image_velocity
from .pairs import Pass, floats
from .smoothing import drag_weight

wp.set_module_options({"enable_backward": False})  # no fast math: what is no number must end the iterations

weight = warp_func(drag_weight)

# Rows that neighbours are asked for: position, mass | direction, viscosity | rest density, signs of s over r.
DIRECTION = 12
CHUNK = wp.constant(8)  # particles whose sums one thread adds up: results are the same on any number of threads
TEAM = 32  # threads of a GPU that add up a world's chunks


@wp.struct
class Viscous:
    """Numbers of the discretisation."""

    support: float  # radius within which particles drag each other [m]
    tolerance: float  # of the residual over v* [-]
    most: int  # iterations of one solve


@wp.struct
class Applying:
    """What `image` reads and writes of a particle itself."""

    dt: wp.array(dtype=float)
    held: wp.array(dtype=int)
    image: wp.array(dtype=wp.vec3)


@wp.struct
class Totals:
    """Sums over a world, and what follows from them."""

    left: float  # m r.r, r being the residual
    right: float  # m v*.v*
    step: float  # alpha
    turn: float  # beta
    iterations: float  # of this solve


@wp.func
def seen(box: Box, data: Applying, row: floats(DIRECTION), j: int, code: int):
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
        if face_kind(box, code, axis) == STICK:
            row[9 + axis] = -row[9 + axis]
    return row


@wp.func
def pair(num: Viscous, own: floats(DIRECTION + 4), other: floats(DIRECTION), r: wp.vec3):
    u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
    s = wp.vec3(other[9] * r[0], other[10] * r[1], other[11] * r[2])
    r2 = wp.dot(r, r)
    viscosity = 2.0 * own[7] * other[7] / wp.max(own[7] + other[7], 1.0e-30)
    drag = 5.0 * viscosity / (own[8] * other[8] * wp.max(r2, 1.0e-6 * num.support * num.support))
    near = other[3] * weight(wp.sqrt(r2) / num.support, num.support)
    return -(near * drag) * (wp.dot(r, u) * r + wp.dot(s, u) * s)


@wp.func
def finish(num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: wp.vec3):
    image = wp.vec3(0.0, 0.0, 0.0)
    if data.held[i] == FREE:
        image = wp.vec3(own[4], own[5], own[6]) - data.dt[world] * sums
    data.image[i] = image


@wp.kernel
def open_solve(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    acceleration: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    drag: wp.array(dtype=wp.vec3),
    # outputs
    aim: wp.array(dtype=wp.vec3),
    trial: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.vec4),
):
    """v*, and the first guess as the first direction."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        x = position[i]
        given = velocity[i]
        guess = velocity[i]
        if held[i] == FREE:
            given += dt[world] * acceleration[i]
            guess = given + dt[world] * drag[i]
        aim[i] = given
        trial[i] = guess
        viscosity = phases[world, phase_of[i]].viscosity
        store_vec4(rows, 3 * i, wp.vec4(x[0], x[1], x[2], mass[i]))
        store_vec4(rows, 3 * i + 1, wp.vec4(guess[0], guess[1], guess[2], viscosity))
        store_vec4(rows, 3 * i + 2, wp.vec4(rest_density(mass, volume, i), 1.0, 1.0, 1.0))


@wp.kernel
def residual_of(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    aim: wp.array(dtype=wp.vec3),
    image: wp.array(dtype=wp.vec3),
    # outputs
    residual: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.vec4),
    partial: wp.array(dtype=wp.vec2),
):
    """r = v* - K v, the first direction; sums of m r.r and of m v*.v*."""
    chunk = index_of(share, wp.tid())
    first = chunk * CHUNK
    world = first / capacity
    left, right = float(0.0), float(0.0)
    for lane in range(CHUNK):
        i = first + lane
        if i - world * capacity < count[world]:
            r = wp.vec3(0.0, 0.0, 0.0)
            if held[i] == FREE:
                r = aim[i] - image[i]
            residual[i] = r
            row = load_vec4(rows, 3 * i + 1)
            store_vec4(rows, 3 * i + 1, wp.vec4(r[0], r[1], r[2], row[3]))
            left += mass[i] * wp.dot(r, r)
            right += mass[i] * wp.dot(aim[i], aim[i])
    partial[chunk] = wp.vec2(left, right)


@wp.kernel
def along(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    rows: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec3),
    # outputs
    partial: wp.array(dtype=wp.vec2),
):
    """Sums of m p.Kp."""
    chunk = index_of(share, wp.tid())
    first = chunk * CHUNK
    world = first / capacity
    total = float(0.0)
    for lane in range(CHUNK):
        i = first + lane
        if i - world * capacity < count[world]:
            p = load_vec4(rows, 3 * i + 1)
            total += mass[i] * wp.dot(wp.vec3(p[0], p[1], p[2]), image[i])
    partial[chunk] = wp.vec2(total, 0.0)


@wp.kernel
def descend(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    rows: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec3),
    totals: wp.array(dtype=Totals),
    # outputs
    trial: wp.array(dtype=wp.vec3),
    residual: wp.array(dtype=wp.vec3),
    partial: wp.array(dtype=wp.vec2),
):
    """v += alpha p, r -= alpha K p; sums of m r.r."""
    chunk = index_of(share, wp.tid())
    first = chunk * CHUNK
    world = first / capacity
    step = totals[world].step
    total = float(0.0)
    for lane in range(CHUNK):
        i = first + lane
        if i - world * capacity < count[world]:
            p = load_vec4(rows, 3 * i + 1)
            trial[i] = trial[i] + step * wp.vec3(p[0], p[1], p[2])
            r = residual[i] - step * image[i]
            residual[i] = r
            total += mass[i] * wp.dot(r, r)
    partial[chunk] = wp.vec2(total, 0.0)


@wp.kernel
def turn(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    totals: wp.array(dtype=Totals),
    residual: wp.array(dtype=wp.vec3),
    # outputs
    rows: wp.array(dtype=wp.vec4),
):
    """p = r + beta p."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        p = load_vec4(rows, 3 * i + 1)
        r = residual[i]
        beta = totals[world].turn
        store_vec4(rows, 3 * i + 1, wp.vec4(r[0] + beta * p[0], r[1] + beta * p[1], r[2] + beta * p[2], p[3]))


@wp.kernel
def close_solve(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    aim: wp.array(dtype=wp.vec3),
    trial: wp.array(dtype=wp.vec3),
    impulse: int,
    # outputs
    drag: wp.array(dtype=wp.vec3),
    target: wp.array(dtype=wp.vec3),
):
    """The viscous acceleration, and what it makes of accelerations or, as an impulse, of velocities."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        change = trial[i] - aim[i]
        drag[i] = change / dt[world]
        if impulse == 0:
            change = change / dt[world]
        target[i] = target[i] + change


@wp.func
def summed(partial: wp.array(dtype=wp.vec2), first: int, chunks: int, member: int, team: int):
    """The sum over a world's chunks, in double precision until threads join theirs."""
    left, right = wp.float64(0.0), wp.float64(0.0)
    for k in range(member, chunks, team):
        value = partial[first + k]
        left += wp.float64(value[0])
        right += wp.float64(value[1])
    return wp.vec2(joined(float(left), team), joined(float(right), team))


@wp.kernel
def weigh_start(
    num: Viscous,
    chunks: int,
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """m r.r and m v*.v*, and whether there is anything to solve. `going` was 0."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, world * chunks, chunks, thread - world * team, team)
    if thread == world * team:
        total = Totals()
        total.left = found[0]
        total.right = found[1]
        totals[world] = total
        if found[0] > num.tolerance * num.tolerance * found[1]:
            raise_fault(going, 1)


@wp.kernel
def weigh_step(
    num: Viscous,
    chunks: int,
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """alpha = m r.r / m p.Kp; none where a world is done."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, world * chunks, chunks, thread - world * team, team)
    if thread == world * team:
        total = totals[world]
        wanted = total.left > num.tolerance * num.tolerance * total.right
        total.step = 0.0
        if wanted:
            total.iterations = total.iterations + 1.0
            if found[0] > 0.0:
                total.step = total.left / found[0]
        totals[world] = total
    if thread == 0:
        going[0] = 0


@wp.kernel
def weigh_turn(
    num: Viscous,
    chunks: int,
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """beta, and whether to go on."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, world * chunks, chunks, thread - world * team, team)
    if thread == world * team:
        total = totals[world]
        total.turn = 0.0
        if total.step > 0.0:
            total.turn = found[0] / total.left
            total.left = found[0]
            if found[0] > num.tolerance * num.tolerance * total.right and total.iterations < float(num.most):
                raise_fault(going, 1)
        totals[world] = total


@wp.kernel
def note(
    num: Viscous,
    totals: wp.array(dtype=Totals),
    # outputs
    going: wp.array(dtype=int),
    counted: wp.array2d(dtype=int),
    worst: wp.array(dtype=float),
):
    """Of each world: solves, iterations, those that did not converge; the largest residual over v*."""
    world = wp.tid()
    total = totals[world]
    over = wp.sqrt(total.left / wp.max(total.right, 1.0e-30))
    counted[world, 0] = counted[world, 0] + 1
    counted[world, 1] = counted[world, 1] + int(total.iterations)
    if over > num.tolerance:
        counted[world, 2] = counted[world, 2] + 1
    worst[world] = wp.max(worst[world], over)
    if world == 0:
        going[0] = 0


@cache
def passes(cpu: bool) -> SimpleNamespace:
    """The kernels for one kind of device."""
    image = Pass(Viscous, Applying, DIRECTION, 3, pair, finish, seen=seen).compiled("viscous_image", cpu)
    kernels = (open_solve, residual_of, along, descend, turn, close_solve, weigh_start, weigh_step, weigh_turn, note)
    return SimpleNamespace(image=image, **{kernel.key: kernel for kernel in kernels})
