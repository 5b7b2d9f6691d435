"""Expansion on the device: rest volumes that grow, and parents that become children.

Growth gives each particle a rate for the coming tick; methods let the rest volume follow it in every substep. Offspring
come at ticks (births.py): spawned, or by splitting what has outgrown the discretisation.
"""

import numpy as np
import warp as wp

from ...method.frame import CARRIED
from ...scenario.expansion import LARGEST, Expansion
from ..clock import Hours
from ..crew import index_of
from ..pool import Pool
from ..scene import Scene
from .births import FIRST_DRAW, BirthLaw, conceive, deliver, inherit
from .chance import Chance, chance_of, uniform
from .room import CANDIDATES, VIEW, crowd, take_room

wp.set_module_options({"enable_backward": False})

OVERDUE = 0.1  # of its volume: how much a particle may outgrow LARGEST before it splits, for the host waits for births


@wp.kernel
def growth_rates(
    share: wp.vec3i,
    hours: Hours,
    ratio: float,
    delay: float,
    jitter: float,
    time: float,
    chance: Chance,
    ancestors: int,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    birth_time: wp.array(dtype=float),
    origin: wp.array(dtype=int),
    # outputs
    growth: wp.array(dtype=float),
):
    """Mean of d ln R / dt [1/s] over the coming tick; children keep their ancestor's clock."""
    i = index_of(share, wp.tid())
    now, tick = hours.time[hours.row[0]], hours.tick
    if i % capacity < count[i / capacity]:
        rate = float(0.0)
        if held[i] != CARRIED:
            start = birth_time[i] + delay + jitter * (2.0 * uniform(chance, origin[i] % ancestors, 0, 0) - 1.0)
            end = wp.max(now + tick - start, 0.0)
            begin = wp.max(now - start, 0.0)
            left, after = wp.exp(-begin / time), wp.exp(-end / time)
            step = (end - begin) / time
            gained = left - after
            if step < 0.01:  # float32 would cancel, here and below
                gained = left * step * (1.0 - 0.5 * step)
            gain = (ratio - 1.0) * gained / (1.0 + (ratio - 1.0) * (1.0 - left))
            rate = wp.log(1.0 + gain) / tick
            if gain < 1.0e-3:
                rate = gain * (1.0 - 0.5 * gain) / tick
        growth[i] = rate


