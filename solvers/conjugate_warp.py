"""Conjugate gradients in Warp: what they ask of particles, and of the sums over a world. All that decides how long they
go on stays on the device (viscosity.py).

The direction is in rows for the operator to read: the first three of a particle's second four floats, in three fours.
"""

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import BLOCK, index_of, raise_fault
from fluidbench.native.scene import Force, force_at
from fluidbench.native.vector_access import in_company, joined, joined_in_block, load_vec4, store_vec4

wp.set_module_options({"enable_backward": False})  # no fast math: what is no number must end the iterations

CHUNK = wp.constant(32)  # particles whose sums are added up first, a warp: the same on any number of threads
TEAM = BLOCK  # threads of a GPU that add up a world's chunks: all of a block
AHEAD = wp.constant(8)  # sums that each of them asks for at once: one by one it would wait for memory every time


@wp.struct
class Ending:
    """When a solve ends."""

    tolerance: float  # of the residual over v* and what forces give in a step
    most: int  # iterations


@wp.struct
class Totals:
    """Sums over a world, and what follows from them."""

    left: float  # m r.r, r being the residual
    right: float  # m (v*.v* + |dt f|^2)
    step: float  # alpha
    turn: float  # beta
    iterations: float  # of this solve


@wp.func
def chunk_of(thread: int):
    """(chunk, its first particle of this thread, how many are this thread's): on the CPU all, on a GPU one."""
    if in_company():
        return thread / CHUNK, thread, 1
    return thread, thread * CHUNK, CHUNK


@wp.func
def put_together(partial: wp.array(dtype=wp.vec2), chunk: int, first: int, left: float, right: float):
    """The sums of a chunk from those of its threads; the whole warp must ask."""
    both = wp.vec2(joined(left, CHUNK), joined(right, CHUNK))
    if first == chunk * CHUNK:
        partial[chunk] = both


@wp.kernel
def residual_of(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    position: wp.array(dtype=wp.vec3),
    aim: wp.array(dtype=wp.vec3),
    image: wp.array(dtype=wp.vec3),
    # outputs
    residual: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.vec4),
    partial: wp.array(dtype=wp.vec2),
    past: wp.array(dtype=int),
):
    """r = v* - K v, the first direction; sums of m r.r and of m (v*.v* + |dt f|^2); where each world's chunks in use
    end."""
    chunk, first, lanes = chunk_of(index_of(share, wp.tid()))
    world = first / capacity
    if first == world * capacity:
        past[world] = chunk + (count[world] + CHUNK - 1) / CHUNK
    left, right = float(0.0), float(0.0)
    for lane in range(lanes):
        i = first + lane
        if i - world * capacity < count[world]:
            r = wp.vec3(0.0, 0.0, 0.0)
            if held[i] == FREE:
                r = aim[i] - image[i]
            residual[i] = r
            row = load_vec4(rows, 3 * i + 1)
            store_vec4(rows, 3 * i + 1, wp.vec4(r[0], r[1], r[2], row[3]))
            left += mass[i] * wp.dot(r, r)
            given = dt[world] * force_at(force[world], position[i])
            right += mass[i] * (wp.dot(aim[i], aim[i]) + wp.dot(given, given))
    put_together(partial, chunk, first, left, right)


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
    chunk, first, lanes = chunk_of(index_of(share, wp.tid()))
    world = first / capacity
    total = float(0.0)
    for lane in range(lanes):
        i = first + lane
        if i - world * capacity < count[world]:
            p = load_vec4(rows, 3 * i + 1)
            total += mass[i] * wp.dot(wp.vec3(p[0], p[1], p[2]), image[i])
    put_together(partial, chunk, first, total, 0.0)


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
    chunk, first, lanes = chunk_of(index_of(share, wp.tid()))
    world = first / capacity
    step = totals[world].step
    total = float(0.0)
    for lane in range(lanes):
        i = first + lane
        if i - world * capacity < count[world]:
            p = load_vec4(rows, 3 * i + 1)
            trial[i] = trial[i] + step * wp.vec3(p[0], p[1], p[2])
            r = residual[i] - step * image[i]
            residual[i] = r
            total += mass[i] * wp.dot(r, r)
    put_together(partial, chunk, first, total, 0.0)


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


