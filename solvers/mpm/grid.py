"""The background grid of MPM: blocks of 4 x 4 x 4 nodes, allocated where there is material.

Walls lie halfway between nodes, where splines join: node 5 of a walled axis is half a cell in front of the lower wall,
node 4 + cells of the upper one, and the next beyond each is its image. A periodic axis has `cells` nodes from node
`first` on, so placed that no block holds just one of them: then any three neighbours lie in two blocks. `table` holds
slot + 1 of each block of each world, 0 where there is none.
"""

import numpy as np
import warp as wp

from fluidbench.errors import UserError
from fluidbench.native.crew import claimed, drawn, index_of, raise_fault
from fluidbench.native.scene import Scene
from fluidbench.native.vector_access import in_company
from fluidbench.scenario import Domain

wp.set_module_options({"enable_backward": False, "fast_math": True})

FIRST = 5  # the first node in front of lower walls: so the one behind them lies in its block
FAULT_BLOCKS = 1
MAX_BLOCKS = 2**30


@wp.struct
class Grid:
    origin: wp.vec3  # position of node 0 [m]
    dx: wp.vec3  # node spacing [m]
    inv_dx: wp.vec3  # [1/m]
    inv_volume: float  # of a cell [1/m^3]
    cells: wp.vec3i
    first: wp.vec3i  # node in front of the lower face; at it, where that is periodic
    wrap: wp.vec3i  # cells along periodic axes, else 0
    blocks: wp.vec3i
    blocks_per_world: int
    lower_kind: wp.vec3i
    upper_kind: wp.vec3i
    lower_friction: wp.vec3
    upper_friction: wp.vec3
    lower: wp.vec3  # walls [m]
    upper: wp.vec3
    top_speed: float  # as in scene.Box


def cells_of(domain: Domain, wanted: float) -> tuple[np.ndarray, np.ndarray]:
    """(cells, edges of a cell [m]) along each axis: what comes nearest to `wanted` and divides the domain; two walls
    share no cell."""
    length = np.asarray(domain.upper) - np.asarray(domain.lower)
    least = np.where(domain.walls.periodic(), 1, 2)
    cells = np.maximum(least, np.rint(length / wanted)).astype(int)
    return cells, length / cells


def blocks_along(cells: np.ndarray) -> np.ndarray:
    """Blocks of 4 nodes along each axis."""
    return (cells + FIRST) // 4 + 1


def blocks_of(domain: Domain, wanted: float) -> float:
    """How many blocks of 4^3 nodes a domain holds, with cells of about the edge wanted [m]."""
    return float(np.prod(blocks_along(cells_of(domain, wanted)[0]).astype(float)))


def grid_of(scene: Scene, wanted: float) -> Grid:
    """The grid of a scene with cells of about the edge wanted [m]."""
    domain, grid = scene.scenario.domain, Grid()
    cells, dx = cells_of(domain, wanted)
    lone = np.asarray(scene.periodic) & (cells % 4 == 1)
    first = np.where(scene.periodic, np.where(lone, 6, 4), FIRST)
    blocks = blocks_along(cells)
    if int(np.prod(blocks)) * scene.worlds > MAX_BLOCKS:
        raise UserError(f"the domain holds {np.prod(blocks):.3g} grid blocks; use a smaller domain or a larger spacing")
    before = np.where(scene.periodic, first, first - 0.5)
    grid.origin, grid.first = wp.vec3(*(np.asarray(domain.lower) - before * dx)), wp.vec3i(*first.tolist())
    grid.dx, grid.inv_dx, grid.inv_volume = wp.vec3(*dx), wp.vec3(*(1.0 / dx)), float(1.0 / dx.prod())
    grid.cells, grid.blocks = wp.vec3i(*cells.tolist()), wp.vec3i(*blocks.tolist())
    grid.wrap = wp.vec3i(*[int(n) if periodic else 0 for n, periodic in zip(cells, scene.periodic, strict=True)])
    grid.blocks_per_world = int(np.prod(blocks))
    for name in ("lower_kind", "upper_kind", "lower_friction", "upper_friction"):
        setattr(grid, name, getattr(scene.box, name))
    for name in ("lower", "upper", "top_speed"):
        setattr(grid, name, getattr(scene.box, name))
    return grid


