"""A rigid body among the particles of MPM: they see it as a mirror, and stick to it.

What is in front of its surface has an image behind it, as far away: the same mass in the space that the mirror takes,
the velocity 2 u - v that makes the mean that of the body, u, and the same stress. Nodes about the surface then find
space filled on both sides, wherever it lies between them: a pressure pushes nothing along it, and the velocity goes
through that of the body. It is what walls of the domain do on their nodes (walls.py), for a surface that moves and may
be round. An image counts only where the surface nearest to it is the one that it is seen in: where a rim turns, those
of both sides share the space behind it.

What is gathered is that of nodes in front, not the transpose of what was scattered: a transfer amplifies by up to
1.03, and a pressure makes energy. (The transpose would turn stress along the surface round, which pushes matter about
wherever it is curved, and let the last of the images expand into the void behind them.) Viscous stress damps the
velocity. What it leaves shows in the volume ratios, which drift apart from particle to particle until pressures tear
the flow up; so they diffuse, as densities do in SPH: J += dt DIFFUSION c / dx (<J> - J), <J> that of the nodes. What
they drift by together stays: along a bore matter came to be packed by up to a quarter more than its J told. A bore has
no free surface, and matter shares its space: there <J> is the share. Nothing like it holds a paste, whose stress
drifts, too; viscosity that is solved for, of which images know nothing; or what slips. All three are refused
(pressed.py).
"""

from typing import Any

import warp as wp

from fluidbench.method.frame import CLAMPED, FREE
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Phase, Scene

from ..tool import Tool, mirrored, outside, table_of, tool_of
from .grid import Grid, first_node, node_at
from .nodes import follow, mean_of_nodes, room_of, tell_nodes
from .particle import columns_scaled, inertia, kirchhoff, resistance_of, viscous, weights
from .piston import REACHED, Piston

wp.set_module_options({"enable_backward": False})

REACH = 2.5  # of images [cells]: nodes behind the surface that particles in front of it read are then complete
DIFFUSION = wp.constant(0.1)  # of J, over c dx; of densities: Antuono et al. 2010, Comput. Phys. Commun. 181:532


@wp.kernel
def reflect(
    grid: Grid,
    tool: Tool,
    reach: float,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    # outputs
    raw: wp.array(dtype=wp.vec4),
):
    """Momentum and mass of images to nodes that are active, strained already."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        x, fill, normal = mirrored(tool, position[p], reach)
        if fill > 0.0:
            phase = phases[world, phase_of[p]]
            m = fill * inertia(mass[p], held[p])
            turned = affine[p] - 2.0 * wp.outer(affine[p] * normal, normal)
            v = 2.0 * tool.pose.velocity[0] - velocity[p]
            a = wp.mat33()
            if held[p] != CLAMPED:
                a = columns_scaled(-m * turned, grid.dx)
            if dt[world] > 0.0:
                tau = kirchhoff(phase, volume_ratio[p], wp.vec3(1.0, 1.0, 1.0), wp.vec3())
                if phase.viscosity > 0.0:
                    tau += viscous(phase, volume_ratio[p], affine[p])
                a -= resistance_of(grid, dt[world], fill * volume[p], tau)
            base = first_node(grid, x)
            f, wx, wy, wz = weights(grid, x, base)
            momentum = m * v - a * f
            for o in range(3):
                for q in range(3):
                    for r in range(3):
                        at = node_at(grid, world, wp.vec3i(base[0] + o, base[1] + q, base[2] + r), table)
                        if at >= 0:
                            w = wx[o] * wy[q] * wz[r]
                            u = w * (momentum + a * wp.vec3(float(o), float(q), float(r)))
                            wp.atomic_add(raw, at, wp.vec4(u[0], u[1], u[2], w * m))


@wp.kernel
def keep_out(
    share: wp.vec3i,
    grid: Grid,
    tool: Tool,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """What would enter the body stays in front of it, among active nodes."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and held[p] == FREE:
        before = position[p]
        position[p] = outside(tool, before)
        follow(grid, world, before, position[p], table, block_of, active, homes, fault)


@wp.kernel
def spread(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """(sum of w V0 J, -, -, sum of w V0) to nodes."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        row = volume[p] * wp.vec4(volume_ratio[p], 0.0, 0.0, 1.0)
        tell_nodes(grid, world, position[p], False, row, table, nodes)


@wp.kernel
def level(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    piston: Piston,
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    volume_ratio: wp.array(dtype=float),
):
    """Volume ratios diffuse towards those of the nodes; within the bore towards the space that there is."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        away = position[p] - piston.exit[piston.row[0]]
        within = away[0] * away[0] + away[1] * away[1] < piston.bore * piston.bore
        target = float(0.0)
        if held[p] == FREE and within and away[2] + piston.rise > REACHED * grid.dx[2]:
            target = room_of(grid, world, position[p], mass[p] / volume[p], table, moving)
        else:
            target = mean_of_nodes(grid, world, position[p], False, table, nodes)[0]
        part = DIFFUSION * dt[world] * phases[world, phase_of[p]].wave_speed * grid.inv_dx[0]
        volume_ratio[p] = volume_ratio[p] + wp.min(part, 1.0) * (target - volume_ratio[p])


class Held:
    """The body of a scene, and its launches."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, slots: int) -> None:
        """`slots` are the blocks of the grid that can be active."""
        self.scene, self.pool, self.grid = scene, pool, grid
        self.reach = REACH * max(grid.dx)
        self.tool = tool_of(scene, self.reach + scene.spacing)
        with wp.ScopedDevice(scene.device):
            self.nodes = wp.zeros(64 * slots, dtype=wp.vec4)
            self._nobody = wp.zeros(1, dtype=int)

    def reflect(self, dt: wp.array, table: wp.array, raw: wp.array) -> None:
        """Enqueue: add what is seen in the body to momenta and masses of nodes."""
        pool, launch = self.pool, self.scene.crew.launch
        matter = [pool.phase, pool.held, pool.position, pool.velocity, pool.affine, pool.mass, pool.volume]
        body = [self.grid, self.tool, self.reach, pool.capacity, pool.count, dt, self.scene.phases]
        launch(reflect, pool.size, [*body, *matter, pool.volume_ratio, table], [raw])

    def keep_out(self, table: wp.array, block_of: wp.array, active: wp.array, homes: Any) -> None:
        pool, outdated = self.pool, self._nobody if homes is None else homes.outdated
        self.scene.crew.launch(
            keep_out,
            pool.size,
            [self.grid, self.tool, pool.capacity, pool.count, pool.held],
            [pool.position, table, block_of, active, outdated, pool.fault],
        )

    def level(self, table: wp.array, piston: Any, moving: wp.array) -> None:
        """Enqueue: volume ratios diffuse, by way of `nodes`, which are empty."""
        pool, scene = self.pool, self.scene
        matter = [self.grid, pool.capacity, pool.count]
        scene.crew.launch(
            spread, pool.size, [*matter, pool.position, pool.volume, pool.volume_ratio, table], [self.nodes]
        )
        inputs = [*matter, scene.dt, scene.phases, pool.phase, pool.position, pool.mass, pool.volume, pool.held]
        inputs += [piston, table, self.nodes, moving]
        scene.crew.launch(level, pool.size, inputs, [pool.volume_ratio])

    def footprint(self) -> dict[str, int]:
        return {"tool.nodes": self.nodes.capacity} | table_of(self.tool)
