"""Where there is room for the halves of a particle that splits.

Matter grows as its surroundings let it: a strand on a floor by its section alone, not along itself. Halves that lie
anywhere leave gaps between families then, which a method takes for matter that is denser where the families are. Of
CANDIDATES places, random ones, those are taken at which the half that sees more of others sees least. Few split at a
time: each place is a thread's.
"""

import warp as wp

from ..scene import PERIODIC, Box
from .chance import Chance, direction, uniform

wp.set_module_options({"enable_backward": False})

CANDIDATES = wp.constant(48)
# How far a half is from the centre, over the edge of the whole's volume: a quarter of what it is long. A cube is 1 edge
# long, its half 2^(1/3). Farther, a face throws its halves outwards.
NEAR, FAR = wp.constant(0.25), wp.constant(0.315)
VIEW = 1.5  # as far as a half sees others [spacings]: those beside it


@wp.func
def nearness(away: float, view: float):
    """What one sees of another: 1 where it is, 0 from `view` on."""
    q = wp.max(1.0 - away / view, 0.0)
    return q * q


@wp.func
def seen(grid: wp.uint64, position: wp.array(dtype=wp.vec3), own: int, x: wp.vec3, view: float):
    """Sum of `nearness` to all but one at the point x."""
    total = float(0.0)
    for j in wp.hash_grid_query(grid, x, view):
        if j != own:
            total += nearness(wp.length(position[j] - x), view)
    return total


@wp.func
def seen_with_images(grid: wp.uint64, position: wp.array(dtype=wp.vec3), box: Box, own: int, x: wp.vec3, view: float):
    """The same with what is beyond a face: mirror images, the point's own too, or what a periodic axis brings."""
    total = seen(grid, position, own, x, view)
    for axis in range(3):
        length = box.upper[axis] - box.lower[axis]
        for side in range(2):
            above = x[axis] - box.lower[axis]
            if side == 1:
                above = x[axis] - box.upper[axis]
            if wp.abs(above) < view:
                image = x
                if box.lower_kind[axis] == PERIODIC:
                    image[axis] = x[axis] + (1.0 - 2.0 * float(side)) * length
                else:
                    image[axis] = x[axis] - 2.0 * above
                    total += nearness(2.0 * wp.abs(above), view)
                total += seen(grid, position, own, image, view)
    return total


@wp.func
def candidate(chance: Chance, who: int, age: int, draw: int, k: int, edge: float):
    """The k-th place of a half, from the centre of the whole [m], which has been `edge` long."""
    away = edge * (NEAR + (FAR - NEAR) * uniform(chance, who, age, draw + 3 * k + 2))
    return away * direction(chance, who, age, draw + 3 * k)


@wp.kernel
def crowd(
    grid: wp.uint64,
    chance: Chance,
    draw: int,
    box: Box,
    view: float,
    world: int,
    capacity: int,
    splitting: wp.array(dtype=int),
    origin: wp.array(dtype=int),
    generation: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    position: wp.array(dtype=wp.vec3),
    # outputs
    crowding: wp.array2d(dtype=float),
):
    """What the half that sees more of others sees, at each place that each particle of a world which splits now may
    give to its halves; `position` is of that world."""
    s, k = wp.tid()
    i = splitting[s]
    own = i - world * capacity
    if own >= 0 and own < capacity:
        way = candidate(chance, origin[i], generation[i], draw, k, wp.pow(volume[i], 1.0 / 3.0))
        first = seen_with_images(grid, position, box, own, position[own] + way, view)
        second = seen_with_images(grid, position, box, own, position[own] - way, view)
        crowding[s, k] = wp.max(first, second) + nearness(2.0 * wp.length(way), view)


@wp.kernel
def take_room(
    chance: Chance,
    draw: int,
    splitting: wp.array(dtype=int),
    origin: wp.array(dtype=int),
    generation: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    crowding: wp.array2d(dtype=float),
    # outputs
    halfway: wp.array(dtype=wp.vec3),
):
    """From the centre to the first half of each particle that splits now [m]; the other is as far on the other side."""
    s = wp.tid()
    i, best = splitting[s], int(0)
    for k in range(1, CANDIDATES):
        if crowding[s, k] < crowding[s, best]:
            best = k
    halfway[i] = candidate(chance, origin[i], generation[i], draw, best, wp.pow(volume[i], 1.0 / 3.0))