@wp.func
def turns(lane: int, lanes: int, n: int):
    """(first, end, step) of a lane's items of n: side by side with other lanes on a GPU, one piece on the CPU."""
    first, end, step = int(lane), int(n), int(lanes)
    if not in_company():
        piece = (n + lanes - 1) / lanes
        first, end, step = lane * piece, wp.min((lane + 1) * piece, n), 1
    return first, end, step


@wp.func
def wrapped(node: int, first: int, wrap: int):
    """Index of a node on a periodic axis of `wrap` cells; unchanged on a walled one (wrap = 0)."""
    inside = node
    if wrap > 0:
        if node < first:
            inside = node + wrap
        elif node >= first + wrap:
            inside = node - wrap
    return inside


@wp.func
def on_grid(grid: Grid, base: wp.vec3i):
    """A node whose index may lie beyond the end of a periodic axis."""
    node = base
    for axis in range(3):
        node[axis] = wrapped(base[axis], grid.first[axis], grid.wrap[axis])
    return node


@wp.func
def first_node(grid: Grid, x: wp.vec3):
    """The lowest of the 27 nodes around a point (before wrapping)."""
    y = wp.cw_mul(x - grid.origin, grid.inv_dx)
    return wp.vec3i(int(wp.floor(y[0] - 0.5)), int(wp.floor(y[1] - 0.5)), int(wp.floor(y[2] - 0.5)))


@wp.func
def activate_block(
    grid: Grid,
    world: int,
    i: int,
    j: int,
    k: int,
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Give the block of node (i, j, k) a slot unless it has one."""
    b = (((i >> 2) * grid.blocks[1] + (j >> 2)) * grid.blocks[2] + (k >> 2)) + world * grid.blocks_per_world
    if table[b] == 0:
        if claimed(table, b):
            slot = drawn(active, 0)
            if slot < block_of.shape[0]:
                block_of[slot] = b
                table[b] = slot + 1
            else:
                table[b] = 0
                raise_fault(fault, FAULT_BLOCKS)


@wp.func
def activate_stencil(
    grid: Grid,
    world: int,
    base: wp.vec3i,
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Activate the blocks of the 27 nodes that start at `base`: those of its eight corners."""
    for corner in range(8):
        i = wrapped(base[0] + 2 * (corner >> 2), grid.first[0], grid.wrap[0])
        j = wrapped(base[1] + 2 * ((corner >> 1) & 1), grid.first[1], grid.wrap[1])
        k = wrapped(base[2] + 2 * (corner & 1), grid.first[2], grid.wrap[2])
        activate_block(grid, world, i, j, k, table, block_of, active, fault)


@wp.func
def node_of(grid: Grid, block: int, local: int):
    """Node (i, j, k) from its block's number within the world and its place within the block."""
    bz = block % grid.blocks[2]
    by = (block / grid.blocks[2]) % grid.blocks[1]
    bx = block / (grid.blocks[1] * grid.blocks[2])
    return wp.vec3i(bx * 4 + (local >> 4), by * 4 + ((local >> 2) & 3), bz * 4 + (local & 3))


@wp.func
def node_at(grid: Grid, world: int, node: wp.vec3i, table: wp.array(dtype=int)):
    """Where a node lies in arrays of nodes; -1 where no block is active, or beyond the grid."""
    at = int(-1)
    i, j, k = node[0] >> 2, node[1] >> 2, node[2] >> 2
    if i >= 0 and j >= 0 and k >= 0 and i < grid.blocks[0] and j < grid.blocks[1] and k < grid.blocks[2]:
        slot = table[(i * grid.blocks[1] + j) * grid.blocks[2] + k + world * grid.blocks_per_world] - 1
        if slot >= 0:
            at = slot * 64 + ((node[0] & 3) << 4) + ((node[1] & 3) << 2) + (node[2] & 3)
    return at


@wp.func
def raw_node(grid: Grid, world: int, node: wp.vec3i, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)):
    """Momentum and mass scattered to a node; zero where no block is active."""
    at = node_at(grid, world, node, table)
    value = wp.vec4(0.0, 0.0, 0.0, 0.0)
    if at >= 0:
        value = raw[at]
    return value


