"""Neighbour search in Taichi: a hashed grid of cells as wide as the reach; lists and images as in neighbours.py.

A bucket holds the particles of all cells that hash to it, side by side; who lies in a wanted cell is told by its full
key. Buckets get their places in no order: a counter hands them out.
"""

import warp as wp

from fluidbench.native.scene import PERIODIC, STICK, Box

from .images import INDEX_BITS, INDEX_MASK
from .neighbours import Neighbours
from .search import FAULT_NEIGHBOURS, Lists
from .taichi_bridge import Ints, Vectors, ivec3, struct_of, ti, vec3

BoxT, ListsT = struct_of(Box), struct_of(Lists)
Keys = ti.types.ndarray(dtype=ti.i64, ndim=1)
NOBODY = -1  # key of unused slots


@ti.func
def digit(code, axis: ti.template()):
    """0, 1 or 2: which image the code means on one axis."""
    return (code // 3**axis) % 3


@ti.func
def face_kind(box, code, axis: ti.template()):
    """Kind of the wall that the code mirrors in on this axis; PERIODIC where it mirrors in none."""
    kind = PERIODIC
    which = digit(code, axis)
    if which == 1:
        kind = box.lower_kind[axis]
    elif which == 2:
        kind = box.upper_kind[axis]
    return kind


@ti.func
def image_position(box, x, code):
    """The image of a point in the faces that the code names."""
    out = x
    for axis in ti.static(range(3)):
        which = digit(code, axis)
        length = box.upper[axis] - box.lower[axis]
        if which == 1:
            out[axis] = x[axis] - length if box.lower_kind[axis] == PERIODIC else 2.0 * box.lower[axis] - x[axis]
        elif which == 2:
            out[axis] = x[axis] + length if box.upper_kind[axis] == PERIODIC else 2.0 * box.upper[axis] - x[axis]
    return out


@ti.func
def image_velocity(box, v, code):
    """A velocity seen in the walls: mirrored by slip and friction, turned round by stick."""
    out = v
    for axis in ti.static(range(3)):
        kind = face_kind(box, code, axis)
        if kind == STICK:
            out = -out
        elif kind != PERIODIC:
            out[axis] = -out[axis]
    return out


@ti.func
def turned_back(box, code):
    """Per axis, 2 where the derivative along it is of an image's velocity turned round once more, else 0."""
    turns, back = 1.0, vec3(0.0)
    for axis in ti.static(range(3)):
        if face_kind(box, code, axis) == STICK:
            turns = -turns
    for axis in ti.static(range(3)):
        back[axis] = 1.0 + turns if face_kind(box, code, axis) == STICK else 1.0 - turns
    return back


@ti.func
def image_gradient(box, g, code):
    """The gradient of a scalar seen in the walls."""
    out = g
    for axis in ti.static(range(3)):
        if face_kind(box, code, axis) != PERIODIC:
            out[axis] = -out[axis]
    return out


@ti.func
def image_traction(box, g, code):
    """What pulls matter back to its neighbours' linear flow, seen in the walls."""
    out = g
    for axis in ti.static(range(3)):
        kind = face_kind(box, code, axis)
        if kind != PERIODIC and kind != STICK:
            out[axis] = -out[axis]
    return out


@ti.func
def walled(box, x, inset):
    """A position kept `inset` in front of walls."""
    out = x
    for axis in ti.static(range(3)):
        if box.lower_kind[axis] != PERIODIC:
            out[axis] = ti.math.clamp(x[axis], box.lower[axis] + inset, box.upper[axis] - inset)
    return out


@ti.func
def contained(box, x, inset):
    """The same, wrapped along periodic axes, too; lists are outdated then."""
    out = walled(box, x, inset)
    for axis in ti.static(range(3)):
        low, high = box.lower[axis], box.upper[axis]
        if box.lower_kind[axis] == PERIODIC:
            if x[axis] < low:
                out[axis] += high - low
            elif x[axis] >= high:
                out[axis] -= high - low
    return out


@ti.func
def cell_of(x, width):
    return ti.floor(x / width, ti.i32)


@ti.func
def key_of(world, cell):
    """World and cell in one number: 16 bits for each axis, which wrap without harm, for distances are checked."""
    mask = ti.cast(0xFFFF, ti.i64)
    key = ti.cast(world, ti.i64)
    for axis in ti.static(range(3)):
        key = key * ti.cast(0x10000, ti.i64) + (ti.cast(cell[axis], ti.i64) & mask)
    return key


@ti.func
def bucket_of(key, buckets):
    """A multiplicative hash (Knuth); the number of buckets is a power of two."""
    mixed = key * ti.i64(0x1E3779B97F4A7C15)
    return ti.cast((mixed >> 24) & ti.cast(buckets - 1, ti.i64), ti.i32)


@ti.kernel
def watch(capacity: int, count: Ints, position: Vectors, listed: Vectors, limit2: float, outdated: Ints):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity]:
            if (position[i] - listed[i]).norm_sqr() > limit2:
                outdated[0] = 1


