"""What a particle of MPM gives to its 27 nodes, and takes from them: one thread a particle, whatever block they lie in.
(On the CPU whole blocks do: patches.py.)"""

import warp as wp

from fluidbench.native.crew import raise_fault
from fluidbench.native.scene import Phase
from fluidbench.native.vector_access import in_company, load_vec4

from .grid import Grid, activate_stencil, first_node, node_parts, slots_drawn, slots_of
from .particle import FAULT_STENCIL, affine_of, as_begun, moved, shifted, stressed, taken, weights
from .together import scatter_together, stencil

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def give(
    grid: Grid,
    world: int,
    dt: float,
    drags: int,
    anew: float,
    phase: Phase,
    p: int,
    active: bool,
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    bent: wp.array(dtype=wp.mat33),
    table: wp.array(dtype=int),
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    raw: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Strain and stress of particle p, then momentum and mass to its 27 nodes (Hu et al. 2018, eqs. 16-18), all of it
    where these are told `anew` (1), else (0) what the stress of matter that was `bent` since changes them by. On a GPU
    the whole warp must ask; one that is not `active` computes, but writes nothing."""
    m = anew * mass[p]
    x = wp.where(active, position[p], 0.5 * (grid.lower + grid.upper))
    a = stressed(
        grid,
        dt,
        drags,
        phase,
        p,
        active,
        x,
        affine,
        m,
        volume,
        held,
        volume_ratio,
        elastic_normal,
        elastic_shear,
        plastic,
    )
    if anew == 0.0:
        a = as_begun(grid, a, bent[p])
    base = first_node(grid, x)
    f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    on = active
    if on and wp.min(wp.min(wp.min(s0, s1), wp.min(s2, s3)), wp.min(wp.min(s4, s5), wp.min(s6, s7))) < 0:
        s0, s1, s2, s3, s4, s5, s6, s7 = slots_drawn(table, world * grid.blocks_per_world, bx, by, bz)
        if wp.min(wp.min(wp.min(s0, s1), wp.min(s2, s3)), wp.min(wp.min(s4, s5), wp.min(s6, s7))) < 0:
            raise_fault(fault, FAULT_STENCIL)
            on = False
    if on or in_company():
        scatter_together(
            raw,
            wp.where(on, s0 * 64 + lx[0] + ly[0] + lz[0], -1),
            stencil(bx, by, bz, lx, ly, lz),
            s0, s1, s2, s3, s4, s5, s6, s7,
            wx, wy, wz,
            m * velocity[p] - a * f,
            m,
            a,
        )  # fmt: skip


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


@wp.func
def take(
    grid: Grid,
    world: int,
    dt: float,
    moves: float,
    moving: wp.array(dtype=wp.vec4),
    phase: Phase,
    p: int,
    held: wp.array(dtype=int),
    shifting: float,
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Velocity and affine velocity field of particle p from its 27 nodes (Jiang et al. 2015), then its motion, if it
    `moves` (1; else 0)."""
    x = position[p]
    base = first_node(grid, x)
    f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    sums = sums_of(moving, f, wx, wy, wz, bx, by, bz, lx, ly, lz, s0, s1, s2, s3, s4, s5, s6, s7)
    c = affine_of(grid, sums)
    affine[p] = c
    v = taken(p, sums, held, velocity)
    x += shifted(grid, phase, sums, c, shifting * dt, volume_ratio[p], held[p])
    after = moved(grid, x, v, moves * dt, p, position, velocity, fault)
    if after[0] != base[0] or after[1] != base[1] or after[2] != base[2]:
        activate_stencil(grid, world, after, table, block_of, active, fault)