@wp.func
def parts_of(grid: Grid, low: wp.vec3i, middle: wp.vec3i, high: wp.vec3i):
    """Per axis the block and in-block contributions to the address of three nodes."""
    bx, by, bz = wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0)
    lx, ly, lz = wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0), wp.vec3i(0, 0, 0)
    nodes = wp.matrix_from_rows(low, middle, high)
    for o in range(3):
        bx[o] = (nodes[o, 0] >> 2) * grid.blocks[1] * grid.blocks[2]
        by[o] = (nodes[o, 1] >> 2) * grid.blocks[2]
        bz[o] = nodes[o, 2] >> 2
        lx[o] = (nodes[o, 0] & 3) << 4
        ly[o] = (nodes[o, 1] & 3) << 2
        lz[o] = nodes[o, 2] & 3
    return bx, by, bz, lx, ly, lz


@wp.func
def node_parts(grid: Grid, base: wp.vec3i):
    """The same of the nodes of a stencil."""
    one = wp.vec3i(1, 1, 1)
    return parts_of(grid, on_grid(grid, base), on_grid(grid, base + one), on_grid(grid, base + 2 * one))


@wp.func
def slots_of(table: wp.array(dtype=int), start: int, bx: wp.vec3i, by: wp.vec3i, bz: wp.vec3i):
    """Slots of the (at most) eight blocks of a stencil, -1 where there is none; z varies fastest."""
    return (
        table[start + bx[0] + by[0] + bz[0]] - 1,
        table[start + bx[0] + by[0] + bz[2]] - 1,
        table[start + bx[0] + by[2] + bz[0]] - 1,
        table[start + bx[0] + by[2] + bz[2]] - 1,
        table[start + bx[2] + by[0] + bz[0]] - 1,
        table[start + bx[2] + by[0] + bz[2]] - 1,
        table[start + bx[2] + by[2] + bz[0]] - 1,
        table[start + bx[2] + by[2] + bz[2]] - 1,
    )


@wp.func
def slot_of(low: bool, near: bool, first: bool, s0: int, s1: int, s2: int, s3: int, s4: int, s5: int, s6: int, s7: int):
    """Of eight blocks the one that is the lower or not along x, y and z."""
    t0, t1 = wp.where(low, s0, s4), wp.where(low, s1, s5)
    t2, t3 = wp.where(low, s2, s6), wp.where(low, s3, s7)
    return wp.where(first, wp.where(near, t0, t2), wp.where(near, t1, t3))


@wp.func_native(
    snippet="""
#if defined(__CUDA_ARCH__)
    const volatile wp::int32* const now = &table.data[block];
    wp::int32 slot;
    do slot = *now; while (slot < 0);
    return slot - 1;
#else
    return table.data[block] - 1;
#endif
"""
)
def slot_drawn(table: wp.array(dtype=int), block: int) -> int:
    """Slot of a block, -1 where there is none, once a thread that has claimed it in this launch has drawn its slot."""
    ...


@wp.func
def slots_drawn(table: wp.array(dtype=int), start: int, bx: wp.vec3i, by: wp.vec3i, bz: wp.vec3i):
    """The same of blocks that threads of this launch activate."""
    return (
        slot_drawn(table, start + bx[0] + by[0] + bz[0]),
        slot_drawn(table, start + bx[0] + by[0] + bz[2]),
        slot_drawn(table, start + bx[0] + by[2] + bz[0]),
        slot_drawn(table, start + bx[0] + by[2] + bz[2]),
        slot_drawn(table, start + bx[2] + by[0] + bz[0]),
        slot_drawn(table, start + bx[2] + by[0] + bz[2]),
        slot_drawn(table, start + bx[2] + by[2] + bz[0]),
        slot_drawn(table, start + bx[2] + by[2] + bz[2]),
    )


@wp.kernel
def reset_blocks(table: wp.array(dtype=int), block_of: wp.array(dtype=int), active: wp.array(dtype=int), lanes: int):
    """Forget all blocks."""
    t = wp.tid()
    while t < wp.min(active[0], block_of.shape[0]):
        table[block_of[t]] = 0
        t += lanes


@wp.kernel
def find_blocks(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    # outputs
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Activate the blocks around every particle."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        activate_stencil(grid, world, first_node(grid, position[p]), table, block_of, active, fault)


@wp.kernel
def clear_grid(share: wp.vec3i, active: wp.array(dtype=int), lanes: int, raw: wp.array(dtype=wp.vec4)):
    """Empty the nodes of all active blocks."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        raw[t] = wp.vec4(0.0, 0.0, 0.0, 0.0)
        t += step
