"""MLS-MPM (Hu et al. 2018, ACM TOG 37:150) with APIC transfers (Jiang et al. 2015, ACM TOG 34:51), in Warp.

One substep: clear_grid, p2g (strain, stress, scatter), grid (momentum balance and walls), g2p (gather, move).
Quadratic B-splines; D = diag(dx^2) / 4, so the inverse inertia tensor is 4 diag(1 / dx^2).
"""

from types import SimpleNamespace

import warp as wp

from fluidbench.native.crew import BLOCK, index_of
from fluidbench.native.scene import Force, Phase, force_at
from fluidbench.native.vector_access import in_company

from .grid import Grid, clear_grid, find_blocks, node_of, reset_blocks, turns
from .piston import Piston, driven
from .transfers import give, take
from .walls import facing, folded, in_front, in_reach, near_any, rubbed_by_walls, seen, touched, unbound

wp.set_module_options({"enable_backward": False, "fast_math": True})

GATHERING = 4  # blocks of a gather that shall share a multiprocessor of a GPU: what registers it may use


@wp.kernel
def p2g(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    drags: int,
    anew: float,
    phases: wp.array2d(dtype=Phase),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    bent: wp.array(dtype=wp.mat33),
    table: wp.array(dtype=int),
    # outputs
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    raw: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Every particle gives."""
    p = wp.tid()
    world = p / capacity
    on = p - world * capacity < count[world]
    if not on:
        if not in_company():
            return
        p = world * capacity  # threads of a warp stay together
    phase = phases[world, phase_of[p]]
    give(
        grid, world, dt[world], drags, anew, phase, p, on, position, velocity, affine, mass, volume, held, bent, table,
        volume_ratio, elastic_normal, elastic_shear, plastic, raw, fault,
    )  # fmt: skip


@wp.kernel
def grid_step(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    piston: Piston,
    # outputs
    moving: wp.array(dtype=wp.vec4),
    spent: wp.array(dtype=wp.vec4),
):
    """Velocity of every node from momentum, gravity, a piston and walls; fourth its density [kg/m^3]. On the way the
    nodes of `spent` are emptied."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    slot, world, corner = int(-1), int(0), wp.vec3i(0, 0, 0)
    while t < end:
        if t >> 6 != slot:  # on the CPU a lane's nodes follow each other: divisions once a block
            slot = t >> 6
            world = block_of[slot] / grid.blocks_per_world
            corner = node_of(grid, block_of[slot] - world * grid.blocks_per_world, 0)
        node = corner + wp.vec3i((t & 63) >> 4, (t >> 2) & 3, t & 3)
        wall = near_any(grid, node)
        result = wp.vec4(0.0, 0.0, 0.0, 0.0)
        if (wall or raw[t][3] > 0.0) and in_reach(grid, node):
            inside = in_front(grid, node)
            place = wp.vec3(float(inside[0]), float(inside[1]), float(inside[2]))
            place = grid.origin + wp.cw_mul(grid.dx, place)
            kick = dt[world] * force_at(force[world], place)
            total = raw[t]
            hold = float(1.0)
            into = wp.vec3(0.0, 0.0, 0.0)
            if wall:
                touching, hold, into = touched(grid, world, node, kick, table, raw)
                inside = facing(grid, node, touching)
                total = folded(grid, world, inside, touching, table, raw)
            if total[3] > 0.0:
                v = wp.vec3(total[0], total[1], total[2]) / total[3] + kick
                if piston.on == 1:
                    v = driven(piston, grid, place, v)
                if wall:
                    v = rubbed_by_walls(grid, node, into, v)
                result = seen(grid, node, inside, wp.vec4(v[0], v[1], v[2], total[3] * grid.inv_volume))
                if hold < 1.0:
                    result = hold * result + (1.0 - hold) * unbound(raw[t], kick, result[3])
        moving[t] = result
        if t < spent.shape[0]:
            spent[t] = wp.vec4(0.0, 0.0, 0.0, 0.0)
        t += step


@wp.kernel(launch_bounds=(BLOCK, GATHERING))
def g2p(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    moves: float,
    moving: wp.array(dtype=wp.vec4),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    shifting: float,
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Every particle takes."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        take(
            grid, world, dt[world], moves, moving, phases[world, phase_of[p]], p, held, shifting,
            position, velocity, affine, volume_ratio, table, block_of, active, fault,
        )  # fmt: skip


def passes() -> SimpleNamespace:
    """All passes."""
    return SimpleNamespace(
        reset_blocks=reset_blocks, find_blocks=find_blocks, clear_grid=clear_grid, p2g=p2g, grid_step=grid_step, g2p=g2p
    )
