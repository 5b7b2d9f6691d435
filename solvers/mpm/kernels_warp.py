"""MLS-MPM (Hu et al. 2018, ACM TOG 37:150) with APIC transfers (Jiang et al. 2015, ACM TOG 34:51), in Warp.

One substep: clear_grid, p2g (strain, stress, scatter), grid (momentum balance and walls), g2p (gather, move).
Quadratic B-splines; D = diag(dx^2) / 4, so the inverse inertia tensor is 4 diag(1 / dx^2).
"""

from types import SimpleNamespace

import warp as wp

from fluidbench.native.crew import BLOCK, index_of, raise_fault
from fluidbench.native.scene import Force, Phase, force_at
from fluidbench.native.vector_access import in_company, load_vec4

from .grid import (
    Grid,
    activate_stencil,
    clear_grid,
    find_blocks,
    first_node,
    node_of,
    node_parts,
    reset_blocks,
    slots_of,
    turns,
)
from .particle import FAULT_STENCIL, affine_of, moved, shifted, stressed, taken, weights
from .piston import Piston, driven
from .together import scatter_together, stencil
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
    phases: wp.array2d(dtype=Phase),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    table: wp.array(dtype=int),
    # outputs
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    raw: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Strain and stress of each particle, then momentum and mass to its 27 nodes (Hu et al. 2018, eqs. 16-18)."""
    p = wp.tid()
    world = p / capacity
    on = p - world * capacity < count[world]
    if not on:
        if not in_company():
            return
        p = world * capacity  # threads of a warp stay together: this one computes, but writes nothing
    phase = phases[world, phase_of[p]]
    m = mass[p]
    a = stressed(
        grid,
        dt[world],
        drags,
        phase,
        p,
        on,
        position[p],
        affine,
        m,
        volume,
        held,
        volume_ratio,
        elastic_normal,
        elastic_shear,
        plastic,
    )
    base = first_node(grid, position[p])
    f, wx, wy, wz = weights(grid, position[p], base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    if on and wp.min(wp.min(wp.min(s0, s1), wp.min(s2, s3)), wp.min(wp.min(s4, s5), wp.min(s6, s7))) < 0:
        raise_fault(fault, FAULT_STENCIL)
        on = False
    if not on and not in_company():
        return
    scatter_together(
        raw,
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
        m * velocity[p] - a * f,
        m,
        a,
    )


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
):
    """Velocity of every node from momentum, gravity, a piston and walls; fourth its density [kg/m^3]."""
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
        t += step


@wp.func
def sums_of(
    nodes: wp.array(dtype=wp.vec4),
    f: wp.vec3,
    wx: wp.vec3,
    wy: wp.vec3,
    wz: wp.vec3,
    bx: wp.vec3i,
    by: wp.vec3i,
    bz: wp.vec3i,
    lx: wp.vec3i,
    ly: wp.vec3i,
    lz: wp.vec3i,
    s0: int,
    s1: int,
    s2: int,
    s3: int,
    s4: int,
    s5: int,
    s6: int,
    s7: int,
):
    """Row 0: the sum of w times what a particle's 27 nodes hold; rows 1 to 3: of w times that times the distance of a
    node from the particle along x, y and z, in cells."""
    u = wp.vec4(0.0, 0.0, 0.0, 0.0)
    cx, cy, cz = wp.vec4(0.0, 0.0, 0.0, 0.0), wp.vec4(0.0, 0.0, 0.0, 0.0), wp.vec4(0.0, 0.0, 0.0, 0.0)
    for o in range(3):
        low = bx[o] == bx[0]
        t0, t1 = wp.where(low, s0, s4), wp.where(low, s1, s5)
        t2, t3 = wp.where(low, s2, s6), wp.where(low, s3, s7)
        plane = wp.vec4(0.0, 0.0, 0.0, 0.0)
        for q in range(3):
            near = by[q] == by[0]
            u0, u1 = wp.where(near, t0, t2), wp.where(near, t1, t3)
            line = wp.vec4(0.0, 0.0, 0.0, 0.0)
            for r in range(3):
                slot = wp.where(bz[r] == bz[0], u0, u1)
                node = wz[r] * load_vec4(nodes, wp.max(slot, 0) * 64 + lx[o] + ly[q] + lz[r])
                line += node
                cz += (wx[o] * wy[q] * (float(r) - f[2])) * node
            plane += wy[q] * line
            cy += (wx[o] * wy[q] * (float(q) - f[1])) * line
        u += wx[o] * plane
        cx += (wx[o] * (float(o) - f[0])) * plane
    return wp.matrix_from_rows(u, cx, cy, cz)


@wp.kernel(launch_bounds=(BLOCK, GATHERING))
def g2p(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    moving: wp.array(dtype=wp.vec4),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    shifting: float,
    pitch: float,
    row: wp.array(dtype=int),
    exit: wp.array(dtype=wp.vec3),
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
    """Velocity and affine velocity field of each particle from its 27 nodes (Jiang et al. 2015), then its motion."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        x = position[p]
        base = first_node(grid, x)
        f, wx, wy, wz = weights(grid, x, base)
        bx, by, bz, lx, ly, lz = node_parts(grid, base)
        s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
        sums = sums_of(moving, f, wx, wy, wz, bx, by, bz, lx, ly, lz, s0, s1, s2, s3, s4, s5, s6, s7)
        c = affine_of(grid, sums)
        affine[p] = c
        v = taken(p, x, sums, c, dt[world], pitch, row, exit, held, velocity, volume_ratio)
        x += shifted(grid, phases[world, phase_of[p]], sums, c, shifting * dt[world], volume_ratio[p], held[p])
        after = moved(grid, x, v, dt[world], p, position, velocity, fault)
        if after[0] != base[0] or after[1] != base[1] or after[2] != base[2]:
            activate_stencil(grid, world, after, table, block_of, active, fault)


def passes() -> SimpleNamespace:
    """All passes."""
    return SimpleNamespace(
        reset_blocks=reset_blocks, find_blocks=find_blocks, clear_grid=clear_grid, p2g=p2g, grid_step=grid_step, g2p=g2p
    )
