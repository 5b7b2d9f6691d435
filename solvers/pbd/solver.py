"""Position-based dynamics: allocation, bounds and the order of passes."""

from typing import Annotated, Any, ClassVar

import numpy as np
import warp as wp
from pydantic import Field

from fluidbench.particles import Pool
from fluidbench.scenario import Scenario
from fluidbench.scene import FRICTION, Scene
from fluidbench.solver import Config, Feature, Solver
from fluidbench.timestep import Bound

from .. import neighbours
from ..neighbours import FAULT_NEIGHBOURS, Neighbours
from ..order import CellOrder
from ..smoothing import spiky
from . import kernels_warp as kernels


class ConfigPBD(Config):
    support_ratio: Annotated[float, Field(ge=2.0, le=4.0)] = Field(2.4, description="kernel radius H over spacing")
    iterations: Annotated[int, Field(ge=1, le=200)] = Field(5, description="density iterations per substep")
    advance: Annotated[float, Field(gt=0, le=1)] = Field(0.125, description="accuracy: spacings moved per substep")
    relaxation: Annotated[float, Field(gt=0)] = Field(0.2, description="constraint force mixing epsilon")
    over_relaxation: Annotated[float, Field(gt=0, le=2)] = Field(1.0, description="factor on each Jacobi correction")
    shear_sweeps: Annotated[int, Field(ge=1, le=64)] = Field(8, description="XSPH sweeps per substep")
    shear_stiffness: Annotated[float, Field(gt=0, le=2)] = Field(
        0.5, description="largest shear modulus that a substep conveys, over rho (d / dt)^2"
    )
    calm: Annotated[float, Field(ge=0, le=1)] = Field(0.05, description="damping along lines of centres, in solids")
    skin: Annotated[float, Field(gt=0, le=1)] = Field(0.3, description="reach of the lists beyond H, over spacing")


def largest_viscosity(scenario: Scenario, config: ConfigPBD, dt: float) -> float:
    """The most that XSPH sweeps can stand for at this dt [Pa s]: rho sweeps H^2 / (22 dt) (validation C)."""
    support = config.support_ratio * scenario.spacing
    return scenario.material.density * config.shear_sweeps * support**2 / (22.0 * dt)


