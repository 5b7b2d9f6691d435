"""Substeps of MPM that follow each other on a GPU with nothing in between.

A particle that has taken from the nodes gives at once for the next substep, while all of it is at hand (Wang et al.
2020, ACM TOG 39:30): to other nodes than those it takes from, which the grid has emptied meanwhile. So a substep is two
launches instead of four. Slots that are drawn on the way must be empty, whatever they held before: so where blocks get
other slots, all nodes are emptied first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from fluidbench.native.crew import BLOCK
from fluidbench.native.scene import Phase

from .grid import Grid
from .particle import EXPLICIT
from .transfers import give, take

if TYPE_CHECKING:
    from .solver import SolverMPM

wp.set_module_options({"enable_backward": False, "fast_math": True})

SHARING = 3  # blocks that shall share a multiprocessor: what registers a thread may use


@wp.kernel(launch_bounds=(BLOCK, SHARING))
def g2p2g(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    moving: wp.array(dtype=wp.vec4),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    shifting: float,
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    raw: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Every particle takes, and gives for the next substep."""
    p = wp.tid()
    world = p / capacity
    on = p - world * capacity < count[world]
    if not on:
        p = world * capacity  # threads of a warp stay together
    phase = phases[world, phase_of[p]]
    if on:
        take(
            grid, world, dt[world], 1.0, moving, phase, p, held, shifting,
            position, velocity, affine, volume_ratio, table, block_of, active, fault,
        )  # fmt: skip
    give(
        grid, world, dt[world], EXPLICIT, 1.0, phase, p, on, position, velocity, affine, mass, volume, held,
        affine,  # nothing has been bent: it is not read
        table, volume_ratio, elastic_normal, elastic_shear, plastic, raw, fault,
    )  # fmt: skip


class Chain:
    """What chaining allocates, and its launches."""

    def __init__(self, solver: SolverMPM) -> None:
        self.solver = solver
        self.other = wp.zeros_like(solver.raw)

    def prepare(self) -> None:
        self.solver.scene.crew.load(__name__)

    def refresh(self) -> None:
        """Enqueue, before blocks get other slots."""
        for nodes in (self.solver.raw, self.other):
            self.solver.empty(nodes)

    def go(self, substeps: int) -> None:
        """Enqueue so many substeps."""
        solver = self.solver
        here, there = solver.raw, self.other
        solver.clear_grid()
        solver.p2g()
        for _ in range(substeps - 1):
            solver.walled(here, solver.scene.force, solver.piston, solver.moving, there)
            self._take_and_give(there)
            here, there = there, here
        solver.walled(here, solver.scene.force, solver.piston, solver.moving)
        solver.gather(1, 1.0)

    def _take_and_give(self, nodes: wp.array) -> None:
        solver, scene, pool = self.solver, self.solver.scene, self.solver.pool
        solver.backend.launch(
            g2p2g,
            pool.size,
            [
                solver.grid,
                pool.capacity,
                pool.count,
                scene.dt,
                solver.moving,
                scene.phases,
                pool.phase,
                pool.held,
                solver.shifting,
                pool.mass,
                pool.volume,
            ],
            [pool.position, pool.velocity, pool.affine, *solver.strains, nodes, *solver.blocks, pool.fault],
        )

    def footprint(self) -> dict[str, int]:
        return {"other": self.other.capacity}
