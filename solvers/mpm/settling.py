"""Porous matter of MPM settles: what its volume ratios do not know of, its nodes tell.

What rolls over at a front stays a few tenths of a cell above the floor, and the gap is carried on beneath what follows;
volume ratios, which come of strain, call full what is porous. A puddle 5 to 15 % too thick is pushed out by the weight
of air. So every sixteenth tick, where matter flows, J goes towards the room that there is, as fast as crowds part:

    J += min(shifting |2 dev D| dt, 1) heard (room - J -+ margin)      where |room - J| > margin
    room = sum of w / phi, phi the share of a node's space that V0 fills
    heard = 2 min(phi) - 1 within 0 and 1: nothing beside a free surface, whose nodes are half full
    margin = 0.02 max((2 / r)^1.5, 1) + 0.9 |dx grad(phi)|, r the grid ratio

What is porous so carries no pressure, and what lies on it presses it together. The margin leaves alone what is known to
be full: weakly compressible matter may be 1 % denser than at rest; what a node tells scatters the more, the fewer
particles share it; and what lies below a flat free surface lacks, by the two splines between a particle and its
neighbours, at most 0.5 / 0.564 of what its slope tells. V0 has grown where matter has: this holds for foam, too.
"""

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Phase, Scene

from ..backends import Warp
from ..flow import flows, shear_rate
from .grid import Grid, clear_grid
from .nodes import room_of, tell_nodes

wp.set_module_options({"enable_backward": False, "fast_math": True})

TURNS = 4  # of separation for one of settling, which costs as much as a substep
COMPRESSED = wp.constant(0.02)  # of J: twice what a sound speed of ten times the flow's leaves
SURFACE = wp.constant(0.9)  # what a flat free surface lacks at most, over |dx grad(phi)|


@wp.kernel
def fill(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    table: wp.array(dtype=int),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """The share of the space of each node that particles fill at rest, fourth of nodes that are empty."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world]:
        row = wp.vec4(0.0, 0.0, 0.0, volume[p] * grid.inv_volume)
        tell_nodes(grid, world, position[p], False, row, table, nodes)


@wp.kernel
def settle(
    share: wp.vec3i,
    grid: Grid,
    rate: float,
    compressed: float,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    dt: wp.array(dtype=float),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    # outputs
    volume_ratio: wp.array(dtype=float),
):
    """Volume ratios of free particles that flow towards their room; `rate` is that of settling, over shear, times the
    time between calls [s], `compressed` the margin of what has no slope."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and held[p] == FREE:
        phase = phases[world, phase_of[p]]
        if flows(phase, affine[p], elastic_normal[p], elastic_shear[p], dt[world], p, plastic):
            room, least, slope = room_of(grid, world, position[p], 1.0, table, nodes)
            lacking = room - volume_ratio[p]
            margin = compressed + SURFACE * slope
            heard = wp.clamp(2.0 * least - 1.0, 0.0, 1.0) * wp.min(rate * shear_rate(affine[p]), 1.0)
            volume_ratio[p] = volume_ratio[p] + heard * (lacking - wp.clamp(lacking, -margin, margin))


class Settling:
    """The launches of settling, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, plastic: wp.array, rate: float) -> None:
        """`plastic`: strains, see flow.py; `rate`: of settling over that of shear, times the ticks between calls."""
        self.scene, self.pool, self.grid = scene, pool, grid
        self.elastic = [pool.elastic_normal, pool.elastic_shear, plastic]
        self.rate = rate * scene.clock.tick
        self.compressed = COMPRESSED * max(2.0 * scene.spacing / min(grid.dx), 1.0) ** 1.5
        self.backend = Warp(scene.crew)

    def prepare(self) -> None:
        for module in (__name__, clear_grid.module):
            self.scene.crew.load(module)

    def settle(self, table: wp.array, active: wp.array, nodes: wp.array, lanes: int) -> None:
        """Enqueue: settle, by way of `nodes`; `lanes` are the threads that empty them."""
        pool, scene, launch = self.pool, self.scene, self.backend.launch
        some = [pool.capacity, pool.count]
        matter = [pool.phase, pool.held, pool.position, pool.affine, *self.elastic, scene.dt]
        launch(clear_grid, lanes, [active, lanes], [nodes])
        launch(fill, pool.size, [self.grid, *some, pool.position, pool.volume, table], [nodes])
        inputs = [self.grid, self.rate, self.compressed, *some, scene.phases, *matter, table, nodes]
        launch(settle, pool.size, inputs, [pool.volume_ratio])
