"""The transfers of MPM on the CPU, block by block: what they allocate, and their launches."""

import warp as wp

from fluidbench.native.crew import put
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .grid import Grid
from .homes import PATCH, Homes, enrol, find_homes
from .patches import add_up, gather, resist, scatter


class ByBlock:
    """What the block-wise transfers allocate, and their launches; for one thread of the CPU or several."""

    def __init__(self, scene: Scene, pool: Pool, strains: list[wp.array], slots: int, resists: bool) -> None:
        """`strains` are the fields of the pool that a step strains; `resists`: whether viscosity is implicit."""
        self.strains = strains
        self.scene, self.pool, self.launch, self.lanes = scene, pool, scene.crew.launch, scene.crew.threads
        homes = self.homes = Homes()
        with wp.ScopedDevice(scene.device):
            homes.total, homes.outdated = wp.zeros(1, dtype=int), wp.ones(1, dtype=int)
            homes.slot, homes.first, homes.number = (wp.zeros(slots, dtype=int) for _ in range(3))
            homes.members, homes.of_particle = (wp.zeros(pool.size, dtype=int) for _ in range(2))
            homes.of_slot = wp.zeros(slots, dtype=int)
            homes.patch = wp.empty(slots * PATCH, dtype=wp.vec4)
            self.given = wp.empty(pool.size if resists else 0, dtype=wp.mat33)

    def prepare(self) -> None:
        for kernel in (find_homes, scatter):
            self.scene.crew.load(kernel.module)

    def refresh(self) -> None:
        self.launch(put, 1, [1, self.homes.outdated])

    def p2g(
        self,
        grid: Grid,
        table: wp.array,
        block_of: wp.array,
        active: wp.array,
        dt: wp.array,
        drags: int,
        anew: float,
        bent: wp.array,
        raw: wp.array,
    ) -> None:
        """Find homes anew where particles have moved to others; then scatter, and add up."""
        pool, scene = self.pool, self.scene
        wp.capture_if(self.homes.outdated, on_true=lambda: self._enrol(grid, table))
        self.launch(
            scatter,
            self.lanes,
            [
                self.lanes,
                grid,
                pool.capacity,
                self.homes,
                dt,
                drags,
                anew,
                scene.phases,
                pool.position,
                pool.velocity,
                pool.affine,
                pool.mass,
                pool.volume,
                pool.phase,
                pool.held,
                bent,
            ],
            self.strains,
        )
        self.launch(add_up, self.lanes, [self.lanes, grid, active, block_of, table, self.homes], [raw])

    def resist(
        self, grid: Grid, table: wp.array, block_of: wp.array, active: wp.array, nodes: wp.array, image: wp.array
    ) -> None:
        """image += dt A v (implicit.py), with v the velocities of the nodes."""
        pool, scene = self.pool, self.scene
        matter = [pool.phase, pool.position, pool.volume, pool.volume_ratio]
        self.launch(
            resist,
            self.lanes,
            [self.lanes, grid, pool.capacity, self.homes, scene.dt, scene.phases, *matter, nodes, table, block_of],
            [self.given],
        )
        self.launch(add_up, self.lanes, [self.lanes, grid, active, block_of, table, self.homes], [image])

    def _enrol(self, grid: Grid, table: wp.array) -> None:
        pool = self.pool
        self.launch(
            find_homes,
            pool.size,
            [grid, pool.capacity, pool.count, pool.position, table, self.homes],
            [pool.fault],
        )
        self.launch(enrol, 1, [pool.size, self.homes])

    def g2p(
        self,
        grid: Grid,
        moves: float,
        moving: wp.array,
        shifting: float,
        table: wp.array,
        block_of: wp.array,
        active: wp.array,
    ) -> None:
        pool, scene = self.pool, self.scene
        self.launch(
            gather,
            self.lanes,
            [
                self.lanes,
                grid,
                pool.capacity,
                self.homes,
                scene.dt,
                moves,
                moving,
                scene.phases,
                pool.phase,
                pool.held,
                shifting,
            ],
            [
                pool.position,
                pool.velocity,
                pool.affine,
                pool.volume_ratio,
                table,
                block_of,
                active,
                pool.fault,
            ],
        )

    def footprint(self) -> dict[str, int]:
        given = {"given": self.given.capacity} if self.given.size else {}
        return {f"homes.{name}": getattr(self.homes, name).capacity for name in Homes.vars} | given
