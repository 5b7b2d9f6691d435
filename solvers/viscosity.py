"""Viscosity implicit in time, for SPH and PBD: backward Euler on pairs, by conjugate gradients.

The velocity v at the end of a step solves K v = v*, with v* what everything else makes of it, and

    (K v)_i = v_i + dt sum_j V_j w(r) (5 mu_ij / (rho_i f_i f_j)) (r (r . u) + s (s . u)) / r^2,    u = v_i - v_j:

the viscosity of Monaghan & Gingold (1983) after Weiler et al. (2018, Comput. Graph. Forum 37:145), with a weight w that
is isotropic on a lattice (smoothing.drag_weight). s is r; only an image in a no-slip wall has it mirrored: with r alone
what i does to the image of j is not what j does to that of i, and conjugate gradients need that it is. The two differ
where a flow turns into the wall, and not in a shear.

f^2 = sum_j V_j w r^2 / 3 is a particle's fullness, 1 within matter: at a free surface half of the pairs that dissipate
are missing, and each that is there stands for more. (A block of 10 particles to a side resists stretching 13 % and
shear 22 % too little without it, 8 % too much and 7 % too little with it; all fall with 1 / n.)

Matter that grows at a rate g (d ln V / dt) moves apart by itself: u is then what it has beyond g r / 3, or pairs would
resist growth as a bulk viscosity of 5/3 mu.

The first guess is the viscous acceleration of the step before, the mass the preconditioner. Iterations end when the
root mean square of v* - K v, weighed by mass, is `tolerance` times that of v* and of dt f, what the scene's forces f
give in a step: where matter creeps, forces balance to that share of its weight, which is a velocity to a like share;
where it rests, v* is rounding, and a share of that would be solved for in vain. All that decides it stays on the
device. The velocity that is handed on is v* - (K v - v), by the forces between pairs at the v that was found: these
keep momentum and angular momentum whatever the residual.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

import warp as wp
from pydantic import Field

from fluidbench.method.timestep import Bound
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.scenario import Scenario

from . import viscosity_warp as kernels
from .backends import Backend
from .conjugate import Iterations
from .conjugate_warp import CHUNK
from .smoothing import drag_weight
from .tool_map import Radial

Scheme = Literal["auto", "explicit", "implicit"]
Tolerance = Annotated[float, Field(gt=0, le=1e-2, description="residual of implicit viscosity, over velocity and dt g")]
WORTH = 6.0  # times the substeps that explicit viscosity on pairs may take before implicit is cheaper
RESOLVED, OVER = 0.1, 5e-3  # of the slowest viscous decay, and of the time across matter, that a step may take


def decided(method: Any, scenario: Scenario, config: Any, worth: float = WORTH) -> Any:
    """The settings with `auto` decided by the bounds of the most viscous matter of a run: implicit where explicit takes
    more than `worth` times as many substeps."""
    if config.viscosity != "auto":
        return config
    thickest = max(scenario.aged[1], key=lambda m: m.viscosity)
    made = scenario.made_of(thickest)
    tried = {scheme: config.model_copy(update={"viscosity": scheme}) for scheme in ("explicit", "implicit")}
    steps = {
        scheme: min(made.schedule[0], *(b.dt for b in method.bounds(made, told, made.reference_speed)))
        for scheme, told in tried.items()
    }
    cheaper = thickest.viscosity > 0.0 and steps["explicit"] * worth < steps["implicit"]
    return tried["implicit" if cheaper else "explicit"]


def accuracy(scenario: Scenario) -> Bound:
    """What takes the place of the viscous bound: backward Euler is stable at any step, and exact to first order. A
    shear flow across the narrowest that is put in, L, decays at nu (pi / L)^2: it is resolved by ten steps, or over in
    a part of the time L / U that the scenario's own speed takes across it."""
    m, size = scenario.material, scenario.narrowest
    slowest = (size / math.pi) ** 2 * m.density / m.viscosity
    return Bound(
        "viscous accuracy",
        max(RESOLVED * slowest, OVER * size / scenario.reference_speed),
        f"{RESOLVED:g} L^2 / (pi^2 nu), or {OVER:g} L / U",
        "backward Euler, first order in time",
    )


def beside(support: float) -> dict[str, Radial]:
    """Of matter in a rigid body, as far as the `support` [m]: drag, and what it adds to fullness (tool_map.py)."""
    return {
        "drag": lambda r: drag_weight(r / support, support) / (r * r),
        "full": lambda r: drag_weight(r / support, support) * r * r / 3.0,
    }


