"""Where bodies of MPM's matter come together: how far each node lies in a gap that closes (gaps.py).

Matter that is convex fills nodes with masses that are log-concave along any row of them, for so are splines, and what
they smooth of it. So a node with less than the geometric mean of those on both of its sides lies in a gap or a groove,

    g = (1 - m_i / sqrt(m_- m_+) - noise) / SOFT      within 0 and 1, along the axis where it is most

where that mean is at least half of what a full node holds, as on a free surface (more than that counts as full). It is
a gap if its sides approach at more than a tenth of the speed with which matter comes there: what lies with a groove
between, as layers do, approaches more slowly however loaded, for it has met. And it is one, however slowly it closes,
if the eight nodes about it, across that axis, lack something as well, where there is matter on both sides of them, as
of five at least: beside a groove some do not. Nodes that a wall, the piston or a body acts on are left alone.
"""

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Phase

from ..tool import Tool, distance_to
from .grid import Grid, node_of, on_grid, raw_node, turns
from .particle import ANCHORED
from .piston import Piston, driven
from .tied import place_of_node
from .walls import near_any

wp.set_module_options({"enable_backward": False, "fast_math": True})

HALF = wp.constant(0.5)
RANDOM = (11.0 / 20.0) ** 1.5  # by what share nodes differ among particles thrown at random, one a cell: sqrt of the
# integral of w^2 along each axis
RANDOM_OF_NINE = 0.2  # what one node in ten thousand, and those about it, lack among them
SOFT = wp.constant(0.1)  # lack beyond that from which a gap counts as whole: a sixth of a cell more
APPROACH = 0.1  # speed of the sides of a gap that closes, over that of what is fed, or of bodies
EVERY = wp.constant(4)  # substeps from look to look, and at the start of a tick, for nodes may have other numbers then


@wp.struct
class Known:
    """What is known of gaps."""

    noise: float  # by what share a node may lack for want of order,
    common: float  # and by what share one and all about it
    tied: float  # distance from a body within which nodes or those next to them are tied [m]
    least: wp.array(dtype=float)  # speed at which the sides of a gap approach, per world [m/s]
    beat: wp.array(dtype=int)  # number of the substep,
    last: wp.array(dtype=int)  # that of the last look,
    row: wp.array(dtype=int)  # the tick of the substep before
    gap: wp.array(dtype=float)  # how far each node lies in a gap that closes, from 0 to 1
    seen: wp.array(dtype=int)  # of each slot: the last substep in which any node of its block did
    number: wp.array(dtype=int)  # of particles beside such blocks,
    members: wp.array(dtype=int)  # these,
    faster: wp.array(dtype=wp.vec3)  # by what each will be faster than what it gathers [m/s],
    steeper: wp.array(dtype=wp.mat33)  # and what its affine velocity field will have more [1/s]
    begun: wp.array(dtype=wp.vec3)  # where nodes keep their momenta (keeping.py): the velocity it began with [m/s],
    pushed: wp.array(dtype=wp.mat33)  # and what it has given since, over mass, to a node one cell farther [m/s]


@wp.func
def due(known: Known, row: wp.array(dtype=int)):
    """Whether gaps are to be looked for in this substep."""
    return row[0] != known.row[0] or known.beat[0] - known.last[0] >= EVERY


@wp.func
def beside(grid: Grid, world: int, node: wp.vec3i, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)):
    """Momentum and mass of a node beside one that no wall is next to."""
    return raw_node(grid, world, on_grid(grid, node), table, raw)


