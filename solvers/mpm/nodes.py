"""What particles tell the nodes of MPM's grid beside their momentum, and hear from them: one particle at a time, as for
passes that are rare or small. (Momentum goes faster: patches.py, together.py.)"""

import warp as wp

from fluidbench.native.vector_access import add_vec4, load_vec4

from .grid import Grid, activate_stencil, first_node, on_grid, parts_of, slot_of, slots_of
from .particle import ANCHORED, PACKED, weights
from .walls import in_front

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def front(grid: Grid, base: wp.vec3i, o: int):
    """Along each axis the o-th node of a stencil, or the one in front of a wall whose image it is."""
    return on_grid(grid, in_front(grid, base + wp.vec3i(o, o, o)))


@wp.func
def parts_in_front(grid: Grid, base: wp.vec3i):
    """node_parts, of the nodes in front of walls for their images."""
    return parts_of(grid, front(grid, base, 0), front(grid, base, 1), front(grid, base, 2))


@wp.func
def signs_in_front(grid: Grid, base: wp.vec3i, vector: bool):
    """Of a vector's component along x, y and z as seen in walls by the three nodes along that axis: -1 by images."""
    sx, sy, sz = wp.vec3(1.0, 1.0, 1.0), wp.vec3(1.0, 1.0, 1.0), wp.vec3(1.0, 1.0, 1.0)
    if vector:
        for o in range(3):
            node = base + wp.vec3i(o, o, o)
            inside = in_front(grid, node)
            sx[o] = wp.where(inside[0] == node[0], 1.0, -1.0)
            sy[o] = wp.where(inside[1] == node[1], 1.0, -1.0)
            sz[o] = wp.where(inside[2] == node[2], 1.0, -1.0)
    return sx, sy, sz


@wp.func
def tell_nodes(
    grid: Grid,
    world: int,
    x: wp.vec3,
    vector: bool,
    row: wp.vec4,
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
):
    """Add w row to the active ones of the 27 nodes around x, to those in front of walls for their images, in which a
    vector's component across is turned round."""
    base = first_node(grid, x)
    _f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = parts_in_front(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    sx, sy, sz = signs_in_front(grid, base, vector)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                slot = slot_of(bx[o] == bx[0], by[q] == by[0], bz[r] == bz[0], s0, s1, s2, s3, s4, s5, s6, s7)
                if slot >= 0:
                    w = wx[o] * wy[q] * wz[r]
                    told = wp.vec4(w * sx[o] * row[0], w * sy[q] * row[1], w * sz[r] * row[2], w * row[3])
                    add_vec4(nodes, slot * 64 + lx[o] + ly[q] + lz[r], told)


@wp.func
def mean_of_nodes(
    grid: Grid, world: int, x: wp.vec3, vector: bool, table: wp.array(dtype=int), nodes: wp.array(dtype=wp.vec4)
):
    """The mean at x of what nodes were told in three components; the fourth is its weight."""
    base = first_node(grid, x)
    _f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = parts_in_front(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    sx, sy, sz = signs_in_front(grid, base, vector)
    mean = wp.vec3(0.0, 0.0, 0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                slot = slot_of(bx[o] == bx[0], by[q] == by[0], bz[r] == bz[0], s0, s1, s2, s3, s4, s5, s6, s7)
                heard = load_vec4(nodes, wp.max(slot, 0) * 64 + lx[o] + ly[q] + lz[r])
                if slot >= 0 and heard[3] > 0.0:
                    share = wx[o] * wy[q] * wz[r] / heard[3]
                    mean += share * wp.vec3(sx[o] * heard[0], sy[q] * heard[1], sz[r] * heard[2])
    return mean


@wp.func
def room_of(
    grid: Grid, world: int, x: wp.vec3, density: float, table: wp.array(dtype=int), moving: wp.array(dtype=wp.vec4)
):
    """(the volume ratio of matter of a rest density [kg/m^3] at x that shares the space of its nodes, whose densities
    come fourth: sum w rho0 / rho; the least of rho / rho0; its slope, |dx grad|). All particles together then take the
    space of all nodes, however they lie (the mean of rho itself is too high where they are in disorder). What a clamp
    holds is full."""
    base = first_node(grid, x)
    f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = parts_in_front(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    room = float(0.0)
    least = PACKED
    slope = wp.vec3(0.0, 0.0, 0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                slot = slot_of(bx[o] == bx[0], by[q] == by[0], bz[r] == bz[0], s0, s1, s2, s3, s4, s5, s6, s7)
                full = load_vec4(moving, wp.max(slot, 0) * 64 + lx[o] + ly[q] + lz[r])[3] / density
                if slot < 0:
                    full = 0.0
                if full > ANCHORED:
                    full = 1.0
                least = wp.min(least, full)
                w = wx[o] * wy[q] * wz[r]
                room += w / wp.max(full, 1.0 / PACKED)
                slope += (4.0 * w * full) * (wp.vec3(float(o), float(q), float(r)) - f)
    return room, least, wp.length(slope)


@wp.func
def follow(
    grid: Grid,
    world: int,
    before: wp.vec3,
    after: wp.vec3,
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    outdated: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Activate the nodes around a particle that was moved between two substeps; homes are outdated then."""
    old, new = first_node(grid, before), first_node(grid, after)
    if new[0] != old[0] or new[1] != old[1] or new[2] != old[2]:
        activate_stencil(grid, world, new, table, block_of, active, fault)
        outdated[0] = 1
