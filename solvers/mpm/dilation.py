"""Beside a body elastic matter of MPM, as pastes are, gains the volume that flows out of its space.

A divergence that is known at particles alone misses what flows between them: where a strand turns beneath a face its
particles part into rows, some cells hold none, and it was laid up to a fifth too large by particles each of which told
that its volume was kept. So here a node i tells the divergence that is an integral over its space, the flux through the
faces of the cell around it, and particles follow theirs (a B-bar method; another one for MPM: Telikicherla &
Moutsanidis 2024, arXiv:2407.03826):

    D_i = sum_a sum_e w_e f_j f_k (v_k - v_j)_a / (dx_a S_ia),  S_ia = sum_e w_e f_j f_k,  theta_p = sum_i w_ip D_i

along each axis a over the 18 edges e = (j, k) from i's 27 nodes to the next along a, w_e = 1/6, 4/6, 1/6 across (the
integral of a quadratic spline over a cell), f the share of a node's space that matter fills, at most 1, and nothing of
a gap between two bodies (gaps.py). Where nodes are full this is the flux; where they are not, a mean slope of those
that matter reaches: exact for what is linear, none of what turns. Its pressure pushes by the transpose, so that stress
does just the work of the strain that is read, whatever the law, and no momentum is made:

    F_j = -sum_i P_i dD_i / dv_j,   P_i = sum_p w_ip V0 tau_m

(tau_m: the mean Kirchhoff stress; shape and what resists it stay with the affine field of each particle). As f falls
with the mass of a node, what is nearly empty is not thrown. Liquids, which are shifted into gaps (tool.py), keep the
divergence of their affine fields: by this one, and not shifted, strands of them left the floor and sank behind the tip.
"""

from typing import Any

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Phase, Scene

from .grid import Grid, first_node, node_at, on_grid, turns
from .particle import mean_stress, presses_nodes, weights
from .tied import Blocks, node_here

wp.set_module_options({"enable_backward": False, "fast_math": True})

LEAST = wp.constant(1.0e-6)  # S, of edges that tell anything
Around: Any = wp.types.vector(length=27, dtype=wp.int32)  # of nodes, where they lie; z varies fastest
Shares: Any = wp.types.vector(length=27, dtype=wp.float32)


@wp.func
def around(grid: Grid, world: int, base: wp.vec3i, table: wp.array(dtype=int)):
    """Where the 27 nodes from `base` on lie, -1 where there is none."""
    at = Around()
    for o in range(3):
        for q in range(3):
            for r in range(3):
                at[9 * o + 3 * q + r] = node_at(grid, world, on_grid(grid, base + wp.vec3i(o, q, r)), table)
    return at


@wp.func
def around_node(grid: Grid, block_of: wp.array(dtype=int), t: int, table: wp.array(dtype=int)):
    """(world of the t-th of all active nodes; where it and those about it lie)"""
    world, node = node_here(grid, block_of, t)
    return world, around(grid, world, node - wp.vec3i(1, 1, 1), table)


@wp.func
def filled(at: Around, nodes: wp.array(dtype=wp.vec4)):
    """f of nodes, 0 where there is none."""
    full = Shares()
    for n in range(27):
        if at[n] >= 0:
            full[n] = nodes[at[n]][3]
    return full


@wp.func
def beside(axis: int, line: int):
    """(in the middle of an axis, the line-th of nine nodes across it; from there to the next along it; its weight)"""
    b, c = line / 3, line % 3
    along = wp.where(axis == 0, 9, wp.where(axis == 1, 3, 1))
    first = wp.where(axis == 0, 3, 9)
    second = wp.where(axis == 2, 3, 1)
    w = wp.where(b == 1, 4.0, 1.0) * wp.where(c == 1, 4.0, 1.0) / 36.0
    return along + first * b + second * c, along, w


