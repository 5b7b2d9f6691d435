"""Bodies of MPM's matter that come together feel less of each other before they meet.

From a gap of two cells on they share nodes, where the momentum of one becomes the other's: the gap closes as a strain
of the matter on both sides, which resists, and layers came to rest up to a cell apart, J saying that they were full.

Matter that is convex fills nodes with masses that are log-concave along any row of them, for so are splines, and what
they smooth of it. So a node with less than the geometric mean of those on both of its sides lies in a gap,

    g = (1 - m_i / sqrt(m_- m_+) - noise) / SOFT      within 0 and 1, along the axis where it is most

where that mean is at least half of what a full node holds, as on a free surface (more than that counts as full), and
the sides approach at more than a tenth of the speed with which matter comes there. What lies with a groove between,
as layers do, approaches more slowly however loaded: it has met. In a gap each particle goes on
with what it gave to the node, its own momentum and the push of its own stress, in place of the mean of all,

    v_ip = v_i + g (v_p + (C_p - 4 dt V0 tau / (m_p dx^2)) (x_i - x_p) + dt force - v_i)

The particles' w m_p v_ip add up to the node's momentum whatever g is: linear and angular momentum are kept. Through
such nodes nothing pushes, drags or strains. Nodes that a wall, the piston or a body acts on are left alone.
"""

import math
from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import drawn, index_of, put
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Force, Phase, Scene, force_at
from fluidbench.native.vector_access import load_vec4

from ..backends import Warp
from ..tool import Tool, distance_to
from .grid import Grid, first_node, node_of, node_parts, raw_node, slots_of, turns
from .homes import on_grid
from .nodes import follow
from .particle import ANCHORED, columns_scaled, contained, kirchhoff, resistance_of, viscous, weights
from .piston import Piston, driven
from .tied import TIED, place_of_node
from .walls import in_front, near_any

wp.set_module_options({"enable_backward": False, "fast_math": True})

HALF = wp.constant(0.5)
RANDOM = (11.0 / 20.0) ** 1.5  # by what share nodes differ among particles thrown at random, one a cell: sqrt of the
# integral of w^2 along each axis
SOFT = wp.constant(0.1)  # lack beyond that from which a gap counts as whole: a sixth of a cell more
APPROACH = 0.1  # speed of the sides of a gap that closes, over that of what is fed, or of bodies
EVERY = wp.constant(4)  # substeps from look to look, and at the start of a tick, for nodes may have other numbers then


@wp.struct
class Known:
    """What is known of gaps."""

    noise: float  # by what share a node may lack for want of order
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
    bent: wp.array(dtype=wp.mat33)  # and what its affine velocity field will have more [1/s]


@wp.func
def due(known: Known, row: wp.array(dtype=int)):
    """Whether gaps are to be looked for in this substep."""
    return row[0] != known.row[0] or known.beat[0] - known.last[0] >= EVERY


@wp.func
def beside(grid: Grid, world: int, node: wp.vec3i, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)):
    """Momentum and mass of the node at a place, or of the one in front of the wall that it lies behind."""
    return raw_node(grid, world, on_grid(grid, in_front(grid, node)), table, raw)


@wp.func
def share_filled(mass: float, full: float):
    """Of what a full node holds, at most 1; nothing by what a clamp holds, which weighs more."""
    filled = float(0.0)
    if mass < ANCHORED * full:
        filled = wp.min(mass / full, 1.0)
    return filled