@wp.func
def summed(partial: wp.array(dtype=wp.vec2), first: int, end: int, member: int, team: int):
    """The sum over a world's chunks, in double precision until threads join theirs."""
    left, right = wp.float64(0.0), wp.float64(0.0)
    k = first + member
    while k < end:
        for lane in range(AHEAD):
            at = k + lane * team
            value = partial[wp.min(at, end - 1)]  # behind a condition each would be waited for
            if at < end:
                left += wp.float64(value[0])
                right += wp.float64(value[1])
        k += AHEAD * team
    return wp.vec2(joined_in_block(float(left)), joined_in_block(float(right)))


@wp.func
def unsolved(end: Ending, left: float, right: float):
    """Whether m r.r is too much beside m (v*.v* + |dt f|^2); what is no number is: an iteration hands it on to the
    velocities."""
    return not (left <= end.tolerance * end.tolerance * right)


@wp.kernel
def weigh_start(
    end: Ending,
    begin: wp.array(dtype=int),
    past: wp.array(dtype=int),
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """Both sums, and whether there is anything to solve. `going` was 0."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, begin[world], past[world], thread - world * team, team)
    if thread == world * team:
        total = Totals()
        total.left = found[0]
        total.right = found[1]
        totals[world] = total
        if unsolved(end, found[0], found[1]):
            raise_fault(going, 1)


@wp.kernel
def weigh_step(
    end: Ending,
    begin: wp.array(dtype=int),
    past: wp.array(dtype=int),
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """alpha = m r.r / m p.Kp; none where a world is done."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, begin[world], past[world], thread - world * team, team)
    if thread == world * team:
        total = totals[world]
        total.step = 0.0
        if unsolved(end, total.left, total.right):
            total.iterations = total.iterations + 1.0
            total.step = total.left / found[0]
        totals[world] = total
    if thread == 0:
        going[0] = 0


@wp.kernel
def weigh_turn(
    end: Ending,
    begin: wp.array(dtype=int),
    past: wp.array(dtype=int),
    team: int,
    partial: wp.array(dtype=wp.vec2),
    # outputs
    totals: wp.array(dtype=Totals),
    going: wp.array(dtype=int),
):
    """beta, and whether to go on."""
    thread = wp.tid()
    world = thread / team
    found = summed(partial, begin[world], past[world], thread - world * team, team)
    if thread == world * team:
        total = totals[world]
        total.turn = 0.0
        if total.step != 0.0:
            total.turn = found[0] / total.left
            total.left = found[0]
            number = found[0] >= 0.0
            if number and unsolved(end, found[0], total.right) and total.iterations < float(end.most):
                raise_fault(going, 1)
        totals[world] = total


@wp.kernel
def note(
    end: Ending,
    totals: wp.array(dtype=Totals),
    # outputs
    going: wp.array(dtype=int),
    counted: wp.array2d(dtype=int),
    worst: wp.array(dtype=float),
):
    """Of each world in which anything moves or is pulled: solves, iterations, those that did not converge; the largest
    residual over v* and what forces give in a step."""
    world = wp.tid()
    total = totals[world]
    if total.right != 0.0:
        counted[world, 0] = counted[world, 0] + 1
        counted[world, 1] = counted[world, 1] + int(total.iterations)
        if unsolved(end, total.left, total.right):
            counted[world, 2] = counted[world, 2] + 1
        worst[world] = wp.max(worst[world], wp.sqrt(total.left / total.right))
    if world == 0:
        going[0] = 0


KERNELS = (residual_of, along, descend, turn, weigh_start, weigh_step, weigh_turn, note)