@wp.kernel
def tell(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """(P [J], -, -, f) of every node, of its own on either side of a wall: what is not yet held by one is no image."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        phase, push = phases[world, phase_of[p]], float(0.0)
        if presses_nodes(phase):
            push = mean_stress(phase, volume_ratio[p])
        row = volume[p] * wp.vec4(push, 0.0, 0.0, grid.inv_volume)
        base = first_node(grid, position[p])
        _f, wx, wy, wz = weights(grid, position[p], base)
        at = around(grid, world, base, table)
        for o in range(3):
            for q in range(3):
                for r in range(3):
                    n = 9 * o + 3 * q + r
                    if at[n] >= 0:
                        wp.atomic_add(nodes, at[n], (wx[o] * wy[q] * wz[r]) * row)


@wp.kernel
def bound(
    share: wp.vec3i,
    lanes: int,
    active: wp.array(dtype=int),
    gap: wp.array(dtype=float),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """f is 1 at most, and less of nodes that lie in a gap, if there may be any."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, nodes.shape[0]))
    while t < end:
        row = nodes[t]
        full = wp.min(row[3], 1.0)
        if t < gap.shape[0]:
            full *= 1.0 - gap[t]
        nodes[t] = wp.vec4(row[0], 0.0, 0.0, full)
        t += step


@wp.kernel
def weigh(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    # outputs
    pull: wp.array(dtype=wp.vec3),
):
    """P / S along each axis, for every node."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, nodes.shape[0]))
    while t < end:
        found = wp.vec3(0.0, 0.0, 0.0)
        if nodes[t][0] != 0.0:
            _world, at = around_node(grid, block_of, t, table)
            full = filled(at, nodes)
            for axis in range(3):
                total = float(0.0)
                for line in range(9):
                    n, along, w = beside(axis, int(line))
                    total += w * full[n] * (full[n - along] + full[n + along])
                if total > LEAST:
                    found[axis] = nodes[t][0] / total
        pull[t] = found
        t += step


@wp.func
def pull_of(at: int, axis: int, pull: wp.array(dtype=wp.vec3)):
    """P / S of a node along an axis, 0 where there is none."""
    found = float(0.0)
    if at >= 0:
        found = pull[at][axis]
    return found


@wp.kernel
def press(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    dt: wp.array(dtype=float),
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    pull: wp.array(dtype=wp.vec3),
    # outputs
    raw: wp.array(dtype=wp.vec4),
):
    """What pressure adds to the momentum of every node within dt: its edges are those to the next along each axis,
    which 18 nodes about their ends tell of."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, nodes.shape[0]))
    while t < end:
        if nodes[t][3] > 0.0:
            world, at = around_node(grid, block_of, t, table)
            full = filled(at, nodes)
            given = wp.vec4(0.0, 0.0, 0.0, 0.0)
            for axis in range(3):
                below, here, above = float(0.0), float(0.0), float(0.0)
                for line in range(9):
                    n, along, w = beside(axis, int(line))
                    below += w * pull_of(at[n - along], axis, pull)
                    here += w * pull_of(at[n], axis, pull)
                    above += w * pull_of(at[n + along], axis, pull)
                n, along, _w = beside(axis, 4)
                push = full[n] * (full[n - along] * (below + here) - full[n + along] * (here + above))
                given[axis] = -dt[world] * grid.inv_dx[axis] * push
            raw[t] = raw[t] + given
        t += step


@wp.kernel
def dilate(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    dilation: wp.array(dtype=float),
):
    """D of every node [1/s]."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, nodes.shape[0]))
    while t < end:
        found = float(0.0)
        if nodes[t][3] > 0.0:
            _world, at = around_node(grid, block_of, t, table)
            full = filled(at, nodes)
            for axis in range(3):
                total, flux = float(0.0), float(0.0)
                for line in range(9):
                    n, along, w = beside(axis, int(line))
                    if full[n] > 0.0:
                        v = moving[at[n]][axis]
                        for side in range(2):
                            m = n + wp.where(side == 0, -along, along)
                            edge = w * full[n] * full[m]
                            if edge > 0.0:
                                total += edge
                                flux += edge * wp.where(side == 0, -1.0, 1.0) * (moving[at[m]][axis] - v)
                if total > LEAST:
                    found += flux / total * grid.inv_dx[axis]
        dilation[t] = found
        t += step


@wp.func
def untold(
    grid: Grid,
    world: int,
    x: wp.vec3,
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    dilation: wp.array(dtype=float),
):
    """theta - tr C of a particle at x [1/s]: by how much faster its volume grows than its affine field tells."""
    base = first_node(grid, x)
    f, wx, wy, wz = weights(grid, x, base)
    total = float(0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                at = node_at(grid, world, on_grid(grid, base + wp.vec3i(o, q, r)), table)
                if at >= 0:
                    away = wp.cw_mul(wp.vec3(float(o), float(q), float(r)) - f, grid.inv_dx)
                    v = wp.vec3(moving[at][0], moving[at][1], moving[at][2])
                    total += wx[o] * wy[q] * wz[r] * (dilation[at] - 4.0 * wp.dot(v, away))
    return total


class Dilation:
    """The launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, slots: int, lanes: int) -> None:
        """`slots` are the blocks of the grid that can be active, `lanes` the threads that go through their nodes."""
        self.scene, self.pool, self.grid, self.lanes = scene, pool, grid, lanes
        with wp.ScopedDevice(scene.device):
            self.nodes = wp.zeros(64 * slots, dtype=wp.vec4)
            self.pull = wp.zeros(64 * slots, dtype=wp.vec3)
            self.rate = wp.zeros(64 * slots, dtype=float)
            self._none = wp.zeros(0, dtype=float)

    def press(self, dt: wp.array, blocks: Blocks, gap: wp.array | None, raw: wp.array) -> None:
        """Enqueue: pressure's share of momenta within dt, by way of `nodes`, which are empty; `gap` as in gaps.py."""
        table, block_of, active = blocks
        pool, launch = self.pool, self.scene.crew.launch
        matter: list[Any] = [pool.phase, pool.position, pool.volume, pool.volume_ratio, table]
        launch(tell, pool.size, [self.grid, pool.capacity, pool.count, self.scene.phases, *matter], [self.nodes])
        launch(bound, self.lanes, [self.lanes, active, self._none if gap is None else gap], [self.nodes])
        where = [active, block_of, table, self.nodes]
        launch(weigh, self.lanes, [self.grid, self.lanes, *where], [self.pull])
        launch(press, self.lanes, [self.grid, self.lanes, dt, *where, self.pull], [raw])

    def tell(self, blocks: Blocks, moving: wp.array) -> None:
        """Enqueue: the rate at which the space of nodes grows, of their velocities."""
        table, block_of, active = blocks
        inputs = [self.grid, self.lanes, active, block_of, table, self.nodes, moving]
        self.scene.crew.launch(dilate, self.lanes, inputs, [self.rate])

    def footprint(self) -> dict[str, int]:
        return {f"dilation.{name}": getattr(self, name).capacity for name in ("nodes", "pull", "rate")}
