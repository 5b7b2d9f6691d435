"""Cells as wide as the reach of neighbours, and who is in them: counted, given a place, gathered, put in order."""

import math
from collections.abc import Sequence

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.native.vector_access import from_last, last_of_warp, store_vec4, sum_before

from .backends import Backend

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


def sides_for(across: Sequence[float], particles: int) -> list[int]:
    """Cells of a grid on each axis: as many as there are in the domain, or so many that there is one a particle; powers
    of two, and at least 4, so that no two of the 27 around a particle share a bucket."""
    sides = [max(4, 1 << math.ceil(math.log2(max(cells + 2.0, 1.0)))) for cells in across]
    while math.prod(sides) > max(2 * particles, 64) and max(sides) > 4:
        sides[sides.index(max(sides))] //= 2
    return sides


class WhoIsWhere:
    """What cells of an edge `width` [m] over a pool allocate, and their launches, which are Warp's."""

    def __init__(self, scene: Scene, pool: Pool, width: float) -> None:
        self.scene, self.pool = scene, pool
        size, cells = pool.size, Cells()
        cells.width = width
        box = scene.box
        across = [(box.upper[axis] - box.lower[axis]) / width for axis in range(3)]
        sides = sides_for(across, pool.capacity)
        cells.sides = wp.vec3i(*sides)
        with wp.ScopedDevice(scene.device):
            cells.spot = wp.zeros(size, dtype=wp.vec4)
            cells.start, cells.number = (wp.zeros(pool.worlds * math.prod(sides), dtype=int) for _ in range(2))
            cells.bucket, cells.arrived, cells.members = (wp.zeros(size, dtype=int) for _ in range(3))
            cells.handed = wp.zeros(1, dtype=int)
        self.cells = cells

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def tell(self, backend: Backend) -> None:
        """Enqueue: find out who is in which cell."""
        pool, cells = self.pool, self.cells
        buckets = cells.number.shape[0]
        backend.launch(empty, buckets, [cells])
        backend.launch(tally, pool.size, [pool.capacity, pool.count, pool.position, cells])
        backend.launch(hand_out, buckets, [cells])
        backend.launch(gather, pool.size, [cells])
        backend.launch(rank, pool.size, [pool.position, cells])

    def footprint(self) -> int:
        """Bytes."""
        names = ("bucket", "spot", "start", "number", "arrived", "members")
        return sum(getattr(self.cells, name).capacity for name in names)
