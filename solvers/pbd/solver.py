"""Position-based dynamics: allocation, bounds and the order of passes."""

import math
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import numpy as np
import warp as wp
from pydantic import Field

from fluidbench.method.contract import Config, Economy
from fluidbench.method.features import Feature
from fluidbench.method.target import BACKENDS
from fluidbench.method.timestep import Bound
from fluidbench.native.pool import Pool
from fluidbench.native.scene import FRICTION, STICK, Scene
from fluidbench.native.solver import Solver
from fluidbench.scenario import Scenario

from .. import aging
from ..backends import backend_of
from ..constitutive import STRETCHED
from ..neighbours import crowded, neighbours_of, side_by_side
from ..readout import present_density
from ..search import FAULT_NEIGHBOURS
from ..smoothing import spiky
from ..viscosity import ImplicitViscosity, Tolerance, accuracy, carried_by, footprint_of
from . import bonds, laws
from . import kernels_warp as kernels
from .network import Network


class ConfigPBD(Config):
    support_ratio: Annotated[float, Field(ge=2.0, le=4.0)] = Field(2.4, description="kernel radius H over spacing")
    iterations: Annotated[int, Field(ge=1, le=200)] = Field(5, description="density iterations per substep")
    advance: Annotated[float, Field(gt=0, le=1)] = Field(0.125, description="accuracy: spacings moved per substep")
    relaxation: Annotated[float, Field(gt=0)] = Field(0.2, description="constraint force mixing epsilon")
    over_relaxation: Annotated[float, Field(gt=0, le=2)] = Field(1.0, description="factor on each Jacobi correction")
    viscous_tolerance: Tolerance = 1e-4
    shear_stiffness: Annotated[float, Field(gt=0, le=2)] = Field(
        0.5, description="largest shear modulus that a substep conveys, over rho (d / dt)^2"
    )
    calm: Annotated[float, Field(ge=0, le=1)] = Field(0.05, description="damping along lines of centres, in pastes")
    bond_sweeps: Annotated[int, Field(ge=1, le=500)] = Field(20, description="Jacobi sweeps over the bonds of solids")
    skin: Annotated[float, Field(gt=0, le=1)] = Field(0.3, description="reach of the lists beyond H, over spacing")


PRESSED = 100.0  # viscous stress over rho (d / dt)^2: what held at 42 was jammed at 416
FEATURE = 8.0  # spacings across which matter shears
STIFFEST = 0.5  # kappa in c_eff = kappa (d / dt) sqrt(sweeps), Jacobi (references.md, I)


