"""Neighbour lists for SPH and PBD: a hash grid feeds lists that are reused until something has moved half a skin.

Walls and periodic axes enter as images: a neighbour is a particle, or its image in a face. One list entry holds the
index in its low 26 bits and the image code cx + 3 cy + 9 cz above them, c = 0 for none, 1 for the lower face's image,
2 for the upper one's. A mirror image completes the kernel at a wall exactly; a periodic image is a shift.
"""

import math

import numpy as np
import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import PERIODIC, STICK, Box, Scene
from fluidbench.scenario.expansion import Expansion

from .backends import Backend

wp.set_module_options({"enable_backward": False})
INDEX_BITS = wp.constant(26)
INDEX_MASK = wp.constant(2**26 - 1)
FAULT_NEIGHBOURS = 4
ROOM = 1.7  # how much denser than a lattice matter may get before its lists overflow
WALL_INSET = wp.constant(0.2)  # closest approach to a wall, in particle spacings; at rest the first layer is at 0.5


def crowded(expansion: Expansion) -> str | None:
    """Why spawned children would not fit into the lists; None if they do."""
    if expansion.kind == "growth" or expansion.per_pass <= 0.9 * ROOM:
        return None
    passes = math.ceil(math.log(expansion.ratio) / math.log(0.9 * ROOM))
    return (
        f"{expansion.per_pass:.3g} children at once, in the place of one, overfill its neighbour lists; set "
        f'material.expansion.passes = {passes} or more, or kind = "growth"'
    )


@wp.struct
class Lists:
    """Entry k of particle i is entries[i * row + k * column], for k < number[i]."""

    entries: wp.array(dtype=int)
    number: wp.array(dtype=int)
    row: int
    column: int


@wp.func
def image_code(code: int, axis: int):
    """0, 1 or 2: which image the code means on one axis."""
    digit = code
    if axis == 1:
        digit = code / 3
    elif axis == 2:
        digit = code / 9
    return digit % 3


@wp.func
def image_position(box: Box, x: wp.vec3, code: int):
    """The image of a point; undoing a periodic shift needs the opposite code."""
    out = x
    for axis in range(3):
        c = image_code(code, axis)
        if c == 1:
            if box.lower_kind[axis] == PERIODIC:
                out[axis] = x[axis] - (box.upper[axis] - box.lower[axis])
            else:
                out[axis] = 2.0 * box.lower[axis] - x[axis]
        elif c == 2:
            if box.upper_kind[axis] == PERIODIC:
                out[axis] = x[axis] + (box.upper[axis] - box.lower[axis])
            else:
                out[axis] = 2.0 * box.upper[axis] - x[axis]
    return out


@wp.func
def face_kind(box: Box, code: int, axis: int):
    """Kind of the wall that the code mirrors in on this axis; PERIODIC where it mirrors in none."""
    c = image_code(code, axis)
    kind = int(PERIODIC)
    if c == 1:
        kind = box.lower_kind[axis]
    elif c == 2:
        kind = box.upper_kind[axis]
    return kind


@wp.func
def image_velocity(box: Box, v: wp.vec3, code: int):
    """A velocity seen in the walls: slip and friction mirror the normal component, stick turns all of them round."""
    out = v
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind == STICK:
            out = -out
        elif kind != PERIODIC:
            out[axis] = -out[axis]
    return out


@wp.func
def image_gradient(box: Box, g: wp.vec3, code: int):
    """The gradient of a scalar seen in the walls: mirrors turn its normal component round."""
    out = g
    for axis in range(3):
        if face_kind(box, code, axis) != PERIODIC:
            out[axis] = -out[axis]
    return out


@wp.func
def image_rate(box: Box, g: wp.mat33, code: int):
    """A velocity gradient dv_i/dx_j seen in the walls, consistent with `image_velocity`."""
    out = g
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind != PERIODIC:
            for b in range(3):
                out[b, axis] = -out[b, axis]
            if kind == STICK:
                out = -1.0 * out
            else:
                for b in range(3):
                    out[axis, b] = -out[axis, b]
    return out


@wp.func
def contained(box: Box, x: wp.vec3, inset: float):
    """A position wrapped along periodic axes and kept `inset` in front of walls, so it never meets its own image."""
    out = x
    for axis in range(3):
        low, high = box.lower[axis], box.upper[axis]
        if box.lower_kind[axis] == PERIODIC:
            if x[axis] < low:
                out[axis] = x[axis] + (high - low)
            elif x[axis] >= high:
                out[axis] = x[axis] - (high - low)
        else:
            out[axis] = wp.clamp(x[axis], low + inset, high - inset)
    return out


