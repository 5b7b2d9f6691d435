"""Homes: which particles of MPM belong to which block of its grid, and how the patches of neighbouring homes overlap.

A particle's home is the block that holds the lowest of its 27 nodes: all 27 lie in the patch of 6 x 6 x 6 nodes that
begins there.
"""

import warp as wp

from fluidbench.native.crew import index_of, raise_fault

from .grid import Grid, first_node, on_grid
from .particle import FAULT_STENCIL

wp.set_module_options({"enable_backward": False})

SIDE = 6  # nodes of a patch along an axis: those of a block, and two more
PATCH = wp.constant(SIDE**3)
NOWHERE = wp.constant(-1)


@wp.struct
class Homes:
    """Home h is block slot[h]; its particles are members[first[h]] and so on, number[h] of them by rising index."""

    total: wp.array(dtype=int)
    slot: wp.array(dtype=int)
    first: wp.array(dtype=int)
    number: wp.array(dtype=int)
    members: wp.array(dtype=int)
    of_slot: wp.array(dtype=int)
    of_particle: wp.array(dtype=int)  # the slot of its home; NOWHERE for none
    outdated: wp.array(dtype=int)
    patch: wp.array(dtype=wp.vec4)


@wp.func
def home_of(grid: Grid, base: wp.vec3i):
    """The block, within its world, of the lowest of a particle's nodes."""
    node = on_grid(grid, base)
    return ((node[0] >> 2) * grid.blocks[1] + (node[1] >> 2)) * grid.blocks[2] + (node[2] >> 2)


@wp.func
def place_in_patch(grid: Grid, base: wp.vec3i):
    """Where the lowest of a particle's nodes lies in the patch of its home."""
    node = on_grid(grid, base)
    return ((node[0] & 3) * SIDE + (node[1] & 3)) * SIDE + (node[2] & 3)


@wp.kernel
def find_homes(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    homes: Homes,
    # outputs
    fault: wp.array(dtype=int),
):
    """The slot of each particle's home."""
    p = index_of(share, wp.tid())
    world = p / capacity
    slot = int(NOWHERE)
    if p - world * capacity < count[world]:
        slot = table[home_of(grid, first_node(grid, position[p])) + world * grid.blocks_per_world] - 1
        if slot < 0:
            raise_fault(fault, FAULT_STENCIL)
    homes.of_particle[p] = slot


@wp.kernel
def enrol(size: int, homes: Homes):
    """Number the homes in the order of their first particles, and list who lives there; one thread does it all."""
    for slot in range(homes.of_slot.shape[0]):
        homes.of_slot[slot] = NOWHERE
    total = int(0)
    for p in range(size):
        slot = homes.of_particle[p]
        if slot >= 0:
            h = homes.of_slot[slot]
            if h < 0:
                h = total
                total += 1
                homes.of_slot[slot] = h
                homes.slot[h] = slot
                homes.number[h] = 0
            homes.number[h] = homes.number[h] + 1
    before = int(0)
    for h in range(total):
        homes.first[h] = before
        before += homes.number[h]
        homes.number[h] = 0
    for p in range(size):
        slot = homes.of_particle[p]
        if slot >= 0:
            h = homes.of_slot[slot]
            homes.members[homes.first[h] + homes.number[h]] = p
            homes.number[h] = homes.number[h] + 1
    homes.total[0] = total
    homes.outdated[0] = 0


@wp.func
def part_of(homes: Homes, lane: int, lanes: int):
    """The homes of a lane, first and end: as many particles for each, and the same for every pass, so that what a core
    has at hand stays with it."""
    total = homes.total[0]
    members = int(0)
    if total > 0:
        members = homes.first[total - 1] + homes.number[total - 1]
    piece = (members + lanes - 1) / lanes
    begin = wp.lower_bound(homes.first, 0, total + 1, lane * piece)  # Warp's ends before its end
    return begin, wp.lower_bound(homes.first, 0, total + 1, (lane + 1) * piece)


@wp.func
def overlap(grid: Grid, block: int, axis: int, after: int):
    """Where the patch of a home reaches beyond its block along an axis: (the block there or NOWHERE, the first of its
    nodes that are reached, the same node's place in the patch). With `after` = 0 the other way round: which block's
    patch reaches into this one."""
    to = NOWHERE
    node, place = int(0), int(4)
    if after == 1:
        to = block + 1
    else:
        to = block - 1
    if to >= grid.blocks[axis]:
        to = NOWHERE
    if grid.wrap[axis] > 0:  # the last node is followed by the first
        first, last = grid.first[axis], grid.first[axis] + grid.wrap[axis] - 1
        if after == 1 and block == last >> 2:
            to = first >> 2
            node, place = first & 3, (last & 3) + 1
        elif after == 0 and block == first >> 2:
            to = last >> 2
            node, place = first & 3, (last & 3) + 1
    return to, node, place


@wp.func
def width_of(grid: Grid, block: int, axis: int):
    """Nodes that a block has along an axis: fewer than four where a periodic axis ends."""
    width = int(4)
    if grid.wrap[axis] > 0:
        width = wp.min(width, grid.first[axis] + grid.wrap[axis] - 4 * block)
    return width


@wp.func
def coordinates(grid: Grid, b: int):
    return wp.vec3i(b / (grid.blocks[1] * grid.blocks[2]), (b / grid.blocks[2]) % grid.blocks[1], b % grid.blocks[2])


@wp.func
def neighbour(grid: Grid, block: wp.vec3i, corner: int, after: int):
    """One of the eight blocks that share nodes with a patch, or whose patches share this block's: (its number within
    the world or NOWHERE, first node in the block that owns it, its place in the patch, nodes along each axis)."""
    number = int(0)
    node, place, size = wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0)
    for axis in range(3):
        to = block[axis]
        size[axis] = width_of(grid, block[axis], axis)
        if (corner >> (2 - axis)) & 1 == 1:
            across, there, here = overlap(grid, block[axis], axis, after)
            to = across
            node[axis] = there
            place[axis] = here
            size[axis] = 2
        number = wp.where(number < 0 or to < 0, NOWHERE, number * grid.blocks[axis] + to)
    return number, node, place, size
