"""Bodies of MPM's matter that have not met yet do not feel each other.

From a gap of two cells on they share nodes, where the momentum of one becomes the other's: the gap closes as a strain
of the matter on both sides, which resists, and layers came to rest up to a cell apart, J saying that they were full.

Matter that is convex fills nodes with masses that are log-concave along any row of them, for so are splines, and what
they smooth of it. So a node with less than the geometric mean of those on both of its sides lies in a gap,

    g = (1 - m_i / sqrt(m_- m_+) - MARGIN) / (WHOLE - MARGIN)      within 0 and 1, along the axis where it is most

where that mean is at least half of what a full node holds, as on a free surface. (More than that counts as full.) There
each particle goes on with what it gave to the node, its own momentum and the push of its own stress, in place of the
mean of all,

    v_ip = v_i + g (v_p + (C_p - 4 dt V0 tau / (m_p dx^2)) (x_i - x_p) + dt force - v_i)

The particles' w m_p v_ip add up to the node's momentum whatever g is: linear and angular momentum are kept. Until they
meet nothing pushes, drags or strains. Nodes that a wall or the piston acts on are left alone.
"""

from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Force, Phase, Scene, force_at

from ..backends import Warp
from .grid import Grid, first_node, node_at, node_of, node_parts, slots_of, turns
from .homes import on_grid
from .nodes import follow
from .particle import ANCHORED, columns_scaled, contained, kirchhoff, resistance_of, viscous, weights
from .piston import Piston, driven
from .walls import in_front, near_any

wp.set_module_options({"enable_backward": False, "fast_math": True})

# What a gap of 0.16 and 0.47 cells about a node makes: noise of particles in no order is less, and what is left of a
# gap then no grid could tell.
MARGIN, WHOLE = wp.constant(0.1), wp.constant(0.3)
HALF = wp.constant(0.5)


@wp.func
def share_filled(
    grid: Grid, world: int, node: wp.vec3i, full: float, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)
):
    """Of what a full node holds, at most 1; nothing by what a clamp holds, which weighs more."""
    at = node_at(grid, world, on_grid(grid, in_front(grid, node)), table)
    filled = float(0.0)
    if at >= 0 and raw[at][3] < ANCHORED * full:
        filled = wp.min(raw[at][3] / full, 1.0)
    return filled


@wp.func
def lacking(own: float, low: float, high: float):
    """By what share a node holds less than the geometric mean of those on its sides."""
    mean = wp.sqrt(low * high)
    lacks = float(0.0)
    if mean >= HALF:
        lacks = 1.0 - own / mean
    return lacks


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
    # outputs
    gap: wp.array(dtype=float),
):
    """How far each node lies in a gap, from 0 to 1."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        world = block_of[t >> 6] / grid.blocks_per_world
        node = node_of(grid, block_of[t >> 6] - world * grid.blocks_per_world, t & 63)
        full = phases[world, 0].density / grid.inv_volume
        mass = raw[t][3]
        found = float(0.0)
        if mass > 0.0 and not near_any(grid, node):
            for axis in range(3):
                before = node
                after = node
                before[axis] = before[axis] - 1
                after[axis] = after[axis] + 1
                low = share_filled(grid, world, before, full, table, raw)
                high = share_filled(grid, world, after, full, table, raw)
                found = wp.max(found, lacking(wp.min(mass / full, 1.0), low, high))
            if piston.on == 1:
                place = grid.origin + wp.cw_mul(wp.vec3(float(node[0]), float(node[1]), float(node[2])), grid.dx)
                v = wp.vec3(raw[t][0], raw[t][1], raw[t][2]) / mass
                if wp.length_sq(driven(piston, grid, place, v) - v) > 0.0:
                    found = 0.0
        gap[t] = wp.clamp((found - MARGIN) / (WHOLE - MARGIN), 0.0, 1.0)
        t += step


@wp.kernel
def keep_own(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
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
    gap: wp.array(dtype=float),
    # outputs
    faster: wp.array(dtype=wp.vec4),
    bent: wp.array(dtype=wp.mat33),
):
    """What free particles that have nodes in gaps will be faster by than what they gather (the fourth is 1), and what
    their affine velocity fields will have more [1/s]; after strain, before motion."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        base = first_node(grid, position[p])
        f, wx, wy, wz = weights(grid, position[p], base)
        bx, by, bz, lx, ly, lz = node_parts(grid, base)
        s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
        here = held[p] == FREE
        m = mass[p]
        a = wp.mat33()
        kick = dt[world] * force_at(force[world], position[p])
        known = bool(False)
        more = wp.vec3()
        turn = wp.mat33()
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
                    if here and gap[at] > 0.0:
                        if not known:
                            known = True
                            phase = phases[world, phase_of[p]]
                            tau = kirchhoff(phase, volume_ratio[p], elastic_normal[p], elastic_shear[p])
                            if phase.viscosity > 0.0:
                                tau += viscous(phase, volume_ratio[p], affine[p])
                            a = columns_scaled(affine[p], grid.dx)
                            a -= resistance_of(grid, dt[world], volume[p], tau) / m
                        off = wp.vec3(float(o), float(q), float(r)) - f
                        own = velocity[p] + a * off + kick
                        mean = wp.vec3(moving[at][0], moving[at][1], moving[at][2])
                        u = (wx[o] * wy[q] * wz[r] * gap[at]) * (own - mean)
                        more += u
                        turn += wp.outer(u, off)
        faster[p] = wp.vec4(more[0], more[1], more[2], float(known))
        if known:
            bent[p] = columns_scaled(turn, 4.0 * grid.inv_dx)


