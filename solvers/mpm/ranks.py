"""Sums over the nodes of a world: which blocks are its, and in which order what their parts sum up is added."""

import warp as wp

from fluidbench.native.crew import drawn

from .grid import Grid

wp.set_module_options({"enable_backward": False})

PART = wp.constant(8)  # nodes whose sums one thread adds up
PARTS = wp.constant(8)  # of a block


@wp.struct
class Ranks:
    """Where the sums of the parts of a block are: those of a world side by side."""

    number: wp.array(dtype=int)  # of a slot's block among those of its world
    many: wp.array(dtype=int)  # blocks of a world; 0 between solves
    begin: wp.array(dtype=int)  # of a world's sums; the last: of no world any more


@wp.func
def world_of(grid: Grid, block_of: wp.array(dtype=int), slot: int):
    return block_of[slot] / grid.blocks_per_world


@wp.func
def sum_of(ranks: Ranks, world: int, part: int):
    """Where the sum of a part of a block is."""
    return ranks.begin[world] + ranks.number[part / PARTS] * PARTS + part % PARTS


@wp.kernel
def line_up(worlds: int, grid: Grid, table: wp.array(dtype=int), ranks: Ranks):
    """Number the blocks by where they lie, whichever slots threads drew for them; one thread does it all."""
    before = int(0)
    for world in range(worlds):
        ranks.begin[world] = before * PARTS
        many = int(0)
        for b in range(world * grid.blocks_per_world, (world + 1) * grid.blocks_per_world):
            if table[b] > 0:
                ranks.number[table[b] - 1] = many
                many += 1
        before += many
    ranks.begin[worlds] = before * PARTS


@wp.kernel
def count_off(lanes: int, grid: Grid, active: wp.array(dtype=int), block_of: wp.array(dtype=int), ranks: Ranks):
    """Number the blocks of each world as they come, on a GPU."""
    slot = wp.tid()
    while slot < wp.min(active[0], block_of.shape[0]):
        ranks.number[slot] = drawn(ranks.many, world_of(grid, block_of, slot))
        slot += lanes


@wp.kernel
def divide(worlds: int, ranks: Ranks):
    """Where each world's sums begin."""
    before = int(0)
    for world in range(worlds):
        ranks.begin[world] = before * PARTS
        before += ranks.many[world]
        ranks.many[world] = 0
    ranks.begin[worlds] = before * PARTS