class Growing:
    """Expands a pool by its scenario's schedule, once a tick.

    `ancestors` is how many particles the scenario has without offspring, `generations` how often one of them may give
    birth. Raises OutOfCapacity when children find no room.
    """

    def __init__(self, scene: Scene, pool: Pool, ancestors: int, generations: int) -> None:
        model = scene.scenario.material.expansion
        assert model is not None
        self.scene, self.pool, self.model = scene, pool, model
        self.chance = chance_of(scene.scenario.seed, "expansion")
        self.ancestors = ancestors
        self.law = self._birth_law(model, generations)
        self.births = model.kind == "spawn" or model.split
        self.every = self._ticks_between(scene.scenario.schedule[0])
        if model.kind == "growth":
            pool.add_field("growth", float)
        if self.births:
            pool.add_field("generation", int)
            with wp.ScopedDevice(scene.device):
                self.offspring_count = wp.zeros(pool.size, dtype=int)
                self.parent = wp.zeros(pool.size, dtype=int)
                self.number = wp.zeros(pool.size, dtype=int)
                self.born = wp.zeros(pool.worlds + 1, dtype=int)
                self.old = wp.zeros(pool.worlds, dtype=int)
                self.halfway = wp.zeros(pool.size * self.law.splits, dtype=wp.vec3)
                self.splitting = wp.zeros(pool.size * self.law.splits, dtype=int)
                self.room = wp.HashGrid(64, 64, 64) if self.law.splits else None

    def _ticks_between(self, tick: float) -> int:
        """Ticks from births to births: what grows may be late with its halves, what spawns may not."""
        if self.model.kind == "spawn":
            return 1
        fastest = (self.model.ratio - 1.0) / self.model.time  # d ln R / dt as growth begins
        return max(1, int(OVERDUE / max(fastest * tick, 1e-3)))

    def due(self, tick: int) -> bool:
        """Whether there may be births at the start of the tick of this number."""
        return self.births and tick % self.every == 0

    def _birth_law(self, model: Expansion, generations: int) -> BirthLaw:
        d = self.scene.spacing
        law = BirthLaw()
        law.splits = int(model.kind == "growth")
        law.ratio = 1.0 if model.kind == "growth" else model.per_pass
        law.delay, law.jitter, law.interval = model.delay, model.jitter, model.interval
        law.passes, law.limit, law.spacing = generations, LARGEST * d**3, d
        law.radius, law.impulse, law.noise = model.radius, model.impulse, model.noise
        law.margin, law.first_range = model.margin * d, self.ancestors
        return law

    def grow(self) -> None:
        """Enqueue the rates for the tick that begins at the hour of the clock."""
        pool, model = self.pool, self.model
        if model.kind == "growth":
            self.scene.crew.launch(
                growth_rates,
                pool.size,
                [
                    self.scene.clock.hours,
                    model.ratio,
                    model.delay,
                    model.jitter,
                    model.time,
                    self.chance,
                    self.ancestors,
                    pool.capacity,
                    pool.count,
                    pool.held,
                    pool.birth_time,
                    pool.origin,
                ],
                [pool.growth],
            )

    def advance(self, now: float, tick: float) -> None:
        """Rates for a tick of any length [s] from `now` [s], and the children that are due then."""
        self.scene.clock.set(now, tick)
        self.grow()
        self.give_birth(now)

    def give_birth(self, now: float) -> bool:
        """The children that are due at `now` [s], and whether there are any: how many decides the device, so that the
        host must wait for it."""
        if not self.births:
            return False
        pool, launch = self.pool, self.scene.crew.launch
        self.born.zero_()
        launch(
            conceive,
            pool.size,
            [
                now,
                self.law,
                self.chance,
                pool.capacity,
                pool.count,
                pool.held,
                pool.birth_time,
                pool.origin,
                pool.volume,
                pool.generation,
            ],
            [self.offspring_count, self.born, self.parent, self.number, self.splitting],
        )
        *each, parents = self.born.numpy().tolist()
        if not parents:
            return False
        pool.stale = True  # a parent moves even with a single child
        born = np.array(each)
        for world in range(pool.worlds):
            pool.need(world, int(born[world]))
        self.find_room(parents)
        self.old.assign(np.array(pool.counts, np.int32))
        if born.any():
            launch(
                inherit,
                (pool.worlds, int(born.max())),
                [self.old, self.born, pool.capacity, pool.size, self.parent, pool.memory],
            )
            for world in range(pool.worlds):
                pool.set_count(world, pool.counts[world] + int(born[world]))
        launch(
            deliver,
            pool.size,
            [
                self.law,
                self.chance,
                self.scene.box,
                pool.capacity,
                pool.count,
                self.old,
                self.parent,
                self.number,
                self.offspring_count,
                self.halfway,
            ],
            [pool.position, pool.velocity, pool.mass, pool.volume, pool.origin, pool.generation],
        )
        return True

    def find_room(self, parents: int) -> None:
        """Where the halves of what splits now will lie, of so many."""
        if self.room is None:
            return
        pool, launch, view = self.pool, self.scene.crew.launch, VIEW * self.scene.spacing
        family = [self.splitting, pool.origin, pool.generation, pool.volume]
        crowding = wp.empty((parents, CANDIDATES), dtype=float, device=self.scene.device)
        for world, count in enumerate(pool.counts):
            position = pool.position[world * pool.capacity : world * pool.capacity + count]
            self.room.build(position, view)
            place = [self.room.id, self.chance, int(FIRST_DRAW), self.scene.box, view, world, pool.capacity]
            launch(crowd, crowding.shape, [*place, *family, position], [crowding])
        launch(take_room, parents, [self.chance, int(FIRST_DRAW), *family, crowding], [self.halfway])

    def footprint(self) -> dict[str, int]:
        names = ("offspring_count", "parent", "number", "born", "old", "halfway", "splitting") if self.births else ()
        return {name: getattr(self, name).capacity for name in names}