class SolverPBD(Solver):
    """Position-based fluids: one-sided density constraints, compliant shear bounded by yield, bonds, viscosity."""

    name = "pbd"
    rank = 3
    paradigm = "particles projected onto constraints; velocity follows from the change of position"
    shares_threads = True
    features = frozenset(Feature)
    backends: ClassVar = tuple(BACKENDS)
    Config: ClassVar = ConfigPBD
    faults: ClassVar = {
        FAULT_NEIGHBOURS: "matter is more than 1.7 times too dense: a neighbour list is full",
        bonds.FAULT_BONDS: "a particle of a solid has more than 48 neighbours to bond with; make the bodies less dense",
    }
    passes = (
        "predict",
        "lists",
        "bind",
        "stretch",
        "multipliers",
        "correct",
        "apply",
        "velocities",
        "pack",
        "strain",
        "pull",
        "settle",
        "drag",
        "wall_friction",
        "follow",
    )

    typical_rate, typical_bytes = 2.5e5, 900.0
    bounded = False

    @classmethod
    def economies(cls, scenario: Scenario, config: Any) -> list[Economy]:
        return [
            Economy("fewer iterations", {"iterations": max(1, config.iterations // 2)}),
            Economy("larger dt", {"advance": min(2.0 * config.advance, 1.0)}),
            Economy("fewer neighbours", {"support_ratio": 2.0}),
        ]

    @classmethod
    def usual_dt(cls, scenario: Scenario, config: Any) -> float:
        """The time step at the scenario's own speed [s]."""
        bounds = cls.bounds(scenario, config, scenario.reference_speed)
        return min(scenario.schedule[0], *(bound.dt for bound in bounds))

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        m, dt = scenario.material, cls.usual_dt(scenario, config)
        if m.expansion is not None and (reason := crowded(m.expansion)):
            return reason
        most = laws.largest_modulus(config.shear_stiffness, m.density, scenario.spacing, dt)
        drag = m.viscosity * scenario.reference_speed / (FEATURE * scenario.spacing)
        if drag > (push := PRESSED * m.density * (scenario.spacing / dt) ** 2):
            finer = 0.5 * config.advance * math.sqrt(push / drag)
            return (
                f"its viscous stress ({drag:.3g} Pa) is too much for what constraints push in a substep (up to "
                f"{push:.3g} Pa): matter would be pressed together; set numerics.pbd.advance = {finer:.2g} or less"
            )
        if m.youngs_modulus is None or m.is_solid or m.flow_threshold < most or m.relaxation_time is not None:
            return None
        finer = 0.5 * config.advance * math.sqrt(most / m.flow_threshold)
        return (
            f"its yield stress ({m.flow_threshold:.3g} Pa) exceeds what a substep conveys ({most:.3g} Pa): "
            f"it would never yield and shake itself apart; set numerics.pbd.advance = {finer:.2g} or less"
        )

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        m, words = scenario.material, []
        dt = cls.usual_dt(scenario, config)
        if m.is_solid:
            words.append("Poisson ratio 1/4: bonds are central forces")
            stiffest = STIFFEST**2 * config.bond_sweeps * m.density * (scenario.spacing / dt) ** 2
            if m.youngs_modulus is not None and m.youngs_modulus > 0.1 * stiffest:
                words.append(f"Young's modulus beyond {stiffest:.3g} Pa acts like that: sweeps convey no more")
        elif m.youngs_modulus is not None:
            acts = laws.conveyed_modulus(m.shear_modulus, config.shear_stiffness, m.density, scenario.spacing, dt)
            if acts < 0.9 * m.shear_modulus:
                words.append(
                    f"shear modulus {m.shear_modulus:.3g} Pa acts like {acts:.3g} Pa: one compliant constraint "
                    "a substep conveys no more"
                )
            words.append("no isotropic tension: density constraints only push")
        return [*words, "pressure is whatever keeps rho <= rho0: no equation of state, no sound speed"]

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        d, g = scenario.spacing, scenario.peak_acceleration
        a = config.advance
        limits = [Bound("accuracy", a * d / max(speed, 1e-12), f"{a:g} d / v", "references.md, H: no stability bound")]
        if g > 0:
            limits.append(Bound("free fall", (a * d / g) ** 0.5, f"sqrt({a:g} d / |g|)", "same, from rest"))
        if scenario.material.viscosity > 0:
            limits.append(accuracy(scenario))
        return limits

    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        self.scene, self.pool, self.config = scene, pool, config
        self.backend = backend_of(backend, scene, threads)
        self.kernels = self.kernels_of(backend)
        self.num = kernels.Numbers()
        self.num.support = config.support_ratio * scene.spacing
        self.num.spacing = scene.spacing
        self.num.weight = 1.0 / _lattice_sum(config.support_ratio)
        self.num.relaxation, self.num.over_relaxation = config.relaxation, config.over_relaxation
        kinds = (*scene.box.lower_kind, *scene.box.upper_kind)
        self.wall_friction_acts = FRICTION in kinds or (bonds.needed(scene) and STICK in kinds)
        self.num.calm = config.calm
        self.num.stiffness = config.shear_stiffness
        if scene.flowing:
            pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0), within=(1.0 / STRETCHED, STRETCHED))
            pool.add_field("elastic_shear", wp.vec3)
        self.network = Network(scene, pool, self.backend, self.kernels) if bonds.needed(scene) else None
        with wp.ScopedDevice(scene.device):
            self.motion = wp.zeros(pool.size, dtype=wp.vec3)
            self.correction = wp.zeros(pool.size, dtype=wp.vec3)
            self.smoothed = wp.zeros(pool.size, dtype=wp.vec3)
            self.fill = wp.ones(pool.size, dtype=float)
            self.places = wp.zeros(pool.size * kernels.PLACE // 4, dtype=wp.vec4)
            self.pushes = wp.zeros(pool.size * kernels.PUSH // 4, dtype=wp.vec4)
            self.moving = wp.zeros(pool.size * kernels.MOVING // 4 if scene.flowing else 1, dtype=wp.vec4)
            self.pulling = wp.zeros(pool.size * kernels.PULLING // 4 if scene.flowing else 1, dtype=wp.vec4)
        self.neighbours = neighbours_of(scene, pool, self.backend, self.num.support, config.skin * scene.spacing)
        self._bring_together()
        self.order = side_by_side(scene, pool)
        self.viscosity = None
        if scene.viscous:
            support, tolerance = self.num.support, config.viscous_tolerance
            self.viscosity = ImplicitViscosity(scene, pool, self.backend, self.neighbours, support, tolerance)
            self.still = wp.zeros(pool.size, dtype=wp.vec3, device=scene.device)

    def kernels_of(self, backend: str) -> SimpleNamespace:
        """The passes in a backend's language, those of bonds where the scene has any."""
        if backend == "taichi":
            from . import bonds_taichi, kernels_taichi

            fluid, solid = kernels_taichi.PASSES, bonds_taichi.PASSES
        else:
            fluid, solid = kernels.passes(self.scene.device.is_cpu), bonds.PASSES
        return SimpleNamespace(**vars(fluid), **(vars(solid) if bonds.needed(self.scene) else {}))

    def _bring_together(self) -> None:
        """What the passes over pairs read and write, as they take it."""
        pool, scene = self.pool, self.scene
        self.constraining, self.shearing = kernels.Constraining(), kernels.Shearing()
        for data in (self.constraining, self.shearing):
            data.phases, data.phase_of, data.held = scene.phases, pool.phase, pool.held
        self.constraining.pushes, self.constraining.fill = self.pushes, self.fill
        self.constraining.correction = self.correction
        elastic = [pool.elastic_normal, pool.elastic_shear] if scene.flowing else [self.motion, self.motion]
        self.shearing.elastic_normal, self.shearing.elastic_shear = elastic
        self.shearing.dt, self.shearing.mass, self.shearing.volume = scene.dt, pool.mass, pool.volume
        self.shearing.pulling, self.shearing.smoothed = self.pulling, self.smoothed

    def refresh(self) -> None:
        self.neighbours.refresh()

    def substep(self) -> None:
        if self.scene.grows:
            self.swell()
        self.predict()
        self.lists()
        if self.network is not None:
            self.bind()
            for sweep in range(self.config.bond_sweeps):
                self.stretch(sweep)
                self.apply()
            if self.scene.cures:
                self.network.flow()
        for _ in range(self.config.iterations):
            self.multipliers()
            self.correct()
            self.apply()
        self.velocities()
        if self.scene.flowing:
            self.pack()
            self.strain()
            self.pull()
            self.settle()
        self.drag()
        if self.wall_friction_acts:
            self.wall_friction()
        if self.scene.viscous:
            self.follow()

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        self.backend.launch(kernel, self.pool.size, inputs, outputs)

    def _active(self) -> list[Any]:
        return [self.pool.capacity, self.pool.count]

    def swell(self) -> None:
        self.scene.crew.launch(
            aging.swell,
            self.pool.size,
            [*self._active(), self.scene.dt, self.pool.growth],
            [self.pool.volume],
        )

    def harden(self, due: wp.array) -> None:
        pool, flowing = self.pool, self.scene.flowing
        tensor = [pool.elastic_normal, pool.elastic_shear] if flowing else [self.motion, self.motion]
        if self.network is not None:
            self.network.relieve(due)
        self.scene.crew.launch(
            aging.harden,
            pool.size,
            [int(flowing), *self._active(), self.scene.phases, due],
            [pool.phase, *tensor],
        )

    def predict(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            self.kernels.predict,
            [self.num, scene.box, *self._active(), scene.dt, scene.force, pool.held, pool.velocity, pool.volume],
            [pool.position, self.motion, self.places, pool.fault],
        )

    def lists(self) -> None:
        self.neighbours.update()

    def bind(self) -> None:
        assert self.network is not None
        self.network.bind(self.neighbours.lists)

    def stretch(self, sweep: int = 0) -> None:
        assert self.network is not None
        self.network.stretch(sweep, self.correction)

    def _over_pairs(self, kernel: Any, rows: wp.array, data: Any) -> None:
        lists = self.neighbours
        common = [self.num, self.scene.box, lists.lists, *self._active()]
        self.backend.launch(kernel, lists.work, [*common, rows, data])

    def multipliers(self) -> None:
        self._over_pairs(self.kernels.multipliers, self.places, self.constraining)

    def correct(self) -> None:
        self._over_pairs(self.kernels.correct, self.pushes, self.constraining)

    def apply(self) -> None:
        pool = self.pool
        self._launch(
            self.kernels.apply,
            [self.num, self.scene.box, *self._active(), pool.held, self.correction, pool.volume],
            [pool.position, self.motion, self.places, pool.fault],
        )

    def velocities(self) -> None:
        pool = self.pool
        self._launch(
            self.kernels.velocities,
            [*self._active(), self.scene.dt, pool.held, self.motion],
            [pool.velocity],
        )

    def pack(self) -> None:
        pool = self.pool
        self._launch(self.kernels.pack, [*self._active(), pool.position, pool.volume, pool.velocity], [self.moving])

    def strain(self) -> None:
        self._over_pairs(self.kernels.strain, self.moving, self.shearing)

    def pull(self) -> None:
        self._over_pairs(self.kernels.pull, self.pulling, self.shearing)

    def drag(self) -> None:
        if self.viscosity is not None:
            self.viscosity.solve(self.still, self.pool.velocity, impulse=True)

    def follow(self) -> None:
        pool, scene = self.pool, self.scene
        inputs = [self.num, scene.box, *self._active(), scene.dt, pool.held, pool.velocity, self.motion]
        self._launch(self.kernels.follow, inputs, [pool.position])

    def settle(self) -> None:
        self._launch(self.kernels.settle, [*self._active(), self.smoothed], [self.pool.velocity, self.moving])

    def wall_friction(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            self.kernels.wall_friction,
            [
                scene.box,
                *self._active(),
                scene.dt,
                pool.held,
                scene.spacing,
                scene.phases,
                pool.phase,
                scene.force,
                pool.position,
            ],
            [pool.velocity],
        )

    def prepare(self) -> None:
        if self.scene.changes:
            self.scene.crew.load(aging)
        self.neighbours.prepare()
        self.order.prepare()
        self.backend.prepare(self)

    def carried(self) -> dict[str, Any]:
        network = {} if self.network is None else self.network.carried()
        return {"fill": self.fill, **self.neighbours.carried(), **network, **carried_by(self.viscosity)}

    def sort_keys(self) -> Any:
        return self.order.keys() if self.network is None else None  # bonds name their partners by slot

    def solves(self) -> dict[str, float]:
        return {} if self.viscosity is None else self.viscosity.effort()

    def densities(self) -> np.ndarray:
        return present_density(self.pool, 1.0 / np.maximum(self.fill.numpy(), 1.0))

    def traffic(self) -> dict[str, float]:
        """Bonds left out."""
        rows = [kernels.PLACE, kernels.PUSH] * self.config.iterations
        rows += [kernels.MOVING, kernels.PULLING] * self.scene.flowing
        return self.neighbours.traffic(rows)

    def footprint(self) -> dict[str, int]:
        own = ("motion", "correction", "smoothed", "fill", "places", "pushes", "moving", "pulling")
        bytes_of = {name: getattr(self, name).capacity for name in own} | self.neighbours.footprint()
        return bytes_of | (self.network.footprint() if self.network else {}) | footprint_of(self.viscosity)


def _lattice_sum(support_ratio: float) -> float:
    """Kernel sum of unit volumes on a cubic lattice of unit spacing."""
    n = int(support_ratio) + 1
    axis = np.arange(-n, n + 1)
    r2 = sum(np.square(g) for g in np.meshgrid(axis, axis, axis))
    return float(sum(spiky(float(value), support_ratio) for value in np.sqrt(np.ravel(r2))))