@wp.kernel
def go_on(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    faster: wp.array(dtype=wp.vec4),
    bent: wp.array(dtype=wp.mat33),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """The same, once they have gathered and moved."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and faster[p][3] > 0.0:
        more = wp.vec3(faster[p][0], faster[p][1], faster[p][2])
        x = position[p]
        velocity[p] = velocity[p] + more
        affine[p] = affine[p] + bent[p]
        position[p] = contained(grid, x + dt[world] * more)
        follow(grid, world, x, position[p], table, block_of, active, homes, fault)


class Gaps:
    """What keeping bodies apart allocates, and its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, slots: int) -> None:
        self.scene, self.pool, self.grid = scene, pool, grid
        with wp.ScopedDevice(scene.device):
            self.gap = wp.zeros(slots * 64, dtype=float)
            self.faster = wp.zeros(pool.size, dtype=wp.vec4)
            self.bent = wp.zeros(pool.size, dtype=wp.mat33)
            self._nobody = wp.zeros(1, dtype=int)
        self.launch = Warp(scene.crew).launch

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def look(
        self,
        lanes: int,
        table: wp.array,
        block_of: wp.array,
        active: wp.array,
        raw: wp.array,
        moving: wp.array,
        piston: Any,
    ) -> None:
        """Enqueue: find gaps, and what particles that have nodes in them would keep; before they gather and move."""
        pool, scene = self.pool, self.scene
        nodes = [active, block_of, table, raw]
        self.launch(find_gaps, lanes, [self.grid, lanes, *nodes, scene.phases, piston], [self.gap])
        matter = [pool.phase, pool.held, pool.position, pool.velocity, pool.affine, pool.mass, pool.volume]
        strains = [pool.volume_ratio, pool.elastic_normal, pool.elastic_shear]
        self.launch(
            keep_own,
            pool.size,
            [*self._some(), scene.force, scene.phases, *matter, *strains, table, moving, self.gap],
            [self.faster, self.bent],
        )

    def go_on(self, table: wp.array, block_of: wp.array, active: wp.array, homes: Any) -> None:
        """Enqueue: let them, once they have."""
        pool = self.pool
        outdated = self._nobody if homes is None else homes.outdated
        self.launch(
            go_on,
            pool.size,
            [*self._some(), self.faster, self.bent],
            [pool.position, pool.velocity, pool.affine, table, block_of, active, outdated, pool.fault],
        )

    def _some(self) -> list[Any]:
        return [self.grid, self.pool.capacity, self.pool.count, self.scene.dt]

    def footprint(self) -> dict[str, int]:
        return {"gaps": self.gap.capacity + self.faster.capacity + self.bent.capacity}