@wp.func
def next_to(
    grid: Grid,
    world: int,
    t: int,
    node: wp.vec3i,
    axis: int,
    step: int,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """The same, a step from node t along an axis: in half of all cases in its block, which need not be looked up."""
    place = (node[axis] & 3) + step
    there = node
    there[axis] = there[axis] + step
    value = wp.vec4(0.0, 0.0, 0.0, 0.0)
    if place >= 0 and place < 4:
        value = raw[t + step * (16 >> (2 * axis))]
    else:
        value = beside(grid, world, there, table, raw)
    return value


@wp.func
def share_filled(mass: float, full: float):
    """Of what a full node holds, at most 1; nothing by what a clamp holds, which weighs more."""
    filled = float(0.0)
    if mass < ANCHORED * full:
        filled = wp.min(mass / full, 1.0)
    return filled


@wp.func
def mean_beside(low: float, high: float, full: float):
    """Geometric mean of what the nodes on both sides hold, over what full ones do; 0 if it is less than HALF."""
    mean = wp.sqrt(share_filled(low, full) * share_filled(high, full))
    return wp.where(mean >= HALF, mean, 0.0)


@wp.func
def is_wide(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    axis: int,
    full: float,
    noise: float,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """Whether a node and all about it, across an axis, lack something along it, where there is matter on both sides, as
    there is of six of the nine up to a straight edge."""
    closed, met = int(0), int(0)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    for line in range(int(9)):
        if met == 0:
            here = node
            here[first] = here[first] + line / 3 - 1
            here[second] = here[second] + line % 3 - 1
            before = here
            after = here
            before[axis] = before[axis] - 1
            after[axis] = after[axis] + 1
            low = beside(grid, world, before, table, raw)[3]
            mean = mean_beside(low, beside(grid, world, after, table, raw)[3], full)
            if mean > 0.0:
                closed += 1
                if share_filled(beside(grid, world, here, table, raw)[3], full) >= (1.0 - noise) * mean:
                    met = 1
    return met == 0 and closed >= 6


@wp.func
def gap_at(
    grid: Grid,
    world: int,
    t: int,
    node: wp.vec3i,
    filled: float,
    full: float,
    known: Known,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """g of node t, which holds this share of what full ones do; the most along any axis."""
    most = float(0.0)
    for axis in range(3):
        low = next_to(grid, world, t, node, axis, -1, table, raw)
        high = next_to(grid, world, t, node, axis, 1, table, raw)
        mean = mean_beside(low[3], high[3], full)
        if mean > 0.0:
            lack = 1.0 - filled / mean
            approach = low[axis] / low[3] - high[axis] / high[3]
            if lack > known.common and approach > 0.0:
                own = lack - known.noise
                if approach <= known.least[world]:
                    own = 0.0
                wide = lack - known.common
                if wide > wp.max(most, own):
                    if is_wide(grid, world, node, axis, full, known.common, table, raw):
                        own = wide
                most = wp.max(most, own)
    return wp.min(most / SOFT, 1.0)


@wp.kernel
def find_gaps(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    phases: wp.array2d(dtype=Phase),
    piston: Piston,
    tool: Tool,
    row: wp.array(dtype=int),
    # outputs
    known: Known,
):
    """How far each node lies in a gap that closes, where that is due."""
    lane = index_of(share, wp.tid())
    t, end, step = turns(lane, lanes, wp.min(active[0] * 64, raw.shape[0]))
    if not due(known, row):
        end = 0
    elif lane == 0:
        known.number[0] = 0
    slot, world, corner, full = int(-1), int(0), wp.vec3i(0, 0, 0), float(0.0)
    while t < end:
        if t >> 6 != slot:  # on the CPU a lane's nodes follow each other: divisions once a block
            slot = t >> 6
            world = block_of[slot] / grid.blocks_per_world
            corner = node_of(grid, block_of[slot] - world * grid.blocks_per_world, 0)
            full = phases[world, 0].density / grid.inv_volume
        mass = raw[t][3]
        found = float(0.0)
        if mass > 0.0 and mass < (1.0 - known.common) * full:
            node = corner + wp.vec3i((t & 63) >> 4, (t >> 2) & 3, t & 3)
            if not near_any(grid, node):
                found = gap_at(grid, world, t, node, mass / full, full, known, table, raw)
            if found > 0.0:
                place = place_of_node(grid, node)
                if known.tied > 0.0:
                    away, _normal = distance_to(tool, place)
                    if away < known.tied:
                        found = 0.0
                if piston.on == 1:
                    v = wp.vec3(raw[t][0], raw[t][1], raw[t][2]) / mass
                    if wp.length_sq(driven(piston, grid, place, v) - v) > 0.0:
                        found = 0.0
        known.gap[t] = found
        if found > 0.0:
            known.seen[slot] = known.beat[0]
        t += step


@wp.func
def with_gaps(known: Known, slot: int, look: int):
    """The slot of a block with a node in a gap, -1 for others."""
    return wp.where(slot >= 0 and known.seen[wp.max(slot, 0)] == look, slot, -1)