class ImplicitViscosity:
    """What solves for the velocity of a pool under its viscosity; one a solver, everything allocated at once."""

    OWN: ClassVar[tuple[str, ...]] = ("rows", "aim", "trial", "image", "residual", "partial", "driven")

    def __init__(
        self,
        scene: Scene,
        pool: Pool,
        backend: Backend,
        neighbours: Any,
        support: float,
        tolerance: float,
        kept: wp.array | None = None,
        tool: Any = None,
    ) -> None:
        """`neighbours` hold pairs within the `support` [m]; `tolerance` is of the residual over v* and dt f [-]. Where
        elastic stress is implicit, too, `kept` is the share of each particle's that flow leaves of it; `tool` is a
        rigid body that drags along, if there is one."""
        self.tooled = tool is not None
        self.scene, self.pool, self.backend, self.neighbours = scene, pool, backend, neighbours
        self.kernels = self.kernels_of(backend.name)
        self.num = kernels.Viscous()
        self.num.support = support
        self.drag = pool.add_field("drag", wp.vec3)
        self.elastic = [int(kept is not None), pool.volume if kept is None else kept]
        worlds = len(scene.scenarios)
        chunks = pool.capacity // CHUNK
        self.summing = worlds * chunks if scene.device.is_cpu else pool.size
        with wp.ScopedDevice(scene.device):
            self.rows = wp.zeros(pool.size * kernels.DIRECTION // 4, dtype=wp.vec4)
            self.aim, self.trial, self.image, self.residual = (wp.zeros(pool.size, dtype=wp.vec3) for _ in range(4))
            self.partial = wp.zeros(worlds * chunks, dtype=wp.vec2)
            begin = wp.array([world * chunks for world in range(worlds)], dtype=int)
            self.past = wp.zeros(worlds, dtype=int)
        self.iterations = Iterations(backend, self.kernels, tolerance, begin, self.past, self.partial)
        self.applying = kernels.Applying()
        self.applying.dt, self.applying.held, self.applying.image = scene.dt, pool.held, self.image
        self.applying.mass, self.applying.volume, self.applying.rows = pool.mass, pool.volume, self.rows
        self.driven = wp.zeros(pool.size * self.tooled, dtype=wp.vec3, device=scene.device)
        if tool is not None:
            self.applying.tool = tool

    def kernels_of(self, backend: str) -> SimpleNamespace:
        if backend == "taichi":
            from . import viscosity_taichi

            return viscosity_taichi.PASSES
        return kernels.passes(self.tooled, self.scene.device.is_cpu)

    def solve(self, acceleration: wp.array, target: wp.array, impulse: bool) -> None:
        """Enqueue: v from v* = velocity + dt acceleration. What viscosity adds goes to `target`: the accelerations or,
        as an impulse, the velocities of what has moved by v* dt already."""
        pool, scene = self.pool, self.scene
        matter = [pool.position, pool.velocity, acceleration, pool.volume, self.drag, *self.elastic, int(impulse)]
        common = [scene.dt, scene.phases, pool.phase, pool.held]
        self._particles("open_solve", [*common, *matter], [self.aim, self.trial, self.rows])
        self._over_pairs("fullness")
        if self.tooled:
            self._particles("take_along", [self.applying], [self.aim, self.driven])
        self._over_pairs("image")
        if scene.grows:
            self._particles("give_growth", [pool.growth], [self.rows])
            self._over_pairs("growing")
        inputs = [pool.held, pool.mass, scene.dt, scene.force, pool.position, self.aim, self.image]
        self._particles("residual_of", inputs, [self.residual, self.rows, self.partial, self.past], self.summing)
        self.iterations.begin_with()
        self.iterations.repeat(self._iterate)
        ends = [scene.dt, pool.held, self.aim, self.trial, self.residual, int(impulse)]
        self._particles("close_solve", ends, [self.drag, target])
        if self.tooled:
            self._particles("hand_on", [self.applying, self.driven, int(impulse)], [self.drag, target])

    def _iterate(self) -> None:
        """One step of conjugate gradients; `image` is the image K p of the direction p."""
        mass, search = self.pool.mass, [self.rows, self.image]
        self._over_pairs("image")
        self._particles("along", [mass, *search], [self.partial], self.summing)
        self.iterations.step()
        moved = [self.trial, self.residual, self.partial]
        self._particles("descend", [mass, *search, self.iterations.totals], moved, self.summing)
        self.iterations.turn()
        self._particles("turn", [self.iterations.totals, self.residual], [self.rows])

    def _over_pairs(self, name: str) -> None:
        lists, pool = self.neighbours, self.pool
        common = [self.num, self.scene.box, lists.lists, pool.capacity, pool.count]
        self._launch(name, lists.work, [*common, self.rows, self.applying], [])

    def _particles(self, name: str, inputs: list[Any], outputs: list[Any], size: int = 0) -> None:
        """By particle, or by what adds up chunks of them."""
        pool = self.pool
        self._launch(name, size or pool.size, [pool.capacity, pool.count, *inputs], outputs)

    def _launch(self, name: str, size: int, inputs: list[Any], outputs: list[Any]) -> None:
        self.backend.launch(getattr(self.kernels, name), size, inputs, outputs)
