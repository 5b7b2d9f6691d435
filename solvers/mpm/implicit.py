"""Viscosity implicit in time, for MPM: backward Euler on the grid, by conjugate gradients.

p* are the momenta that particles scatter, B what makes velocities of the nodes from momenta: one over their mass, the
walls, and nothing where the piston is (piston.py). Viscosity adds the momenta -dt A v at the velocities v = B q at the
end of the step,

    (1 + dt A B) q = p*,    (A v)_i = 4 / dx^2 sum_p w_ip V_p 2 eta dev(D_p) (x_i - x_p),    D_p = sym C_p(v):

the forces of the explicit step (Hu et al. 2018, eq. 18) with C_p gathered from v itself. A and B are symmetric, A is
positive semidefinite: 1 + dt A B is self-adjoint in the inner product p.B q, that of energy, and conjugate gradients
need a gather, a scatter and one B an iteration. (Stomakhin et al. 2013, ACM TOG 32:102, solve for elasticity so.)

The first guess is that nothing is accelerated; the mass is the preconditioner (in B). Iterations end when the energy of
the residual is `tolerance`^2 times that of v* and of dt f, what the scene's forces f give in a step (viscosity.py says
why). What is handed on is v + B r: the velocity by the forces at the v that was found, which keep momentum whatever the
residual.

A rough wall's friction depends on what presses: B is not linear there, and no scenario with one is solved so.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import warp as wp

from fluidbench.native.scene import Force

from ..conjugate import Iterations
from . import implicit_warp as kernels
from .ranks import PARTS, Ranks

if TYPE_CHECKING:
    from .solver import SolverMPM


class GridViscosity:
    """What solves for the velocities of the nodes under viscosity; one a solver, everything allocated at once."""

    OWN: ClassVar[tuple[str, ...]] = ("residual", "answer", "impulse", "search", "image", "partial")

    def __init__(self, solver: SolverMPM, tolerance: float) -> None:
        """`tolerance` is of the residual over v* and dt f [-]."""
        self.solver, self.kernels = solver, self.kernels_of(solver)
        scene, slots = solver.scene, len(solver.block_of)
        self.worlds = len(scene.scenarios)
        with wp.ScopedDevice(scene.device):
            nodes = [wp.zeros(slots * 64, dtype=wp.vec4) for _ in range(5)]
            self.residual, self.answer, self.impulse, self.search, self.image = nodes
            self.partial = wp.zeros(slots * int(PARTS), dtype=wp.vec2)
            self.no_time = wp.zeros(self.worlds, dtype=float)
            self.no_force: wp.array = wp.zeros(self.worlds, dtype=Force)
            self.ranks = Ranks()
            self.ranks.number = wp.zeros(slots, dtype=int)
            self.ranks.many, self.ranks.begin = wp.zeros(self.worlds, dtype=int), wp.zeros(self.worlds + 1, dtype=int)
        begin = self.ranks.begin
        self.iterations = Iterations(solver.backend, self.kernels, tolerance, begin, begin[1:], self.partial)

    def kernels_of(self, solver: SolverMPM) -> SimpleNamespace:
        if solver.backend.name == "taichi":
            from . import implicit_taichi

            return implicit_taichi.passes(alone=solver.alone)
        return kernels.passes()

    def solve(self) -> None:
        """Enqueue: velocities of the nodes, `moving`, from v* = `moving`, which came of the momenta `raw`."""
        s, scene = self.solver, self.solver.scene
        self._line_up()
        s.empty(self.residual)
        s.scatter(self.no_time, self.residual)
        inputs = [s.raw, scene.dt, scene.force]
        self._nodes("guess", [s.grid, *self._lanes(), s.block_of, *inputs], [self.residual])
        self._apply()
        self._sums("start", [*inputs, self.answer], [s.moving, self.image, self.partial])
        s.resist(s.moving, self.image)
        self._nodes("residual_of", [*self._lanes(), self.image], [self.residual])
        self._apply()
        direction = [self.impulse, self.search, self.image]
        self._nodes("set_out", [*self._lanes(), self.residual, self.answer], direction)
        self._sums("along", [self.residual, self.answer], [self.partial])
        self.iterations.begin_with()
        self.iterations.repeat(self._iterate)
        self._nodes("close", [*self._lanes(), self.answer], [s.moving])

    def _iterate(self) -> None:
        """One step of conjugate gradients."""
        s, direction = self.solver, [self.impulse, self.search, self.image]
        worlds = [s.grid, *self._lanes(), s.block_of, self.iterations.totals]
        s.resist(self.search, self.image)
        self._sums("along", [self.image, self.search], [self.partial])
        self.iterations.step()
        self._nodes("descend", [*worlds, self.search, self.image], [s.moving, self.residual])
        self._apply()
        self._sums("along", [self.residual, self.answer], [self.partial])
        self.iterations.turn()
        self._nodes("turn", [*worlds, self.residual, self.answer], direction)

    def _line_up(self) -> None:
        s = self.solver
        if s.by_block is not None:
            self._launch("line_up", 1, [self.worlds, s.grid, s.table], [self.ranks])
            return
        self._launch("count_off", s.node_lanes, [s.node_lanes, s.grid, s.active, s.block_of], [self.ranks])
        self._launch("divide", 1, [self.worlds], [self.ranks])

    def _apply(self) -> None:
        """answer = B residual."""
        self.solver.walled(self.residual, self.no_force, self.solver.unmoved, self.answer)

    def _lanes(self) -> list[Any]:
        return [self.solver.node_lanes, self.solver.active]

    def _nodes(self, name: str, inputs: list[Any], outputs: list[Any]) -> None:
        self._launch(name, self.solver.node_lanes, inputs, outputs)

    def _sums(self, name: str, inputs: list[Any], outputs: list[Any]) -> None:
        s = self.solver
        self._nodes(name, [s.grid, *self._lanes(), s.block_of, self.ranks, *inputs], outputs)

    def _launch(self, name: str, size: int, inputs: list[Any], outputs: list[Any]) -> None:
        self.solver.backend.launch(getattr(self.kernels, name), size, inputs, outputs)
