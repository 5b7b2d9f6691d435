"""Births on the device: how many children a particle has, where they lie, how fast they are, whose they are.

A parent becomes the first of its children, the others take free slots and inherit every field of the pool; mass is
split evenly and momentum stays. What a child is depends on its parent's identity and on the scenario's seed alone, but
where halves lie on the room that there is, too (room.py).
"""

import warp as wp

from ...method.frame import CARRIED
from ..pool import Memory
from ..scene import PERIODIC, Box
from .chance import Chance, direction, uniform

wp.set_module_options({"enable_backward": False})

FIRST_DRAW = wp.constant(8)  # draws of a child: direction (2), distance, noise (3)
PER_CHILD = wp.constant(8)
INSIDE = wp.constant(0.25)  # least distance of a child from a wall, over the spacing


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
    splitting: wp.array(dtype=int),
):
    """How many children each particle has now, 0 for none; all but the first get a place at the end of the pool. `born`
    counts them by world, and after these the parents, of whom those that split are listed in `splitting`."""
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
        if children > 0:
            place_among_parents = wp.atomic_add(born, born.shape[0] - 1, 1)
            if law.splits == 1:
                splitting[place_among_parents] = i
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
    size: int,
    parent: wp.array(dtype=int),
    memory: Memory,
):
    """Copy every field from parents to their new children."""
    world, i = wp.tid()
    if i < born[world]:
        slot = world * capacity + old[world] + i
        for field in range(memory.width.shape[0]):
            width = memory.width[field]
            words = wp.array(ptr=memory.address[field], shape=(size * width,), dtype=wp.int32)
            for k in range(width):
                words[slot * width + k] = words[parent[slot] * width + k]


@wp.func
def offset_of(law: BirthLaw, chance: Chance, parent: int, generation: int, c: int, edge: float, way: wp.vec3):
    """Where child c would like to be from the centre of its parent [m], and its noise [m/s]; before means are taken."""
    if law.splits == 1:
        return (1.0 - 2.0 * float(c)) * way, wp.vec3(0.0, 0.0, 0.0)
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
    halfway: wp.array(dtype=wp.vec3),
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
            way = wp.vec3(0.0, 0.0, 0.0)
            if law.splits == 1:
                way = halfway[ancestor]
            mean_place, mean_noise = wp.vec3(0.0, 0.0, 0.0), wp.vec3(0.0, 0.0, 0.0)
            for other in range(children):
                place, noise = offset_of(law, chance, who, age, other, edge, way)
                mean_place += place / float(children)
                mean_noise += noise / float(children)
            place, noise = offset_of(law, chance, who, age, c, edge, way)
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
