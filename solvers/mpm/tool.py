"""A rigid body among the particles of MPM: its nodes are tied (tied.py), what is near it settles, nothing enters it.

Volume ratios drift apart from particle to particle where matter flows along a wall; so they diffuse, as densities do in
SPH: J += dt DIFFUSION c / dx (<J> - J), <J> that of the nodes. What they drift by together stays: along a bore, where
no free surface gives way, matter came to be packed by up to a quarter more than its J told. So what flows follows the
room that there is, by its strain, and by way of nodes:

    J += dt SETTLING |2 dev D| <heard (room - J -+ margin)>      where |room - J| > margin

heard is 0 beside free surfaces, of which a bore has none; the margin that of settling.py, but for the scatter, of which
nodes hear only the mean. What is elastic has its 2 %, too: a room that flickers as particles pass nodes shakes what no
viscosity damps, and that strains it, the more it follows. (Without any, a stiff paste blew up within 0.3 s.)

What is elastic, as pastes are, gains the volume that flows out of its space (dilation.py). Liquids follow streamlines,
and what is nearest to a wall leaves it where it turns: of what flows at s from the wall of a bore there is nothing
nearer, and past the rim it flows at some 3 s from the face. No strain tells of the gap, and a strand let go of the face
that should hold it. So shifting of liquids goes both ways here, into gaps, too; beside a free surface only towards a
bore's wall or a face (what has left these is in air: drawn on, it climbed the tip). What it takes of volume, J learns
as it settles. (Pastes that were so shifted were laid a tenth too large.)
"""

from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Phase, Scene

from ..flow import flows, shear_rate
from ..tool import Tool, distance_to, outside, table_of, tool_of
from .dilation import Dilation, untold
from .grid import Grid, first_node, node_parts, slots_of
from .nodes import follow, mean_of_nodes, room_of, tell_nodes
from .particle import contained, down_the_slope, presses_nodes, weights
from .piston import REACHED, Piston
from .settling import COMPRESSED, SURFACE
from .tied import REACH, SLANT, Blocks, Tied, leaning_out
from .transfers import sums_of

wp.set_module_options({"enable_backward": False})

NEAR = 2.5  # of the body [cells]: nodes about what is so near are tied
DIFFUSION = wp.constant(0.1)  # of J, over c dx; of densities: Antuono et al. 2010, Comput. Phys. Commun. 181:532
SETTLING = wp.constant(32.0)  # of J towards the room that there is, over the strain: with 8 a bore is 2 % too full
HALF = wp.constant(0.5)  # full: a node on a free surface


