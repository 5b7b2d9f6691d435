"""What particles tell the nodes of MPM's grid beside their momentum, and hear from them: one particle at a time, as for
passes that are rare or small. (Momentum goes faster: patches.py, together.py.)"""

import warp as wp

from .grid import Grid, activate_stencil, first_node, node_at
from .homes import on_grid
from .particle import ANCHORED, PACKED, weights
from .walls import in_front

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def signs_of(node: wp.vec3i, inside: wp.vec3i):
    """Of a vector's components as seen in walls by a node that is the image of the node inside."""
    signs = wp.vec3(1.0, 1.0, 1.0)
    for axis in range(3):
        if inside[axis] != node[axis]:
            signs[axis] = -1.0
    return signs


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
    for o in range(3):
        for q in range(3):
            for r in range(3):
                node = base + wp.vec3i(o, q, r)
                inside = in_front(grid, node)
                at = node_at(grid, world, on_grid(grid, inside), table)
                if at >= 0:
                    told = row
                    if vector:
                        signs = signs_of(node, inside)
                        told = wp.vec4(signs[0] * row[0], signs[1] * row[1], signs[2] * row[2], row[3])
                    wp.atomic_add(nodes, at, (wx[o] * wy[q] * wz[r]) * told)


@wp.func
def mean_of_nodes(
    grid: Grid, world: int, x: wp.vec3, vector: bool, table: wp.array(dtype=int), nodes: wp.array(dtype=wp.vec4)
):
    """The mean at x of what nodes were told in three components; the fourth is its weight."""
    base = first_node(grid, x)
    _f, wx, wy, wz = weights(grid, x, base)
    mean = wp.vec3(0.0, 0.0, 0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                node = base + wp.vec3i(o, q, r)
                inside = in_front(grid, node)
                at = node_at(grid, world, on_grid(grid, inside), table)
                if at >= 0 and nodes[at][3] > 0.0:
                    share = wx[o] * wy[q] * wz[r] / nodes[at][3]
                    heard = wp.vec3(nodes[at][0], nodes[at][1], nodes[at][2])
                    if vector:
                        heard = wp.cw_mul(signs_of(node, inside), heard)
                    mean += share * heard
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
    room = float(0.0)
    least = PACKED
    slope = wp.vec3(0.0, 0.0, 0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                inside = in_front(grid, base + wp.vec3i(o, q, r))
                at = node_at(grid, world, on_grid(grid, inside), table)
                full = float(0.0)
                if at >= 0:
                    full = moving[at][3] / density
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
