"""Memory order: keys that put particles of one cell side by side, block by block."""

import numpy as np
import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

wp.set_module_options({"enable_backward": False})


@wp.kernel
def cell_keys(
    share: wp.vec3i,
    lower: wp.vec3,
    inv_cell: wp.vec3,
    cells: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    keys: wp.array(dtype=wp.int64),
):
    """World, then blocks of 4 x 4 x 4 cells, then cells; unused slots come last within their world."""
    p = index_of(share, wp.tid())
    world = p / capacity
    per_world = wp.int64(cells[0]) * wp.int64(cells[1]) * wp.int64(cells[2]) * wp.int64(64)
    key = per_world
    if p - world * capacity < count[world]:
        x = wp.cw_mul(position[p] - lower, inv_cell)
        i = wp.clamp(int(x[0]), 0, cells[0] * 4 - 1)
        j = wp.clamp(int(x[1]), 0, cells[1] * 4 - 1)
        k = wp.clamp(int(x[2]), 0, cells[2] * 4 - 1)
        block = (wp.int64(i >> 2) * wp.int64(cells[1]) + wp.int64(j >> 2)) * wp.int64(cells[2]) + wp.int64(k >> 2)
        key = block * wp.int64(64) + wp.int64(((i & 3) << 4) + ((j & 3) << 2) + (k & 3))
    keys[p] = wp.int64(world) * (per_world + wp.int64(1)) + key


class CellOrder:
    """Sort keys of a pool for cells of given edges [m], the first of which begins `shift` edges below the domain."""

    def __init__(self, scene: Scene, pool: Pool, cell: float | np.ndarray, shift: float | np.ndarray = 0.0) -> None:
        self.scene, self.pool = scene, pool
        cell = np.broadcast_to(cell, 3)
        domain = scene.scenario.domain
        self.lower = wp.vec3(*(np.asarray(domain.lower) - shift * cell))
        self.inverse = wp.vec3(*(1.0 / cell))
        length = np.asarray(domain.upper) - np.asarray(domain.lower)
        self.blocks = wp.vec3i(*(np.ceil(length / (4 * cell)).astype(int) + 1).tolist())
        per_world = 64 * int(np.prod(np.array(self.blocks, dtype=np.int64))) + 1
        self.bits = (scene.worlds * per_world - 1).bit_length()  # of the largest key
        self.values = wp.zeros(2 * pool.size, dtype=wp.int64, device=scene.device)

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def keys(self) -> wp.array:
        """Array of 2 * size int64, the keys in its first half, as the radix sort wants it."""
        self.scene.crew.launch(
            cell_keys,
            self.pool.size,
            [
                self.lower,
                self.inverse,
                self.blocks,
                self.pool.capacity,
                self.pool.count,
                self.pool.position,
                self.values,
            ],
        )
        return self.values
