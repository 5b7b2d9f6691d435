"""Where there is room for the halves of a particle that splits.

Matter grows as its surroundings let it: a strand on a floor by its section alone, not along itself. Halves that lie
anywhere leave gaps between families then, which a method takes for matter that is denser where the families are. Of
CANDIDATES places, random ones, those are taken at which the half that sees more of others sees least.
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


@wp.kernel
def find_room(
    grid: wp.uint64,
    chance: Chance,
    draw: int,
    box: Box,
    view: float,
    offspring_count: wp.array(dtype=int),
    origin: wp.array(dtype=int),
    generation: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    position: wp.array(dtype=wp.vec3),
    # outputs
    halfway: wp.array(dtype=wp.vec3),
):
    """From the centre to the first half of each particle that splits now [m]; the other is as far on the other side."""
    i = wp.tid()
    if offspring_count[i] > 1:
        who, age = origin[i], generation[i]
        edge = wp.pow(volume[i], 1.0 / 3.0)
        least = float(wp.inf)
        for k in range(CANDIDATES):
            away = edge * (NEAR + (FAR - NEAR) * uniform(chance, who, age, draw + 3 * k + 2))
            way = away * direction(chance, who, age, draw + 3 * k)
            first = seen_with_images(grid, position, box, i, position[i] + way, view)
            second = seen_with_images(grid, position, box, i, position[i] - way, view)
            score = wp.max(first, second) + nearness(2.0 * away, view)
            if score < least:
                least = score
                halfway[i] = way