@wp.kernel
def watch(
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    listed: wp.array(dtype=wp.vec3),
    limit2: float,
    # outputs
    outdated: wp.array(dtype=int),
):
    """Mark the lists outdated once a particle has moved half the skin since they were made."""
    i = wp.tid()
    if i % capacity < count[i / capacity]:
        if wp.length_sq(position[i] - listed[i]) > limit2:
            outdated[0] = 1


@wp.kernel
def mark_worlds(capacity: int, worlds: int, count: wp.array(dtype=int), group: wp.array(dtype=int)):
    """The world of each slot; unused slots belong to a world of their own."""
    i = wp.tid()
    group[i] = i / capacity
    if i % capacity >= count[i / capacity]:
        group[i] = worlds


@wp.func
def near_faces(box: Box, x: wp.vec3, reach: float, periodic: bool):
    """Per axis, bits 1 and 2 for the lower and upper face whose images (periodic, or mirrored) may come within reach;
    bit 4, always set, for no image."""
    near = wp.vec3i(4, 4, 4)
    for axis in range(3):
        if (box.lower_kind[axis] == PERIODIC) == periodic:
            if x[axis] - box.lower[axis] < reach:
                near[axis] = near[axis] + 1
            if box.upper[axis] - x[axis] < reach:
                near[axis] = near[axis] + 2
    return near


@wp.func
def has_choice(near: wp.vec3i, code: int):
    """Whether all of the faces that a code uses are near."""
    zero = (code % 3 == 0) or (near[0] & (code % 3)) != 0
    one = ((code / 3) % 3 == 0) or (near[1] & ((code / 3) % 3)) != 0
    two = (code / 9 == 0) or (near[2] & (code / 9)) != 0
    return zero and one and two


@wp.func
def opposite(code: int):
    """The code that undoes a periodic shift."""
    back = int(0)
    power = int(1)
    for axis in range(3):
        back += ((3 - image_code(code, axis)) % 3) * power
        power *= 3
    return back


@wp.kernel
def fill_lists(
    grid: wp.uint64,
    box: Box,
    group: wp.array(dtype=int),
    worlds: int,
    reach: float,
    limit: int,
    row: int,
    column: int,
    position: wp.array(dtype=wp.vec3),
    # outputs
    entries: wp.array(dtype=int),
    number: wp.array(dtype=int),
    listed: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
    outdated: wp.array(dtype=int),
):
    """All neighbours within reach, images included.

    Periodic images are found by asking the grid at the shifted place. Mirror images need no search: a particle is
    never farther away than its image, so they are among the particles just found, or the particle itself.
    """
    i = wp.tid()
    world = group[i]
    n = int(0)
    if world < worlds:
        x = position[i]
        listed[i] = x
        reach2 = reach * reach
        shifts = near_faces(box, x, reach, True)
        mirrors = near_faces(box, x, reach, False)
        most_shifts, most_mirrors = int(1), int(1)
        if shifts[0] + shifts[1] + shifts[2] > 12:
            most_shifts = 27
        if mirrors[0] + mirrors[1] + mirrors[2] > 12:
            most_mirrors = 27
        for shift in range(most_shifts):
            if has_choice(shifts, shift):
                first = n
                at = image_position(box, x, opposite(shift))
                query = wp.hash_grid_query(grid, at, reach, world)
                for j in query:
                    if wp.length_sq(position[j] - at) < reach2 and (j != i or shift > 0):
                        if n < limit:
                            entries[i * row + n * column] = j + (shift << INDEX_BITS)
                        n += 1
                last = wp.min(n, limit)
                for face in range(1, most_mirrors):
                    if has_choice(mirrors, face):
                        code = shift + face
                        if shift == 0 and wp.length_sq(image_position(box, x, code) - x) < reach2:
                            if n < limit:
                                entries[i * row + n * column] = i + (code << INDEX_BITS)
                            n += 1
                        for k in range(first, last):
                            j = entries[i * row + k * column] & INDEX_MASK
                            if wp.length_sq(image_position(box, position[j], code) - x) < reach2:
                                if n < limit:
                                    entries[i * row + n * column] = j + (code << INDEX_BITS)
                                n += 1
        if n > limit:
            wp.atomic_or(fault, 0, FAULT_NEIGHBOURS)
            n = limit
    number[i] = n
    if i == 0:
        outdated[0] = 0