class SolverPBD(Solver):
    """Position-based fluids: one-sided density constraints, compliant shear bounded by yield, XSPH for viscosity."""

    name = "pbd"
    paradigm = "particles projected onto constraints; velocity follows from the change of position"
    features = frozenset(Feature) - {Feature.PRESSURE}
    Config: ClassVar = ConfigPBD
    faults: ClassVar = {FAULT_NEIGHBOURS: "matter is more than 1.7 times too dense: a neighbour list is full"}
    passes = ("predict", "lists", "multipliers", "correct", "apply", "velocities", "strain", "pull", "shear", "rub")

    typical_rate, typical_bytes = 1.2e5, 900.0

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        m, words = scenario.material, []
        dt = min(bound.dt for bound in cls.bounds(scenario, config, scenario.reference_speed))
        dt = min(dt, scenario.schedule[0])
        most = largest_viscosity(scenario, config, dt)
        if m.viscosity > most:
            words.append(f"viscosity {m.viscosity:g} Pa s acts like at most {most:.3g} Pa s (XSPH at this dt)")
        stiffest = config.shear_stiffness * m.density * (scenario.spacing / dt) ** 2
        if m.shear_modulus > 0.1 * stiffest:
            words.append(
                f"shear modulus {m.shear_modulus:.3g} Pa acts like {1 / (1 / m.shear_modulus + 1 / stiffest):.3g} Pa: "
                "one compliant constraint a substep conveys no more"
            )
        if m.yield_stress is not None or m.relaxation_time is not None:
            words.append("no isotropic tension: density constraints only push")
        return [*words, "pressure is whatever keeps rho <= rho0: no equation of state, no sound speed"]

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        d, g = scenario.spacing, scenario.peak_acceleration
        a = config.advance
        limits = [Bound("accuracy", a * d / max(speed, 1e-12), f"{a:g} d / v", "validation H: no stability bound")]
        if g > 0:
            limits.append(Bound("free fall", (a * d / g) ** 0.5, f"sqrt({a:g} d / |g|)", "same, from rest"))
        return limits

    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp") -> None:
        self.scene, self.pool, self.config = scene, pool, config
        self.num = kernels.Numbers()
        self.num.support = config.support_ratio * scene.spacing
        self.num.spacing = scene.spacing
        self.num.weight = 1.0 / _lattice_sum(config.support_ratio)
        self.num.relaxation, self.num.over_relaxation = config.relaxation, config.over_relaxation
        self.num.sweeps = config.shear_sweeps
        self.rubs = any(kind == FRICTION for kind in (*scene.box.lower_kind, *scene.box.upper_kind))
        self.num.calm = config.calm
        self.num.stiffness = config.shear_stiffness
        if scene.elastic:
            pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0))
            pool.add_field("elastic_shear", wp.vec3)
            pool.add_field("swelling", float)
        with wp.ScopedDevice(scene.device):
            self.motion = wp.zeros(pool.size, dtype=wp.vec3)
            self.correction = wp.zeros(pool.size, dtype=wp.vec3)
            self.smoothed = wp.zeros(pool.size, dtype=wp.vec3)
            self.multiplier = wp.zeros(pool.size, dtype=float)
            self.fill = wp.ones(pool.size, dtype=float)
            self.stress = wp.zeros(pool.size if scene.elastic else 1, dtype=wp.mat33)
        self.neighbours = Neighbours(scene, pool, self.num.support, config.skin * scene.spacing)
        self.pairs = self.neighbours.lists
        self.order = CellOrder(scene, pool, self.num.support)

    def refresh(self) -> None:
        self.neighbours.refresh()

    def substep(self) -> None:
        self.predict()
        self.lists()
        for _ in range(self.config.iterations):
            self.multipliers()
            self.correct()
            self.apply()
        self.velocities()
        if self.scene.elastic:
            self.strain()
            self.pull()
        if self.scene.viscous:
            for _ in range(self.config.shear_sweeps):
                self.shear()
        if self.rubs:
            self.rub()

    def _launch(self, kernel: wp.Kernel, inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, self.pool.size, inputs, outputs, device=self.scene.device)

    def _active(self) -> list[Any]:
        return [self.pool.capacity, self.pool.count]

    def predict(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            kernels.predict,
            [self.num, scene.box, *self._active(), scene.dt, scene.force, pool.held, pool.velocity],
            [pool.position, self.motion],
        )

    def lists(self) -> None:
        self.neighbours.update()

    def multipliers(self) -> None:
        pool = self.pool
        self._launch(
            kernels.multipliers,
            [self.num, self.scene.box, self.pairs, *self._active(), pool.position, pool.volume],
            [self.multiplier, self.fill],
        )

    def correct(self) -> None:
        pool = self.pool
        self._launch(
            kernels.correct,
            [self.num, self.scene.box, self.pairs, *self._active(), pool.held, pool.position, pool.volume,
             self.multiplier],
            [self.correction],
        )  # fmt: skip

    def apply(self) -> None:
        pool = self.pool
        self._launch(
            kernels.apply,
            [self.num, self.scene.box, *self._active(), pool.held, self.correction],
            [pool.position, self.motion],
        )

    def velocities(self) -> None:
        pool = self.pool
        self._launch(
            kernels.velocities,
            [*self._active(), self.scene.dt, pool.held, self.motion],
            [pool.velocity],
        )

    def strain(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            kernels.strain,
            [self.num, scene.box, self.pairs, *self._active(), scene.dt, scene.phases, pool.phase, pool.held,
             pool.position, pool.volume, pool.velocity, self.fill],
            [pool.swelling, pool.elastic_normal, pool.elastic_shear, self.stress],
        )  # fmt: skip

    def pull(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            kernels.pull,
            [self.num, scene.box, self.pairs, *self._active(), scene.dt, pool.held, pool.position, pool.volume,
             self.stress, pool.velocity],
            [self.smoothed],
        )  # fmt: skip
        wp.copy(pool.velocity, self.smoothed)

    def shear(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            kernels.shear,
            [self.num, scene.box, self.pairs, *self._active(), scene.dt, scene.phases, pool.phase, pool.held,
             pool.position, pool.volume, pool.velocity],
            [self.smoothed],
        )  # fmt: skip
        wp.copy(pool.velocity, self.smoothed)

    def rub(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            kernels.rub,
            [scene.box, *self._active(), scene.dt, pool.held, scene.spacing, scene.force, pool.position],
            [pool.velocity],
        )

    def prepare(self) -> None:
        for module in (kernels, neighbours):
            wp.load_module(module, device=self.scene.device)

    def sort_keys(self) -> Any:
        return self.order.keys()

    def densities(self) -> np.ndarray:
        rest = np.array([s.material.density for s in self.scene.scenarios]).repeat(self.pool.capacity)
        return rest * np.maximum(self.fill.numpy(), 1.0)

    def footprint(self) -> dict[str, int]:
        own = ("motion", "correction", "smoothed", "multiplier", "fill", "stress")
        return {name: getattr(self, name).capacity for name in own} | self.neighbours.footprint()


def _lattice_sum(support_ratio: float) -> float:
    """Kernel sum of unit volumes on a cubic lattice of unit spacing."""
    n = int(support_ratio) + 1
    axis = np.arange(-n, n + 1)
    r2 = sum(np.square(g) for g in np.meshgrid(axis, axis, axis))
    return float(sum(spiky(float(value), support_ratio) for value in np.sqrt(np.ravel(r2))))
