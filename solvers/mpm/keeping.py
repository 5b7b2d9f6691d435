"""Where matter is fed freely, nodes of MPM can keep their momenta for some substeps, before particles take them back.

Each exchange between particles and nodes costs something, however short the substep: what is carried gives the nodes
below the outlet its momentum anew, which presses as a lower one would; and a step of APIC leaves velocities that
are no longer linear at a free surface by some hundredths of u'' dx^2. So what is laid got wider with the number of
substeps, that is, with the speed of sound. A cycle of them is one Lagrangian step of the grid, as the material point
method has it: particles stay where they are, strain and push, and nodes go on with

    m_i v_i += dt f_i(tau),   f_i and tau at the places that the cycle began with,

until at its end particles take velocities and move, by the whole time. For each substep within it the equations are
those of a finite element grid: the bounds on dt are the same, and momentum is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from fluidbench.native.crew import index_of

from .grid import turns
from .particle import EXPLICIT

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


@wp.kernel
def last(dt: wp.array(dtype=float), substeps: int, whole: wp.array(dtype=float)):
    """How long so many substeps last [s], in every world."""
    world = wp.tid()
    whole[world] = dt[world] * float(substeps)


class Keeping:
    """What keeping momenta allocates, and its launches; `keep` and `last` are Warp's whatever the solver's language."""

    def __init__(self, solver: SolverMPM) -> None:
        self.solver = solver
        self.whole, self.none = wp.zeros_like(solver.scene.dt), wp.zeros_like(solver.scene.dt)

    def prepare(self) -> None:
        self.solver.scene.crew.load(__name__)

    def go(self, substeps: int) -> None:
        """Enqueue so many substeps, in cycles."""
        for first in range(0, substeps, self.solver.together):
            self._cycle(min(self.solver.together, substeps - first))

    def _cycle(self, substeps: int) -> None:
        solver, scene = self.solver, self.solver.scene
        scene.crew.launch(last, scene.worlds, [scene.dt, substeps], [self.whole])
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
            if number < substeps - 1:
                solver.take(self.none, number, 0)
            else:
                solver.take(self.whole, number, substeps)

    def footprint(self) -> dict[str, int]:
        return {"keeping.whole": self.whole.capacity, "keeping.none": self.none.capacity}
