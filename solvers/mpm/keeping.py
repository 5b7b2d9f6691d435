"""Where matter is fed freely, nodes of MPM can keep their momenta for some substeps, before particles take them back.

Each exchange between particles and nodes costs something, however short the substep: what is carried gives the nodes
below the outlet its momentum anew, which presses as a lower one would; and a step of APIC leaves velocities that
are no longer linear at a free surface by some hundredths of u'' dx^2. So what is laid got wider with the number of
substeps, that is, with the speed of sound. A cycle of them is one Lagrangian step of the grid, as the material point
method has it: nodes go on where they were, and with them the places X of particles within their cells,

    m_i v_i += dt f_i,   f_i = -sum_p V0 tau (1 + H)^-T grad w_ip(X),
    u += dt v(X),   H += dt grad v(X),   D of strain: of grad v (1 + H)^-1,

u being the way of a particle since the cycle began, H its gradient. At the end particles take velocities, and go that
way. For each substep these are the equations of a finite element grid: momentum is kept, its moment up to what is not
linear within a cell, and the bounds on dt are the same as long as H is small, as it is in a tick (at a shear of 0.25 a
particle alone is 1.17 times as viscous).
Were H left out, J would not tell that whoever goes straight on in a deforming field is crowded, by tr H^2 / 2 (sections
were 5 % too small); were the way that of the last velocity alone, particles would not go where their strain says. The
piston is firm (piston.py): one that pushes what is slower and lets go what is faster pumps what swings, which nodes no
longer damp in every substep.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from fluidbench.native.crew import index_of

from .grid import Grid, turns
from .nodes import follow
from .particle import EXPLICIT, columns_scaled, moved

if TYPE_CHECKING:
    from .solver import SolverMPM

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.kernel
def keep(
    share: wp.vec3i,
    lanes: int,
    active: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    raw: wp.array(dtype=wp.vec4),
):
    """Momenta of nodes from the velocities that they have come to; their masses stay."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        m, v = raw[t][3], moving[t]
        raw[t] = wp.vec4(m * v[0], m * v[1], m * v[2], m)
        t += step


@wp.func
def turning(grid: Grid, c: wp.mat33, f: wp.mat33, now: wp.mat33):
    """What the affine field `now` turns too slowly [1/s]: nodes that went along, by a linear field, have the moment
    C D F^T, D = diag(dx^2) / 4, of which the antisymmetric part is spin; where they lie again, that of `now` D."""
    square = wp.cw_mul(grid.dx, grid.dx)
    lacking = columns_scaled(c, square) * wp.transpose(f) - columns_scaled(now, square)
    return columns_scaled(0.5 * (lacking - wp.transpose(lacking)), wp.cw_mul(grid.inv_dx, grid.inv_dx))


@wp.kernel
def go_along(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    number: int,
    ends: int,
    # outputs
    way: wp.array(dtype=wp.vec3),
    bent: wp.array(dtype=wp.mat33),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """u and H after the number-th substep of a cycle, from 0 on, and velocity gradients over places as they have become
    meanwhile; where it ends (1) particles go their way."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        u = dt[world] * velocity[p]
        c = affine[p]
        h = dt[world] * c
        if number > 0:
            before = wp.identity(n=3, dtype=float) + bent[p]
            u += way[p]
            h += bent[p]
            affine[p] = c * wp.inverse(before)
            if ends == 1:
                affine[p] = affine[p] + turning(grid, c, wp.identity(n=3, dtype=float) + h, affine[p])
        way[p] = u
        bent[p] = h
        if ends == 1:
            x = position[p]
            whole = float(number + 1) * dt[world]
            moved(grid, x, u / whole, whole, p, position, velocity, fault)
            follow(grid, world, x, position[p], table, block_of, active, homes, fault)


class Keeping:
    """What keeping momenta allocates, and its launches, which are Warp's whatever the solver's language."""

    def __init__(self, solver: SolverMPM) -> None:
        self.solver = solver
        with wp.ScopedDevice(solver.scene.device):
            self.way = wp.zeros(solver.pool.size, dtype=wp.vec3)
            self.bent = wp.zeros(solver.pool.size, dtype=wp.mat33)
            self._nobody = wp.zeros(1, dtype=int)

    def prepare(self) -> None:
        self.solver.scene.crew.load(__name__)

    def go(self, substeps: int, longest: int) -> None:
        """Enqueue so many substeps, in cycles of so many and a rest."""
        for first in range(0, substeps, longest):
            self._cycle(min(longest, substeps - first))

    def _cycle(self, substeps: int) -> None:
        solver, scene = self.solver, self.solver.scene
        if substeps == 1:  # keeps nothing
            solver.substep()
            return
        for number in range(substeps):
            if scene.grows:
                solver.swell()
            if number == 0:
                solver.clear_grid()
                solver.p2g()
            else:
                nodes = [solver.node_lanes, solver.active, solver.moving]
                scene.crew.launch(keep, solver.node_lanes, nodes, [solver.raw])
                solver.give(scene.dt, int(EXPLICIT), solver.raw, anew=0.0)
            solver.grid_step()
            ends = number == substeps - 1
            solver.take(number, substeps if ends else 0, 0.0)
            self._go_along(number, ends)

    def _go_along(self, number: int, ends: bool) -> None:
        solver, scene, pool = self.solver, self.solver.scene, self.solver.pool
        homes = self._nobody if solver.by_block is None else solver.by_block.homes.outdated
        some = [solver.grid, pool.capacity, pool.count, scene.dt, number, int(ends)]
        matter = [self.way, self.bent, pool.position, pool.velocity, pool.affine]
        scene.crew.launch(go_along, pool.size, some, [*matter, *solver.blocks, homes, pool.fault])

    def footprint(self) -> dict[str, int]:
        return {"keeping.way": self.way.capacity, "keeping.bent": self.bent.capacity}
