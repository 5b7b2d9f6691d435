"""Viscosity implicit in time on MPM's grid, in Warp: what a solve asks of nodes and particles (implicit.py has the
equations, ../conjugate_warp.py the iterations).

Momenta of nodes keep their mass in the fourth component: walls fold them as they fold what particles scatter.
"""

from types import SimpleNamespace

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Force, Phase, force_at
from fluidbench.native.vector_access import in_company

from ..conjugate_warp import Totals, note, weigh_start, weigh_step, weigh_turn
from .grid import Grid, first_node, node_of, node_parts, slots_of, turns
from .particle import affine_of, resistance_of, viscous, weights
from .ranks import PART, PARTS, Ranks, count_off, divide, line_up, sum_of, world_of
from .together import scatter_together, stencil
from .transfers import sums_of
from .walls import in_front, seen

wp.set_module_options({"enable_backward": False})  # no fast math: what is no number must end the iterations


@wp.func
def moved_by(momentum: wp.vec4, change: wp.vec4):
    """A momentum changed, its mass kept; a velocity, its density kept."""
    return momentum + wp.vec4(change[0], change[1], change[2], 0.0)


@wp.func
def product(a: wp.vec4, b: wp.vec4):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@wp.func
def pushed(grid: Grid, node: wp.vec3i, dt: float, force: Force):
    """What forces of the scene add to a node's velocity within dt, as it is where all walls act."""
    inside = in_front(grid, node)
    place = grid.origin + wp.cw_mul(grid.dx, wp.vec3(float(inside[0]), float(inside[1]), float(inside[2])))
    v = dt * force_at(force, place)
    return seen(grid, node, inside, wp.vec4(v[0], v[1], v[2], 0.0))


@wp.kernel
def guess(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    # outputs
    residual: wp.array(dtype=wp.vec4),
):
    """The first guess of what viscosity adds to momenta: all that forces and stress add, back to those before (in
    `residual`, and then there)."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        change = wp.vec4(0.0, 0.0, 0.0, raw[t][3])
        if raw[t][3] > 0.0:
            world = world_of(grid, block_of, t / 64)
            node = node_of(grid, block_of[t / 64] - world * grid.blocks_per_world, t % 64)
            kick = raw[t][3] * pushed(grid, node, dt[world], force[world])
            change = moved_by(change, residual[t] - raw[t] - kick)
        residual[t] = change
        t += step


@wp.kernel
def start(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    ranks: Ranks,
    raw: wp.array(dtype=wp.vec4),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    answer: wp.array(dtype=wp.vec4),
    # outputs
    moving: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec4),
    partial: wp.array(dtype=wp.vec2),
):
    """Sums of m (v*.v* + |dt f|^2); then the velocity of the guess in place of v*."""
    part, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0], block_of.shape[0]) * PARTS)
    while part < end:
        slot, total = part / PARTS, float(0.0)
        world = world_of(grid, block_of, slot)
        for k in range(PART):
            t = part * PART + k
            node = node_of(grid, block_of[slot] - world * grid.blocks_per_world, t % 64)
            given = pushed(grid, node, dt[world], force[world])
            total += raw[t][3] * (product(moving[t], moving[t]) + product(given, given))
            moving[t] = moved_by(moving[t], answer[t])
            image[t] = wp.vec4(0.0, 0.0, 0.0, 0.0)
        partial[sum_of(ranks, world, part)] = wp.vec2(0.0, total)
        part += step


@wp.kernel
def residual_of(
    share: wp.vec3i,
    lanes: int,
    active: wp.array(dtype=int),
    image: wp.array(dtype=wp.vec4),
    # outputs
    residual: wp.array(dtype=wp.vec4),
):
    """r = -(what the guess added) - dt A v."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, residual.shape[0]))
    while t < end:
        r = residual[t]
        residual[t] = wp.vec4(-r[0] - image[t][0], -r[1] - image[t][1], -r[2] - image[t][2], r[3])
        t += step