@ti.kernel
def build(
    capacity: int,
    width: float,
    count: Ints,
    position: Vectors,
    outdated: Ints,
    key: Keys,
    start: Ints,
    filled: Ints,
    members: Ints,
):
    """Sort particles into buckets, where lists are outdated: count, hand out places, fill."""
    stale = outdated[0]
    for bucket in range(start.shape[0]):
        if stale == 1:
            filled[bucket] = 0
    for i in range(position.shape[0]):
        if stale == 1:
            key[i] = NOBODY
            world = i // capacity
            if i - world * capacity < count[world]:
                key[i] = key_of(world, cell_of(position[i], width))
                ti.atomic_add(filled[bucket_of(key[i], start.shape[0])], 1)
    handed = 0
    for bucket in range(start.shape[0]):
        if stale == 1:
            start[bucket] = ti.atomic_add(handed, filled[bucket])
            filled[bucket] = 0
    for i in range(position.shape[0]):
        if stale == 1 and key[i] != NOBODY:
            bucket = bucket_of(key[i], start.shape[0])
            members[start[bucket] + ti.atomic_add(filled[bucket], 1)] = i


@ti.func
def faces_near(box, x, reach, periodic):
    """Per axis 1 and 2, added, for the lower and upper face whose images of this kind may come within reach."""
    near = ivec3(0)
    for axis in ti.static(range(3)):
        if (box.lower_kind[axis] == PERIODIC) == periodic:
            if x[axis] - box.lower[axis] < reach:
                near[axis] += 1
            if box.upper[axis] - x[axis] < reach:
                near[axis] += 2
    return near


@ti.func
def allowed(near, code):
    """Whether every face that a code uses is near."""
    yes = True
    for axis in ti.static(range(3)):
        which = digit(code, axis)
        if which != 0 and (near[axis] & which) == 0:
            yes = False
    return yes


@ti.kernel
def fill_lists(
    capacity: int,
    box: BoxT,
    reach: float,
    limit: int,
    row: int,
    column: int,
    count: Ints,
    position: Vectors,
    key: Keys,
    start: Ints,
    filled: Ints,
    members: Ints,
    entries: Ints,
    number: Ints,
    inside: Ints,
    listed: Vectors,
    fault: Ints,
    outdated: Ints,
):
    """All neighbours within reach, images included: for every periodic shift the 27 cells around the shifted place,
    then the mirror images of those found."""
    stale = outdated[0]
    for i in range(position.shape[0]):
        world = i // capacity
        if stale == 1 and i - world * capacity >= count[world]:
            number[i] = 0
        elif stale == 1:
            x, n, reach2 = position[i], 0, reach * reach
            listed[i] = x
            shifts, mirrors = faces_near(box, x, reach, True), faces_near(box, x, reach, False)
            for shift in range(27 if shifts.sum() > 0 else 1):
                if allowed(shifts, shift):
                    # undo the shift: the particle among the others, as their images see it
                    back = x - (image_position(box, vec3(0.0), shift) if shift > 0 else vec3(0.0))
                    first, middle = n, cell_of(back, reach)
                    for k in range(27):
                        wanted = key_of(world, middle + ivec3(k // 9 - 1, (k // 3) % 3 - 1, k % 3 - 1))
                        bucket = bucket_of(wanted, start.shape[0])
                        for m in range(start[bucket], start[bucket] + filled[bucket]):
                            j = members[m]
                            if key[j] == wanted:
                                if (position[j] - back).norm_sqr() < reach2:
                                    if n < limit:
                                        entries[i * row + n * column] = j | (shift << INDEX_BITS)
                                    n += 1
                    last = ti.min(n, limit)
                    if shift == 0:
                        inside[i] = last
                    for face in range(1, 27 if mirrors.sum() > 0 else 1):
                        if allowed(mirrors, face):
                            code = shift + face
                            for k in range(first, last):
                                j = entries[i * row + k * column] & INDEX_MASK
                                if (image_position(box, position[j], code) - x).norm_sqr() < reach2:
                                    if n < limit:
                                        entries[i * row + n * column] = j | (code << INDEX_BITS)
                                    n += 1
            if n > limit:
                ti.atomic_or(fault[0], FAULT_NEIGHBOURS)
            number[i] = ti.min(n, limit)
    for _ in range(1):
        outdated[0] = 0


class TaichiNeighbours(Neighbours):
    """Lists of the same pairs, found by Taichi, with the widest skin; the kernels themselves look whether they are
    outdated."""

    def _allocate_cells(self) -> None:
        size, device = self.pool.size, self.scene.device
        buckets = 1 << max(size - 1, 1).bit_length()
        self.key = wp.zeros(size, dtype=wp.int64, device=device)
        self.start, self.filled = (wp.zeros(buckets, dtype=int, device=device) for _ in range(2))
        self.members = wp.zeros(size, dtype=int, device=device)

    def prepare(self) -> None:
        """Nothing: Taichi compiles when a substep is run (Taichi.prepare)."""

    def update(self) -> None:
        pool = self.pool
        cells = [self.key, self.start, self.filled, self.members]
        watched = [pool.capacity, pool.count, pool.position, self.listed, (0.5 * self.widest) ** 2]
        self.backend.launch(watch, pool.size, watched, [self.outdated])
        self.backend.launch(
            build, pool.size, [pool.capacity, self.reach, pool.count, pool.position, self.outdated], cells
        )
        self.backend.launch(
            fill_lists,
            pool.size,
            [
                pool.capacity,
                self.scene.box,
                self.reach,
                self.limit,
                self.lists.row,
                self.lists.column,
                pool.count,
                pool.position,
                *cells,
            ],
            [self.entries, self.number, self.inside, self.listed, pool.fault, self.outdated],
        )

    def _cell_bytes(self) -> int:
        return sum(array.capacity for array in (self.key, self.start, self.filled, self.members))