@wp.kernel
def keep_out(
    share: wp.vec3i,
    grid: Grid,
    tool: Tool,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    shift: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """What is free is shifted, and stays in front of the body, among active nodes."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and held[p] == FREE:
        before = position[p]
        position[p] = contained(grid, outside(tool, before + shift[p]))
        follow(grid, world, before, position[p], table, block_of, active, homes, fault)


@wp.func
def within_bore(grid: Grid, piston: Piston, x: wp.vec3):
    """Whether a particle at x is in a bore, and reads no nodes below its exit."""
    away = x - piston.exit[piston.row[0]]
    beside = away[0] * away[0] + away[1] * away[1] < piston.bore * piston.bore
    return beside and away[2] + piston.rise > REACHED * grid.dx[2]


@wp.func
def gathered(grid: Grid, world: int, x: wp.vec3, table: wp.array(dtype=int), moving: wp.array(dtype=wp.vec4)):
    """The sums over its nodes of a particle at x."""
    base = first_node(grid, x)
    f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    return sums_of(moving, f, wx, wy, wz, bx, by, bz, lx, ly, lz, s0, s1, s2, s3, s4, s5, s6, s7)


@wp.func
def into_gaps(
    grid: Grid,
    tool: Tool,
    reach: float,
    world: int,
    density: float,
    x: wp.vec3,
    c: wp.mat33,
    step: float,
    volume_ratio: float,
    least: float,
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
):
    """How far a free particle of a liquid is shifted into a gap [m]: down the slope of the density where
    rho J < rho0; where the `least` full of its nodes says that a free surface is near, only towards a bore's wall or a
    face."""
    by = wp.vec3(0.0, 0.0, 0.0)
    sums = gathered(grid, world, x, table, moving)
    crowding = sums[0, 3] * volume_ratio / density
    if crowding < 1.0:
        down = down_the_slope(grid, density, sums, c, step)
        if least > HALF:
            by = down
        elif crowding > HALF:
            gap, normal = distance_to(tool, x)
            _out, leaning = leaning_out(tool, x, normal)
            if gap < reach and leaning < SLANT:
                by = wp.min(wp.dot(down, normal), 0.0) * normal
    return by


@wp.kernel
def find_room(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    held: wp.array(dtype=int),
    piston: Piston,
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    room: wp.array(dtype=wp.vec2),
):
    """(the room that a particle is to have, its own if nodes tell of none; how full the least of its nodes is). In a
    bore there is room to the wall, however empty nodes are behind it: a tip may be thinner than splines reach."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        x, j = position[p], volume_ratio[p]
        found = wp.vec2(j, 0.0)
        if held[p] == FREE:
            there, least, slope = room_of(grid, world, x, mass[p] / volume[p], table, moving)
            heard = wp.clamp((least - HALF) / (1.0 - HALF), 0.0, 1.0)
            if within_bore(grid, piston, x):
                heard = 1.0
            lacking, margin = there - j, SURFACE * slope
            if phases[world, phase_of[p]].shear_modulus > 0.0:
                margin += COMPRESSED
            found = wp.vec2(j + heard * (lacking - wp.clamp(lacking, -margin, margin)), least)
        room[p] = found


@wp.kernel
def spread(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    room: wp.array(dtype=wp.vec2),
    table: wp.array(dtype=int),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """(sum of w V0 J, of w V0 times the room that particles are to have, -, sum of w V0) to nodes."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        row = volume[p] * wp.vec4(volume_ratio[p], room[p][0], 0.0, 1.0)
        tell_nodes(grid, world, position[p], False, row, table, nodes)


@wp.kernel
def level(
    share: wp.vec3i,
    grid: Grid,
    tool: Tool,
    reach: float,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    shifting: float,
    room: wp.array(dtype=wp.vec2),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    moving: wp.array(dtype=wp.vec4),
    rate: wp.array(dtype=float),
    # outputs
    volume_ratio: wp.array(dtype=float),
    shift: wp.array(dtype=wp.vec3),
):
    """Volume ratios diffuse towards those of the nodes and settle towards the room that there is. Those of what is
    elastic grow by what affine fields do not tell of, too; liquids are shifted into gaps."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        x, j, phase = position[p], volume_ratio[p], phases[world, phase_of[p]]
        mean = mean_of_nodes(grid, world, x, False, table, nodes)
        by = wp.vec3(0.0, 0.0, 0.0)
        change = wp.min(DIFFUSION * dt[world] * phase.wave_speed * grid.inv_dx[0], 1.0) * (mean[0] - j)
        moves = held[p] == FREE
        if moves:
            moves = flows(phase, affine[p], elastic_normal[p], elastic_shear[p], dt[world], p, plastic)
        if moves:
            change += wp.min(SETTLING * dt[world] * shear_rate(affine[p]), 1.0) * (mean[1] - mean[0])
        if presses_nodes(phase):
            change += j * dt[world] * untold(grid, world, x, table, moving, rate)
        elif moves:
            density, step = mass[p] / volume[p], shifting * dt[world]
            by = into_gaps(grid, tool, reach, world, density, x, affine[p], step, j, room[p][1], table, moving)
        volume_ratio[p] = j + change
        shift[p] = by


class Held:
    """The body of a scene, and its launches."""

    def __init__(
        self, scene: Scene, pool: Pool, grid: Grid, slots: int, lanes: int, plastic: Any, shifting: float
    ) -> None:
        """`slots` and `lanes`: as for Tied; `plastic`: strains, see flow.py; `shifting` is over the strain."""
        self.scene, self.pool, self.grid, self.plastic, self.shifting = scene, pool, grid, plastic, shifting
        self.near = NEAR * max(grid.dx)
        self.tool = tool_of(scene, REACH * max(grid.dx) + scene.spacing)
        self.tied = Tied(scene, grid, self.tool, slots, lanes)
        self.dilation = Dilation(scene, pool, grid, slots, lanes) if scene.elastic else None
        with wp.ScopedDevice(scene.device):
            self.nodes = wp.zeros(64 * slots, dtype=wp.vec4)
            self.room = wp.zeros(pool.size, dtype=wp.vec2)
            self.shift = wp.zeros(pool.size, dtype=wp.vec3)
            self._nobody = wp.zeros(1, dtype=int)
            self._untold = wp.zeros(1, dtype=float)

    def keep_out(self, blocks: Blocks, homes: Any) -> None:
        """Enqueue: shift what is to be shifted, and keep all in front."""
        pool, outdated = self.pool, self._nobody if homes is None else homes.outdated
        self.scene.crew.launch(
            keep_out,
            pool.size,
            [self.grid, self.tool, pool.capacity, pool.count, pool.held, self.shift],
            [pool.position, *blocks, outdated, pool.fault],
        )

    def level(self, table: wp.array, piston: Any, moving: wp.array) -> None:
        """Enqueue: volume ratios diffuse and settle, by way of `nodes`, which are empty; who is to be shifted."""
        pool, scene, launch = self.pool, self.scene, self.scene.crew.launch
        some = [pool.capacity, pool.count]
        whole = [pool.position, pool.mass, pool.volume, pool.volume_ratio, pool.held, piston, table, moving]
        launch(find_room, pool.size, [self.grid, *some, scene.phases, pool.phase, *whole], [self.room])
        shares = [pool.position, pool.volume, pool.volume_ratio, self.room, table]
        launch(spread, pool.size, [self.grid, *some, *shares], [self.nodes])
        flow = [scene.dt, scene.phases, pool.phase, pool.position, pool.affine, pool.mass, pool.volume, pool.held]
        flow += [pool.elastic_normal, pool.elastic_shear, self.plastic]
        inputs = [self.grid, self.tool, self.near, *some, *flow, self.shifting, self.room, table, self.nodes, moving]
        inputs.append(self._untold if self.dilation is None else self.dilation.rate)
        launch(level, pool.size, inputs, [pool.volume_ratio, self.shift])

    def footprint(self) -> dict[str, int]:
        names = ("nodes", "room", "shift")
        own = {f"tool.{name}": getattr(self, name).capacity for name in names}
        told = {} if self.dilation is None else self.dilation.footprint()
        return own | self.tied.footprint() | told | table_of(self.tool)
