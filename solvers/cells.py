"""Cells as wide as the reach of neighbours, and who is in them: counted, given a place, gathered, put in order."""

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.vector_access import from_last, last_of_warp, store_vec4, sum_before

wp.set_module_options({"enable_backward": False})
NOBODY = wp.constant(-1)


@wp.struct
class Cells:
    """A grid of cells that repeats itself every `sides` cells, a power of two on each axis: bucket b holds
    members[start[b]] and so on, number[b] of them by rising index, at the places `spot`. No two of the 27 cells around
    a point share a bucket."""

    width: float
    sides: wp.vec3i
    bucket: wp.array(dtype=int)
    start: wp.array(dtype=int)
    number: wp.array(dtype=int)
    arrived: wp.array(dtype=int)
    members: wp.array(dtype=int)
    spot: wp.array(dtype=wp.vec4)
    handed: wp.array(dtype=int)


@wp.func
def cell_of(x: wp.vec3, width: float):
    return wp.vec3i(int(wp.floor(x[0] / width)), int(wp.floor(x[1] / width)), int(wp.floor(x[2] / width)))


@wp.func
def bucket_of(cells: Cells, world: int, cell: wp.vec3i):
    b = world
    for axis in range(3):
        b = b * cells.sides[axis] + (cell[axis] & (cells.sides[axis] - 1))
    return b


@wp.kernel
def empty(cells: Cells):
    """No members yet."""
    bucket = wp.tid()
    cells.number[bucket] = 0
    cells.handed[0] = 0


@wp.kernel
def tally(capacity: int, count: wp.array(dtype=int), position: wp.array(dtype=wp.vec3), cells: Cells):
    """The bucket of each particle, and how many share it."""
    i = wp.tid()
    world = i / capacity
    bucket = int(NOBODY)
    if i - world * capacity < count[world]:
        bucket = bucket_of(cells, world, cell_of(position[i], cells.width))
        wp.atomic_add(cells.number, bucket, 1)
    cells.bucket[i] = bucket


@wp.kernel
def hand_out(cells: Cells):
    """A place for each bucket, in no order: one request for all the buckets of a warp. None has members yet."""
    bucket = wp.tid()
    number = cells.number[bucket]
    before = sum_before(number)
    first = int(0)
    if last_of_warp():
        first = wp.atomic_add(cells.handed, 0, before + number)
    cells.start[bucket] = from_last(first) + before
    cells.number[bucket] = 0


@wp.kernel
def gather(cells: Cells):
    """Each particle into its bucket, in the order in which threads come."""
    i = wp.tid()
    bucket = cells.bucket[i]
    if bucket >= 0:
        cells.arrived[cells.start[bucket] + wp.atomic_add(cells.number, bucket, 1)] = i


@wp.kernel
def rank(share: wp.vec3i, position: wp.array(dtype=wp.vec3), cells: Cells):
    """The members of a bucket by rising index: lists then are the same every time, and neighbouring threads that go
    through one read side by side."""
    i = index_of(share, wp.tid())
    bucket = cells.bucket[i]
    if bucket >= 0:
        start = cells.start[bucket]
        at = start
        for m in range(start, start + cells.number[bucket]):
            if cells.arrived[m] < i:
                at += 1
        x = position[i]
        cells.members[at] = i
        store_vec4(cells.spot, at, wp.vec4(x[0], x[1], x[2], 0.0))


@wp.func
def place(spot: wp.vec4):
    return wp.vec3(spot[0], spot[1], spot[2])
