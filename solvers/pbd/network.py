"""The bonds of a pool: what is allocated for them, and the passes that use them (bonds.py)."""

from types import SimpleNamespace
from typing import Any

import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from ..backends import Backend
from .bonds import ROOM, TEAM, Bonds, relieve


class Network:
    """The bonds of a pool: what is allocated for them and the passes that use them."""

    def __init__(self, scene: Scene, pool: Pool, backend: Backend, kernels: SimpleNamespace) -> None:
        self.scene, self.pool, self.backend, self.kernels = scene, pool, backend, kernels
        self.bonds = Bonds()
        self.threads = TEAM if backend.name == "warp" and not scene.device.is_cpu else 1
        with wp.ScopedDevice(scene.device):
            self.bonds.number = wp.zeros(pool.size, dtype=int)
            self.bonds.partner = wp.zeros(pool.size * ROOM, dtype=int)
            self.bonds.rest = wp.zeros(pool.size * ROOM, dtype=float)
            self.bonds.multiplier = wp.zeros(pool.size * ROOM, dtype=float)
            self.bonds.state = wp.zeros(pool.size, dtype=int)

    def bind(self, lists: Any) -> None:
        pool, scene = self.pool, self.scene
        common = [scene.box, scene.spacing]
        self.backend.launch(
            self.kernels.awaken,
            pool.size,
            [*common, pool.capacity, pool.count, scene.phases, pool.phase, pool.position, self.bonds],
            [pool.held, pool.velocity],
        )
        self.backend.launch(
            self.kernels.bind,
            pool.size,
            [*common, lists, pool.capacity, pool.count, pool.position, self.bonds],
            [pool.fault],
        )

    def stretch(self, sweep: int, correction: wp.array) -> None:
        pool, scene = self.pool, self.scene
        self.backend.launch(
            self.kernels.stretch,
            pool.size * self.threads,
            [
                self.threads,
                scene.box,
                scene.spacing,
                sweep,
                pool.capacity,
                pool.count,
                scene.dt,
                scene.phases,
                pool.phase,
                pool.held,
                pool.position,
                pool.mass,
                self.bonds,
            ],
            [correction],
        )

    def relieve(self, due: wp.array) -> None:
        pool, scene = self.pool, self.scene
        scene.crew.launch(
            relieve,
            pool.size,
            [pool.capacity, pool.count, scene.box, scene.phases, pool.phase, due, pool.position, self.bonds],
        )

    def flow(self) -> None:
        pool, scene = self.pool, self.scene
        self.backend.launch(
            self.kernels.yield_bonds,
            pool.size,
            [pool.capacity, pool.count, scene.box, scene.phases, pool.phase, pool.position, self.bonds],
        )

    def carried(self) -> dict[str, Any]:
        return {f"bonds.{name}": getattr(self.bonds, name) for name in Bonds.vars}

    def footprint(self) -> dict[str, int]:
        return {f"bonds.{name}": getattr(self.bonds, name).capacity for name in Bonds.vars}