@wp.kernel
def set_out(
    share: wp.vec3i,
    lanes: int,
    active: wp.array(dtype=int),
    residual: wp.array(dtype=wp.vec4),
    answer: wp.array(dtype=wp.vec4),
    # outputs
    impulse: wp.array(dtype=wp.vec4),
    search: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec4),
):
    """The first direction p = r, its velocity B p, and where (1 + dt A B) p will be."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, residual.shape[0]))
    while t < end:
        impulse[t] = residual[t]
        search[t] = answer[t]
        image[t] = residual[t]
        t += step


@wp.kernel
def turn(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    totals: wp.array(dtype=Totals),
    residual: wp.array(dtype=wp.vec4),
    answer: wp.array(dtype=wp.vec4),
    # outputs
    impulse: wp.array(dtype=wp.vec4),
    search: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec4),
):
    """p = r + beta p, and the same of its velocity."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, residual.shape[0]))
    while t < end:
        beta = totals[world_of(grid, block_of, t / 64)].turn
        p = moved_by(residual[t], beta * impulse[t])
        impulse[t] = p
        image[t] = p
        search[t] = answer[t] + beta * search[t]
        t += step


@wp.kernel
def along(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    ranks: Ranks,
    momentum: wp.array(dtype=wp.vec4),
    velocity: wp.array(dtype=wp.vec4),
    # outputs
    partial: wp.array(dtype=wp.vec2),
):
    """Sums of momentum times velocity; beside them what is there stays."""
    part, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0], block_of.shape[0]) * PARTS)
    while part < end:
        total = float(0.0)
        for k in range(PART):
            t = part * PART + k
            total += product(momentum[t], velocity[t])
        at = sum_of(ranks, world_of(grid, block_of, part / PARTS), part)
        partial[at] = wp.vec2(total, partial[at][1])
        part += step


@wp.kernel
def descend(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    totals: wp.array(dtype=Totals),
    search: wp.array(dtype=wp.vec4),
    image: wp.array(dtype=wp.vec4),
    # outputs
    moving: wp.array(dtype=wp.vec4),
    residual: wp.array(dtype=wp.vec4),
):
    """v += alpha B p, r -= alpha (1 + dt A B) p."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, residual.shape[0]))
    while t < end:
        alpha = totals[world_of(grid, block_of, t / 64)].step
        moving[t] = moved_by(moving[t], alpha * search[t])
        residual[t] = moved_by(residual[t], -alpha * image[t])
        t += step


@wp.kernel
def close(
    share: wp.vec3i,
    lanes: int,
    active: wp.array(dtype=int),
    answer: wp.array(dtype=wp.vec4),
    # outputs
    moving: wp.array(dtype=wp.vec4),
):
    """v + B r: the velocity by the forces between nodes at the v that was found."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, moving.shape[0]))
    while t < end:
        moving[t] = moved_by(moving[t], answer[t])
        t += step


@wp.kernel
def resist(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    # outputs
    image: wp.array(dtype=wp.vec4),
):
    """image += dt A v, with v the velocities of the nodes."""
    p = wp.tid()
    world = p / capacity
    on = p - world * capacity < count[world]
    if not on:
        if not in_company():
            return
        p = world * capacity  # threads of a warp stay together, as in p2g
    phase = phases[world, phase_of[p]]
    on = on and phase.viscosity > 0.0
    base = first_node(grid, position[p])
    f, wx, wy, wz = weights(grid, position[p], base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    a = wp.mat33()
    if on:
        sums = sums_of(nodes, f, wx, wy, wz, bx, by, bz, lx, ly, lz, s0, s1, s2, s3, s4, s5, s6, s7)
        a = resistance_of(grid, dt[world], volume[p], viscous(phase, volume_ratio[p], affine_of(grid, sums)))
    if not on and not in_company():
        return
    scatter_together(
        image,
        wp.where(on, s0 * 64 + lx[0] + ly[0] + lz[0], -1),
        stencil(bx, by, bz, lx, ly, lz),
        s0,
        s1,
        s2,
        s3,
        s4,
        s5,
        s6,
        s7,
        wx,
        wy,
        wz,
        -(a * f),
        0.0,
        a,
    )


KERNELS = (
    line_up,
    count_off,
    divide,
    guess,
    start,
    residual_of,
    set_out,
    turn,
    along,
    descend,
    close,
    resist,
    weigh_start,
    weigh_step,
    weigh_turn,
    note,
)


def passes() -> SimpleNamespace:
    """The kernels of a solve."""
    return SimpleNamespace(**{kernel.key: kernel for kernel in KERNELS})
