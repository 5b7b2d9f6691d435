"""Expansion on the device: rest volumes that grow, and parents that become children.

Growth gives each particle a rate for the coming tick; methods let the rest volume follow it in every substep. Offspring
come at ticks: spawned, or by splitting what has outgrown the discretisation. A parent becomes the first of its
children, the others take free slots and inherit every field of the pool; mass is split evenly and momentum stays.
What a child is depends on its parent's identity (`origin`) and on the scenario's seed alone.
"""

from typing import Any

import numpy as np
import warp as wp

from ...method.frame import CARRIED
from ...scenario.expansion import LARGEST, Expansion
from ..clock import Hours
from ..crew import index_of
from ..pool import Pool
from ..scene import PERIODIC, Box, Scene
from .chance import Chance, chance_of, direction, uniform

wp.set_module_options({"enable_backward": False})

FIRST_DRAW = wp.constant(8)  # draws of a child: direction (2), distance, noise (3)
PER_CHILD = wp.constant(8)
INSIDE = wp.constant(0.25)  # least distance of a child from a wall, over the spacing
APART = wp.constant(0.25)  # where the halves of a split lie from its centre, over the edge of its volume


@wp.struct
class BirthLaw:
    """How one birth of offspring goes."""

    ratio: float  # volume ratio of a pass; 1 when splitting
    splits: int  # 1 when splitting in two
    delay: float
    jitter: float
    interval: float
    passes: int  # births of a particle, at most
    limit: float  # volume beyond which a particle splits [m^3]
    spacing: float
    radius: float  # of the ball, over the edge of the expanded volume
    impulse: float
    noise: float
    margin: float  # height above the floor [m]
    first_range: int  # identities in use before the first generation


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


@wp.kernel
def conceive(
    now: float,
    law: BirthLaw,
    chance: Chance,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    birth_time: wp.array(dtype=float),
    origin: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    generation: wp.array(dtype=int),
    # outputs
    offspring_count: wp.array(dtype=int),
    born: wp.array(dtype=int),
    parent: wp.array(dtype=int),
    number: wp.array(dtype=int),
):
    """How many children each particle has now, 0 for none; all but the first get a place at the end of the pool."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        children = int(0)
        if held[i] != CARRIED:
            if law.splits == 1:
                if volume[i] > law.limit and generation[i] < law.passes:
                    children = 2
            elif generation[i] < law.passes:
                draw = uniform(chance, origin[i] % law.first_range, 0, 0)
                start = birth_time[i] + law.delay + law.jitter * (2.0 * draw - 1.0)
                if now >= start + float(generation[i]) * law.interval:
                    whole = wp.floor(law.ratio)
                    children = int(whole)
                    if uniform(chance, origin[i], generation[i], 1) < law.ratio - whole:
                        children += 1
        offspring_count[i] = children
        if children > 1:
            place = wp.atomic_add(born, world, children - 1)
            for c in range(1, children):
                slot = count[world] + place + c - 1
                if slot < capacity:
                    parent[world * capacity + slot] = i
                    number[world * capacity + slot] = c


@wp.kernel
def inherit(
    old: wp.array(dtype=int),
    born: wp.array(dtype=int),
    capacity: int,
    parent: wp.array(dtype=int),
    # outputs
    field: wp.array(dtype=Any),  # type: ignore[valid-type]
):
    """Copy a field from parents to their new children."""
    world, i = wp.tid()
    if i < born[world]:
        slot = world * capacity + old[world] + i
        field[slot] = field[parent[slot]]


@wp.func
def offset_of(law: BirthLaw, chance: Chance, parent: int, generation: int, children: int, c: int, edge: float):
    """Where child c would like to be from the centre of its parent [m], and its noise [m/s]; before means are taken."""
    if law.splits == 1:
        side = 1.0 - 2.0 * float(c)
        return (side * APART * edge) * direction(chance, parent, generation, FIRST_DRAW), wp.vec3(0.0, 0.0, 0.0)
    draw = FIRST_DRAW + PER_CHILD * c
    reach = wp.pow(uniform(chance, parent, generation, draw + 2), 1.0 / 3.0)
    out = (law.radius * edge * reach) * direction(chance, parent, generation, draw)
    return out, law.noise * direction(chance, parent, generation, draw + 3)


@wp.kernel
def deliver(
    law: BirthLaw,
    chance: Chance,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    old: wp.array(dtype=int),
    parent: wp.array(dtype=int),
    number: wp.array(dtype=int),
    offspring_count: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    origin: wp.array(dtype=int),
    generation: wp.array(dtype=int),
):
    """Give every child, the parent's own slot included, its place, velocity, share and identity. New slots hold copies
    of their parent's fields."""
    i = wp.tid()
    world = i / capacity
    local = i - world * capacity
    if local < count[world]:
        ancestor = i
        c = int(0)
        if local >= old[world]:
            ancestor = parent[i]
            c = number[i]
        children = offspring_count[ancestor]
        if children > 0:
            who, age = origin[i], generation[i]
            edge = wp.pow(volume[i] * law.ratio, 1.0 / 3.0)
            mean_place, mean_noise = wp.vec3(0.0, 0.0, 0.0), wp.vec3(0.0, 0.0, 0.0)
            for other in range(children):
                place, noise = offset_of(law, chance, who, age, children, other, edge)
                mean_place += place / float(children)
                mean_noise += noise / float(children)
            place, noise = offset_of(law, chance, who, age, children, c, edge)
            out = place - mean_place
            x = position[i] + out
            velocity[i] = velocity[i] + (noise - mean_noise) + (law.impulse / (law.radius * edge)) * out
            for axis in range(3):
                if box.lower_kind[axis] != PERIODIC:
                    low = box.lower[axis] + INSIDE * law.spacing
                    if axis == 2 and law.splits == 0:
                        low = box.lower[axis] + law.margin
                    x[axis] = wp.clamp(x[axis], low, box.upper[axis] - INSIDE * law.spacing)
                else:
                    length = box.upper[axis] - box.lower[axis]
                    x[axis] = x[axis] - length * wp.floor((x[axis] - box.lower[axis]) / length)
            position[i] = x
            mass[i] = mass[i] / float(children)
            volume[i] = volume[i] * law.ratio / float(children)
            size = law.first_range
            for _ in range(age):
                size *= most_children(law)
            origin[i] = who + c * size
            generation[i] = age + 1


