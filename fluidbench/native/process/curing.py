"""Curing on the device: each particle moves along the levels of its material's schedule as it ages.

The phase table has a row for each level of cure (Material.levels); a particle's level follows from its age alone, so it
is the same for every method, time step and batch of emission. How stress carries over is the method's own matter
(Solver.harden): curing does no work.
"""

from collections.abc import Callable

import numpy as np
import warp as wp

from ...method.frame import CARRIED
from ..clock import Hours
from ..crew import index_of
from ..pool import Pool
from ..scene import Scene
from .chance import Chance, chance_of, uniform

wp.set_module_options({"enable_backward": False})


@wp.kernel
def due_levels(
    share: wp.vec3i,
    hours: Hours,
    jitter: float,
    chance: Chance,
    level_ages: wp.array(dtype=float),
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    birth_time: wp.array(dtype=float),
    origin: wp.array(dtype=int),
    phase: wp.array(dtype=int),
    # outputs
    due: wp.array(dtype=int),
):
    """The level that each particle is due at its age; it never goes back."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        level = phase[i]
        if held[i] != CARRIED:
            age = hours.time[hours.row[0]] - birth_time[i] + jitter * (2.0 * uniform(chance, origin[i], 0, 0) - 1.0)
            while level < level_ages.shape[0] and level_ages[level] <= age:
                level += 1
        due[i] = level


class Curing:
    """Moves a pool along the schedule of its scenario's material, once a tick; `harden` is the solver's."""

    def __init__(self, scene: Scene, pool: Pool, harden: Callable[[wp.array], None]) -> None:
        cure = scene.scenario.material.cure
        assert cure is not None
        self.scene, self.pool, self.harden = scene, pool, harden
        self.jitter, self.chance = cure.jitter, chance_of(scene.scenario.seed, "curing")
        ages = np.minimum(cure.level_ages(), 1e30).astype(np.float32)
        with wp.ScopedDevice(scene.device):
            self.level_ages = wp.array(ages, dtype=float)
            self.due = wp.zeros(pool.size, dtype=int)

    def ripen(self) -> None:
        """Enqueue: every particle to the level of its age at the hour of the clock."""
        pool, scene = self.pool, self.scene
        scene.crew.launch(
            due_levels,
            pool.size,
            [
                scene.clock.hours,
                self.jitter,
                self.chance,
                self.level_ages,
                pool.capacity,
                pool.count,
                pool.held,
                pool.birth_time,
                pool.origin,
                pool.phase,
            ],
            [self.due],
        )
        self.harden(self.due)

    def advance(self, now: float) -> None:
        """The same at any time `now` [s]."""
        self.scene.clock.set(now, self.scene.clock.tick)
        self.ripen()

    def footprint(self) -> dict[str, int]:
        return {name: getattr(self, name).capacity for name in ("level_ages", "due")}