@wp.func
def lacking(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    filled: float,
    full: float,
    least: float,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """By what share a node holds less than the geometric mean of those on its sides, where these approach; the most
    along any axis."""
    most = float(0.0)
    for axis in range(3):
        before = node
        after = node
        before[axis] = before[axis] - 1
        after[axis] = after[axis] + 1
        low = beside(grid, world, before, table, raw)
        high = beside(grid, world, after, table, raw)
        mean = wp.sqrt(share_filled(low[3], full) * share_filled(high[3], full))
        if mean >= HALF:
            if low[axis] / low[3] - high[axis] / high[3] > least:
                most = wp.max(most, 1.0 - filled / mean)
    return most


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
        if mass > 0.0 and mass < (1.0 - known.noise) * full:
            node = corner + wp.vec3i((t & 63) >> 4, (t >> 2) & 3, t & 3)
            if not near_any(grid, node):
                found = lacking(grid, world, node, mass / full, full, known.least[world], table, raw)
            if found > known.noise:
                place = place_of_node(grid, node)
                if known.tied > 0.0:
                    away, _normal = distance_to(tool, place)
                    if away < known.tied:
                        found = 0.0
                if piston.on == 1:
                    v = wp.vec3(raw[t][0], raw[t][1], raw[t][2]) / mass
                    if wp.length_sq(driven(piston, grid, place, v) - v) > 0.0:
                        found = 0.0
        known.gap[t] = wp.clamp((found - known.noise) / SOFT, 0.0, 1.0)
        if found > known.noise:
            known.seen[slot] = known.beat[0]
        t += step


@wp.func
def with_gaps(known: Known, slot: int, look: int):
    """The slot of a block with a node in a gap, -1 for others."""
    return wp.where(slot >= 0 and known.seen[wp.max(slot, 0)] == look, slot, -1)


@wp.kernel
def find_members(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    row: wp.array(dtype=int),
    # outputs
    known: Known,
):
    """Who has nodes in blocks with gaps, where that is due."""
    lane = index_of(share, wp.tid())
    p, end, step = turns(lane, lanes, position.shape[0])
    if not due(known, row):
        end = 0
    look = known.beat[0]
    while p < end:
        world = p / capacity
        if p - world * capacity < count[world] and held[p] == FREE:
            bx, by, bz, _lx, _ly, _lz = node_parts(grid, first_node(grid, position[p]))
            s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
            low = wp.max(wp.max(with_gaps(known, s0, look), with_gaps(known, s1, look)), with_gaps(known, s2, look))
            high = wp.max(wp.max(with_gaps(known, s4, look), with_gaps(known, s5, look)), with_gaps(known, s6, look))
            both = wp.max(with_gaps(known, s3, look), with_gaps(known, s7, look))
            if wp.max(wp.max(low, high), both) >= 0:
                known.members[drawn(known.number, 0)] = p
        p += step


@wp.kernel
def keep_own(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    capacity: int,
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    row: wp.array(dtype=int),
    # outputs
    known: Known,
):
    """By what the members will be faster than what they gather; after strain, before motion."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, known.number[0])
    look = known.last[0]
    if due(known, row):
        look = known.beat[0]
    while t < end:
        p = known.members[t]
        world = p / capacity
        base = first_node(grid, position[p])
        f, wx, wy, wz = weights(grid, position[p], base)
        bx, by, bz, lx, ly, lz = node_parts(grid, base)
        s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
        s0, s1, s2, s3 = (
            with_gaps(known, s0, look),
            with_gaps(known, s1, look),
            with_gaps(known, s2, look),
            with_gaps(known, s3, look),
        )
        s4, s5, s6, s7 = (
            with_gaps(known, s4, look),
            with_gaps(known, s5, look),
            with_gaps(known, s6, look),
            with_gaps(known, s7, look),
        )
        phase = phases[world, phase_of[p]]
        tau = kirchhoff(phase, volume_ratio[p], elastic_normal[p], elastic_shear[p])
        if phase.viscosity > 0.0:
            tau += viscous(phase, volume_ratio[p], affine[p])
        a = columns_scaled(affine[p], grid.dx) - resistance_of(grid, dt[world], volume[p], tau) / mass[p]
        v = velocity[p] + dt[world] * force_at(force[world], position[p])
        more, turn = wp.vec3(0.0, 0.0, 0.0), wp.mat33(0.0)
        for o in range(3):
            for q in range(3):
                for r in range(3):
                    t0 = wp.where(bz[r] == bz[0], s0, s1)
                    t1 = wp.where(bz[r] == bz[0], s2, s3)
                    t2 = wp.where(bz[r] == bz[0], s4, s5)
                    t3 = wp.where(bz[r] == bz[0], s6, s7)
                    near = wp.where(by[q] == by[0], t0, t1)
                    far = wp.where(by[q] == by[0], t2, t3)
                    slot = wp.where(bx[o] == bx[0], near, far)
                    at = wp.max(slot, 0) * 64 + lx[o] + ly[q] + lz[r]
                    mean = load_vec4(moving, at)
                    part = wp.where(slot >= 0, wx[o] * wy[q] * wz[r] * known.gap[at], 0.0)
                    off = wp.vec3(float(o), float(q), float(r)) - f
                    u = part * (v + a * off - wp.vec3(mean[0], mean[1], mean[2]))
                    more += u
                    turn += wp.outer(u, off)
        known.faster[t] = more
        known.bent[t] = columns_scaled(turn, 4.0 * grid.inv_dx)
        t += step


@wp.kernel
def go_on(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    capacity: int,
    dt: wp.array(dtype=float),
    row: wp.array(dtype=int),
    # outputs
    known: Known,
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """The members are faster by that, once they have gathered and moved; and the substep has been."""
    lane = index_of(share, wp.tid())
    t, end, step = turns(lane, lanes, known.number[0])
    while t < end:
        p = known.members[t]
        world = p / capacity
        x = position[p]
        velocity[p] = velocity[p] + known.faster[t]
        affine[p] = affine[p] + known.bent[t]
        position[p] = contained(grid, x + dt[world] * known.faster[t])
        follow(grid, world, x, position[p], table, block_of, active, homes, fault)
        t += step
    if lane == 0:
        if due(known, row):
            known.last[0] = known.beat[0]
        known.row[0] = row[0]
        known.beat[0] = known.beat[0] + 1


class Gaps:
    """What keeping bodies apart allocates, and its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, slots: int, lanes: int, tool: Any) -> None:
        """`tool` is a body that ties nodes, or None; for `slots` and `lanes` see tied.py."""
        self.scene, self.pool, self.grid, self.lanes = scene, pool, grid, lanes
        known = self.known = Known()
        known.tied = 0.0 if tool is None else (TIED + 1.0) * max(grid.dx)
        self.tool = Tool() if tool is None else tool
        known.noise = RANDOM * math.sqrt(scene.spacing**3 * grid.inv_volume)
        with wp.ScopedDevice(scene.device):
            known.least = wp.array([APPROACH * (s.feeding_speed or s.reference_speed) for s in scene.scenarios], float)
            known.beat, known.number = wp.zeros(1, dtype=int), wp.zeros(1, dtype=int)
            known.last, known.row = wp.full(1, -1, dtype=int), wp.full(1, -1, dtype=int)
            known.gap, known.seen = wp.zeros(slots * 64, dtype=float), wp.full(slots, -1, dtype=int)
            known.members, known.faster = wp.zeros(pool.size, dtype=int), wp.zeros(pool.size, dtype=wp.vec3)
            known.bent = wp.zeros(pool.size, dtype=wp.mat33)
            self._nobody = wp.zeros(1, dtype=int)
        self.launch = Warp(scene.crew).launch

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def refresh(self) -> None:
        """Enqueue: nodes have other numbers, so look anew."""
        self.scene.crew.launch(put, 1, [-1, self.known.row])

    def look(
        self,
        table: wp.array,
        block_of: wp.array,
        active: wp.array,
        raw: wp.array,
        moving: wp.array,
        piston: Any,
    ) -> None:
        """Enqueue: find gaps, and what particles that have nodes in them would keep; before they gather and move."""
        pool, scene, row = self.pool, self.scene, self.scene.clock.hours.row
        some, lanes = [self.grid, self.lanes], self.lanes
        nodes = [active, block_of, table, raw]
        self.launch(find_gaps, lanes, [*some, *nodes, scene.phases, piston, self.tool, row], [self.known])
        some.append(pool.capacity)
        self.launch(find_members, lanes, [*some, pool.count, pool.held, pool.position, table, row], [self.known])
        matter = [pool.phase, pool.position, pool.velocity, pool.affine, pool.mass, pool.volume]
        matter += [pool.volume_ratio, pool.elastic_normal, pool.elastic_shear]
        given = [scene.dt, scene.force, scene.phases, *matter, table, moving, row]
        self.launch(keep_own, lanes, [*some, *given], [self.known])

    def go_on(self, table: wp.array, block_of: wp.array, active: wp.array, homes: Any) -> None:
        """Enqueue: let them, once they have."""
        pool, row = self.pool, self.scene.clock.hours.row
        moved = [pool.position, pool.velocity, pool.affine, table, block_of, active]
        outdated = self._nobody if homes is None else homes.outdated
        some = [self.grid, self.lanes, pool.capacity, self.scene.dt, row]
        self.launch(go_on, self.lanes, some, [self.known, *moved, outdated, pool.fault])

    def footprint(self) -> dict[str, int]:
        fields = Known.vars.keys() - {"noise", "tied"}
        return {f"gaps.{name}": getattr(self.known, name).capacity for name in sorted(fields)}
