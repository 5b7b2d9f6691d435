"""Bodies of MPM's matter that come together feel less of each other before they meet.

From a gap of two cells on they share nodes, where the momentum of one becomes the other's: the gap closes as a strain
of the matter on both sides, which resists, and layers came to rest up to a cell apart, J saying that they were full.

At a node that lies in a gap by g (gap_nodes.py) each particle goes on with what it gave to the node, its own momentum
and the push of its own stress, in place of the mean of all,

    v_ip = v_i + g (v_p + (C_p - 4 dt V0 tau / (m_p dx^2)) (x_i - x_p) + dt force - v_i)

The particles' w m_p v_ip add up to the node's momentum whatever g is: linear and angular momentum are kept. (Where
nodes keep theirs for a cycle of substeps, v_p, C_p are those it began with, and pushes, of tau (1 + H)^-T then, those
of all since: keeping.py.) Through such nodes nothing pushes, drags or strains. (Beside a body pressure of what is
elastic is no part of tau, but acts by way of nodes that are in no gap: dilation.py.)
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
from ..tool import Tool
from . import gap_nodes
from .gap_nodes import APPROACH, RANDOM, RANDOM_OF_NINE, Known, due, find_gaps, with_gaps
from .grid import Grid, first_node, node_parts, slots_of, turns
from .nodes import follow
from .particle import (
    as_begun,
    columns_scaled,
    contained,
    kirchhoff,
    mean_stress,
    presses_nodes,
    resistance_of,
    viscous,
    weights,
)
from .tied import TIED

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func
def has_gaps(known: Known, look: int, s0: int, s1: int, s2: int, s3: int, s4: int, s5: int, s6: int, s7: int):
    """Whether any of eight blocks has a node in a gap."""
    low = wp.max(wp.max(with_gaps(known, s0, look), with_gaps(known, s1, look)), with_gaps(known, s2, look))
    high = wp.max(wp.max(with_gaps(known, s4, look), with_gaps(known, s5, look)), with_gaps(known, s6, look))
    both = wp.max(with_gaps(known, s3, look), with_gaps(known, s7, look))
    return wp.max(wp.max(low, high), both) >= 0


@wp.kernel
def keep_own(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
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
    number: int,
    bent: wp.array(dtype=wp.mat33),
    # outputs
    known: Known,
):
    """By what who has nodes in blocks with gaps will be faster than what it gathers; after strain, before motion. Who
    that is is found among all where gaps were looked for, and known from then on. `number`: of the substep in its
    cycle, from 0 on; `bent`: by how much matter has been since (keeping.py)."""
    anew = due(known, row)
    many, look = int(known.number[0]), int(known.last[0])
    if anew:
        many, look = position.shape[0], int(known.beat[0])
    t, end, step = turns(index_of(share, wp.tid()), lanes, many)
    while t < end:
        p = int(t)
        if not anew:
            p = known.members[t]
        world = p / capacity
        if not anew or (p - world * capacity < count[world] and held[p] == FREE):
            base = first_node(grid, position[p])
            bx, by, bz, lx, ly, lz = node_parts(grid, base)
            s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
            if not anew or has_gaps(known, look, s0, s1, s2, s3, s4, s5, s6, s7):
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
                f, wx, wy, wz = weights(grid, position[p], base)
                phase = phases[world, phase_of[p]]
                mean = float(0.0)
                if known.tied == 0.0 or not presses_nodes(phase):
                    mean = mean_stress(phase, volume_ratio[p])
                tau = kirchhoff(phase, mean, elastic_normal[p], elastic_shear[p])
                if phase.viscosity > 0.0:
                    tau += viscous(phase, volume_ratio[p], affine[p])
                v = velocity[p]
                a = columns_scaled(affine[p], grid.dx)
                if number > 0:  # not anew: members are those of the cycle's first substep
                    v = known.begun[t]
                    a = known.pushed[t]
                begun = v
                push = resistance_of(grid, dt[world], volume[p], tau) / mass[p]
                if number > 0:
                    push = as_begun(grid, push, bent[p])
                a -= push
                v += (float(number + 1) * dt[world]) * force_at(force[world], position[p])
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
                            there = load_vec4(moving, at)
                            part = wp.where(slot >= 0, wx[o] * wy[q] * wz[r] * known.gap[at], 0.0)
                            off = wp.vec3(float(o), float(q), float(r)) - f
                            u = part * (v + a * off - wp.vec3(there[0], there[1], there[2]))
                            more += u
                            turn += wp.outer(u, off)
                member = int(t)
                if anew:
                    member = drawn(known.number, 0)
                    known.members[member] = p
                if known.begun.shape[0] > 0:
                    known.begun[member] = begun
                    known.pushed[member] = a
                known.faster[member] = more
                known.steeper[member] = columns_scaled(turn, 4.0 * grid.inv_dx)
        t += step


@wp.kernel
def go_on(
    share: wp.vec3i,
    grid: Grid,
    lanes: int,
    capacity: int,
    dt: wp.array(dtype=float),
    moves: float,
    substeps: int,
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
    """The members are faster by that, once they have gathered and moved; and so many substeps have been."""
    lane = index_of(share, wp.tid())
    t, end, step = turns(lane, lanes, known.number[0])
    while t < end:
        p = known.members[t]
        world = p / capacity
        x = position[p]
        velocity[p] = velocity[p] + known.faster[t]
        affine[p] = affine[p] + known.steeper[t]
        position[p] = contained(grid, x + (moves * dt[world]) * known.faster[t])
        follow(grid, world, x, position[p], table, block_of, active, homes, fault)
        t += step
    if lane == 0:
        if due(known, row):
            known.last[0] = known.beat[0]
        known.row[0] = row[0]
        known.beat[0] = known.beat[0] + substeps


class Gaps:
    """What keeping bodies apart allocates, and its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, slots: int, lanes: int, tool: Any, cycles: bool) -> None:
        """`tool` is a body that ties nodes, or None; `cycles`: whether nodes keep their momenta; for `slots` and
        `lanes` see tied.py."""
        self.scene, self.pool, self.grid, self.lanes = scene, pool, grid, lanes
        known = self.known = Known()
        known.tied = 0.0 if tool is None else (TIED + 1.0) * max(grid.dx)
        self.tool = Tool() if tool is None else tool
        disorder = math.sqrt(scene.spacing**3 * grid.inv_volume)
        known.noise, known.common = RANDOM * disorder, RANDOM_OF_NINE * disorder
        with wp.ScopedDevice(scene.device):
            known.least = wp.array([APPROACH * (s.feeding_speed or s.reference_speed) for s in scene.scenarios], float)
            known.beat, known.number = wp.zeros(1, dtype=int), wp.zeros(1, dtype=int)
            known.last, known.row = wp.full(1, -1, dtype=int), wp.full(1, -1, dtype=int)
            known.gap, known.seen = wp.zeros(slots * 64, dtype=float), wp.full(slots, -1, dtype=int)
            known.members, known.faster = wp.zeros(pool.size, dtype=int), wp.zeros(pool.size, dtype=wp.vec3)
            known.steeper = wp.zeros(pool.size, dtype=wp.mat33)
            many = pool.size if cycles else 0
            known.begun, known.pushed = wp.zeros(many, dtype=wp.vec3), wp.zeros(many, dtype=wp.mat33)
            self._nobody = wp.zeros(1, dtype=int)
        self.launch = Warp(scene.crew).launch

    def prepare(self) -> None:
        for module in (gap_nodes.__name__, __name__):
            self.scene.crew.load(module)

    def refresh(self) -> None:
        """Enqueue: nodes have other numbers, so look anew."""
        self.scene.crew.launch(put, 1, [-1, self.known.row])

    def look(self, table: wp.array, block_of: wp.array, active: wp.array, raw: wp.array, piston: Any) -> None:
        """Enqueue: find gaps by what particles gave."""
        lanes, row = [self.grid, self.lanes], self.scene.clock.hours.row
        nodes = [active, block_of, table, raw, self.scene.phases, piston, self.tool, row]
        self.launch(find_gaps, self.lanes, [*lanes, *nodes], [self.known])

    def keep(self, table: wp.array, moving: wp.array, number: int, bent: wp.array) -> None:
        """Enqueue: what particles that have nodes in gaps would keep in the number-th substep of a cycle, from 0 on,
        `bent` since that began (keeping.py); before they gather and move."""
        pool, scene, row = self.pool, self.scene, self.scene.clock.hours.row
        matter = [pool.phase, pool.position, pool.velocity, pool.affine, pool.mass, pool.volume]
        matter += [pool.volume_ratio, pool.elastic_normal, pool.elastic_shear]
        given = [pool.count, pool.held, scene.dt, scene.force, scene.phases, *matter, table, moving, row, number, bent]
        self.launch(keep_own, self.lanes, [self.grid, self.lanes, pool.capacity, *given], [self.known])

    def go_on(
        self, moves: float, substeps: int, table: wp.array, block_of: wp.array, active: wp.array, homes: Any
    ) -> None:
        """Enqueue: let them, once they have, if they move (1; else 0); so many substeps are over with it."""
        pool, row = self.pool, self.scene.clock.hours.row
        moved = [pool.position, pool.velocity, pool.affine, table, block_of, active]
        outdated = self._nobody if homes is None else homes.outdated
        some = [self.grid, self.lanes, pool.capacity, self.scene.dt, moves, substeps, row]
        self.launch(go_on, self.lanes, some, [self.known, *moved, outdated, pool.fault])

    def footprint(self) -> dict[str, int]:
        fields = Known.vars.keys() - {"noise", "common", "tied"}
        return {f"gaps.{name}": getattr(self.known, name).capacity for name in sorted(fields)}