@wp.func
def most_children(law: BirthLaw):
    """The most children of a pass."""
    if law.splits == 1:
        return 2
    return int(wp.ceil(law.ratio))


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
        if model.kind == "growth":
            pool.add_field("growth", float)
        if self.births:
            pool.add_field("generation", int)
            with wp.ScopedDevice(scene.device):
                self.offspring_count = wp.zeros(pool.size, dtype=int)
                self.parent = wp.zeros(pool.size, dtype=int)
                self.number = wp.zeros(pool.size, dtype=int)
                self.born = wp.zeros(pool.worlds, dtype=int)
                self.old = wp.zeros(pool.worlds, dtype=int)

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

    def give_birth(self, now: float) -> None:
        """The children that are due at `now` [s]: how many decides the device, so that the host must wait for it."""
        if not self.births:
            return
        pool, device = self.pool, self.scene.device
        self.born.zero_()
        wp.launch(
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
            [self.offspring_count, self.born, self.parent, self.number],
            device=device,
        )
        born = self.born.numpy()
        if not born.any() and self.model.kind == "growth":
            return
        for world in range(pool.worlds):
            pool.need(world, int(born[world]))
        self.old.assign(np.array(pool.counts, np.int32))
        if born.any():
            for field in pool.fields.values():
                wp.launch(
                    inherit,
                    (pool.worlds, int(born.max())),
                    [self.old, self.born, pool.capacity, self.parent],
                    [field],
                    device=device,
                )
            for world in range(pool.worlds):
                pool.set_count(world, pool.counts[world] + int(born[world]))
        wp.launch(
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
            ],
            [pool.position, pool.velocity, pool.mass, pool.volume, pool.origin, pool.generation],
            device=device,
        )

    def footprint(self) -> dict[str, int]:
        names = ("offspring_count", "parent", "number", "born", "old") if self.births else ()
        return {name: getattr(self, name).capacity for name in names}