class Neighbours:
    """Lists of all pairs within `radius`, valid while nothing has moved more than half of `skin` (both [m])."""

    def __init__(self, scene: Scene, pool: Pool, backend: Backend, radius: float, skin: float) -> None:
        self.scene, self.pool, self.backend = scene, pool, backend
        self.limit = limit = room((radius + skin) / scene.spacing)
        self.reach, self.half_skin2 = radius + skin, (0.5 * skin) ** 2
        # On the CPU a particle's list is contiguous; on a GPU the k-th entries of neighbouring threads are.
        self.row, self.column = (limit, 1) if scene.device.is_cpu else (1, pool.size)
        with wp.ScopedDevice(scene.device):
            self.entries = wp.empty(pool.size * limit, dtype=int)
            self.number = wp.zeros(pool.size, dtype=int)
            self.listed = wp.zeros(pool.size, dtype=wp.vec3)
            self.outdated = wp.ones(1, dtype=int)
        self.lists = Lists()
        self.lists.entries, self.lists.number = self.entries, self.number
        self.lists.row, self.lists.column = self.row, self.column
        self._allocate_grid()

    def _allocate_grid(self) -> None:
        with wp.ScopedDevice(self.scene.device):
            self.group = wp.zeros(self.pool.size, dtype=int)
            self.grid = wp.HashGrid(*_grid_shape(self.pool.size))
            self.grid.reserve(self.pool.size, with_groups=True)

    def prepare(self) -> None:
        """Compile the search."""
        wp.load_module(__name__, device=self.scene.device)

    def refresh(self) -> None:
        """The pool was changed from outside: make the lists anew at the next substep."""
        self.outdated.fill_(1)

    def update(self) -> None:
        """Enqueue the check of the lists and, on the device's own decision, their renewal."""
        pool = self.pool
        self.backend.launch(
            watch, pool.size, [pool.capacity, pool.count, pool.position, self.listed, self.half_skin2], [self.outdated]
        )
        if self.scene.device.is_cpu:
            wp.capture_if(self.outdated, on_true=self._renew)
        else:
            # The grid's sort cannot be part of a CUDA conditional: it is built at every substep, the lists are not.
            self._build()
            wp.capture_if(self.outdated, on_true=self._fill)

    def _renew(self) -> None:
        self._build()
        self._fill()

    def _build(self) -> None:
        pool = self.pool
        self.backend.launch(mark_worlds, pool.size, [pool.capacity, pool.worlds, pool.count], [self.group])
        self.grid.build(pool.position, self.reach, groups=self.group)

    def _fill(self) -> None:
        pool = self.pool
        self.backend.launch(
            fill_lists,
            pool.size,
            [
                self.grid.id,
                self.scene.box,
                self.group,
                pool.worlds,
                self.reach,
                self.limit,
                self.row,
                self.column,
                pool.position,
            ],
            [self.entries, self.number, self.listed, pool.fault, self.outdated],
        )

    def carried(self) -> dict[str, wp.array]:
        """The lists as they are: made anew, they would be summed over in another order."""
        return {name: getattr(self, name) for name in ("entries", "number", "listed", "outdated")}

    def footprint(self) -> dict[str, int]:
        return {"neighbour lists": self.entries.capacity + self.number.capacity + self.listed.capacity}


def neighbours_of(scene: Scene, pool: Pool, backend: Backend, radius: float, skin: float) -> Neighbours:
    """Lists found by a backend's own search."""
    if backend.name == "taichi":
        from .neighbours_taichi import TaichiNeighbours

        return TaichiNeighbours(scene, pool, backend, radius, skin)
    return Neighbours(scene, pool, backend, radius, skin)


def room(reach_ratio: float) -> int:
    """Entries to allow for: 1.7 times those of a lattice. Odd multiples of 8, lest rows collide in the cache."""
    return 16 * int(np.ceil(ROOM * 4.0 / 3.0 * np.pi * reach_ratio**3 / 16.0)) + 8


def _grid_shape(particles: int) -> tuple[int, int, int]:
    """Hash cells for that many particles: about one a particle, no fewer than 32 an axis."""
    side = int(np.clip(2 ** np.ceil(np.log2(max(particles, 1)) / 3), 32, 256))
    return (side, side, side)
