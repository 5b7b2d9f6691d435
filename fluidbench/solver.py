"""The contract that every method implements, and how methods are found.

A solver advances a pool of particles by one substep. It knows nothing of nozzles, schedules, files or measures.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from enum import Enum
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import ValidationError

from .errors import UserError, quoted, suggestion
from .model import Model
from .timestep import lost_speed

if TYPE_CHECKING:
    from .particles import Pool
    from .scenario import Scenario
    from .scene import Scene
    from .target import Target
    from .timestep import Bound

LOST = 0.1  # share of a scenario's own speed that single precision may lose
STILL = 1e-3  # reference speed of a scenario that implies no motion [m/s]: nothing can be lost
ENTRY_POINTS = "fluidbench.solvers"


class Feature(Enum):
    """What a method can honour; a scenario that needs more is refused or approximated, and the record says so."""

    PRESSURE = "pressure from an equation of state"
    VISCOSITY = "Newtonian viscosity"
    ELASTICITY = "elastic shear stress"
    YIELD = "yield stress"
    FRICTION = "Coulomb friction at walls"
    PERIODIC = "periodic axes"
    CURE = "material parameters that change with age"
    EXPANSION = "rest volumes that grow"


class Config(Model):
    """A method's own numerical settings; frozen, unknown keys refused."""


class Solver(ABC):
    """One numerical method. Subclass it, give it the class attributes below, and register the class as an entry point
    of the group `fluidbench.solvers`."""

    name: ClassVar[str]
    paradigm: ClassVar[str]
    features: ClassVar[frozenset[Feature]]
    Config: ClassVar[type[Config]]
    passes: ClassVar[tuple[str, ...]]
    faults: ClassVar[dict[int, str]] = {}
    backends: ClassVar[tuple[str, ...]] = ("warp",)
    backend: Any = None  # what runs the passes: `name`, and `wait()` for all that was launched
    typical_rate: ClassVar[float] = 1.0e6  # particle-substeps a second on one core, for estimates only
    typical_bytes: ClassVar[float] = 300.0  # bytes a particle, for estimates only

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        """Why it cannot run this scenario, in words a user understands; None when it can."""
        return None

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        """Which parts of the scenario it only approximates, one sentence each; recorded with every run."""
        return []

    @classmethod
    @abstractmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        """Every limit on dt for matter moving at up to `speed` [m/s], by name, formula and source."""

    @abstractmethod
    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        """Allocate everything the method needs: nothing is allocated later. `backend` is one of `backends`; `threads`
        are those of the CPU, for a backend that can use several."""

    @abstractmethod
    def substep(self) -> None:
        """Enqueue the passes that advance every particle by `scene.dt`.

        No host synchronisation, no allocation and no branch on device data: with Warp the whole call is captured as a
        graph.
        """

    def prepare(self) -> None:  # noqa: B027
        """Compile the kernels; timed apart from the run."""

    def refresh(self) -> None:  # noqa: B027
        """Called between substeps, outside any graph, after particles appeared, moved in memory or were moved."""

    def carried(self) -> dict[str, Any]:
        """Arrays beyond the pool's that later substeps depend on, by name: what a checkpoint must hold."""
        return {}

    def resume(self) -> None:  # noqa: B027
        """Called after the pool and what is `carried` were restored from a checkpoint, before the next substep."""

    def harden(self, due: Any) -> None:
        """Move every particle to its due row of the phase table (int, shape (worlds * capacity,)), between substeps.

        Position, velocity and stress stay as they are: curing does no work. Required of methods that can CURE.
        """
        raise NotImplementedError(f"{self.name} cannot cure")

    def sort_keys(self) -> Any | None:
        """int64 keys that put neighbours side by side, in the first half of an array of twice the pool's size; None
        to keep the order."""
        return None

    @abstractmethod
    def densities(self) -> Any:
        """Present density of every particle slot, shape (worlds * capacity,) [kg/m^3], as a NumPy array."""

    def spins(self) -> Any | None:
        """Angular momentum of every particle slot about its own centre, shape (worlds * capacity, 3) [kg m^2/s]; None
        where particles have none."""
        return None

    def shear_stresses(self) -> Any | None:
        """Elastic shear stress sqrt(J2) of every particle slot, shape (worlds * capacity,) [Pa]; None where there is
        none, or where a method carries it otherwise than by particle."""
        return None

    @abstractmethod
    def footprint(self) -> dict[str, int]:
        """Bytes allocated by the method itself, by part."""


def solver_names() -> list[str]:
    """Names of all registered methods; the shipped ones first, in the order of the paper's table."""
    order = {"mpm": 0, "sph": 1, "pbd": 2}
    return sorted({point.name for point in entry_points(group=ENTRY_POINTS)}, key=lambda n: (order.get(n, 9), n))


def get_solver(name: str) -> type[Solver]:
    """The method registered under this name; raises UserError with the nearest known name."""
    for point in entry_points(group=ENTRY_POINTS, name=name):
        return point.load()
    raise UserError(f"no solver named {quoted(name)}{suggestion(name, solver_names())}")


def check_backend(solver: type[Solver], target: Target) -> None:
    """Raise UserError unless the method has the target's backend."""
    if target.backend not in solver.backends:
        raise UserError(f"{solver.name} has no backend '{target.backend}'; it has {' and '.join(solver.backends)}")


class Demands:
    """The materials of a scenario that bound a method's step, as its matter ages: the fresh one, which may always come,
    and the most demanding one that can be there by then."""

    def __init__(self, solver: type[Solver], scenario: Scenario, config: Any) -> None:
        self.ages, materials = scenario.aged
        self.scenarios, least = [], math.inf
        for material in materials:
            made = scenario.made_of(material)
            dt = min(b.dt for b in solver.bounds(made, config, scenario.reference_speed))
            self.scenarios.append(made if dt < least else self.scenarios[-1])
            least = min(dt, least)

    def until(self, time: float) -> list[Scenario]:
        """The scenario as if made of each of those materials, up to a time [s]."""
        k = min(int(np.searchsorted(self.ages, time)), len(self.ages) - 1)
        return [self.scenarios[0]] if self.scenarios[k] is self.scenarios[0] else [self.scenarios[0], self.scenarios[k]]

    def worst(self) -> Scenario:
        """The scenario made of the most demanding material of the whole run."""
        return self.scenarios[-1]


def refusal(solver: type[Solver], scenario: Scenario, config: Any) -> str | None:
    """Why a method cannot run a scenario, for reasons of its own or for want of precision; None when it can."""
    material = scenario.material
    needs = {Feature.CURE: material.cure is not None, Feature.EXPANSION: material.expansion is not None}
    missing = [feature.value for feature, needed in needs.items() if needed and feature not in solver.features]
    if missing:
        return f"it has no {' and no '.join(missing)}"
    lost, binding = _lost(solver, scenario, config)
    if scenario.reference_speed > STILL and lost > LOST * scenario.reference_speed:
        return (
            f"its step of {binding.dt:.2g} s (bound '{binding.name}') is too small for single precision: motion slower "
            f"than {lost:.2g} m/s would stand still; soften what binds it, or use a larger spacing"
        )
    return solver.refuses(scenario, config)


def approximations(solver: type[Solver], scenario: Scenario, config: Any) -> list[str]:
    """What a method only approximates in a scenario, and the motion that its steps are too small to resolve."""
    lost, _ = _lost(solver, scenario, config)
    slow = [f"motion slower than {lost:.2g} m/s is lost in single precision at this time step"]
    return solver.approximates(scenario, config) + (slow if lost > 0.01 * scenario.reference_speed else [])


def _lost(solver: type[Solver], scenario: Scenario, config: Any) -> tuple[float, Bound]:
    worst = Demands(solver, scenario, config).worst()
    binding = min(solver.bounds(worst, config, scenario.reference_speed), key=lambda bound: bound.dt)
    domain = scenario.domain
    return lost_speed(binding.dt, max(map(abs, (*domain.lower, *domain.upper)))), binding


def configure(solver: type[Solver], scenario: Scenario) -> Any:
    """The method's Config with the scenario's `numerics` section applied; raises UserError for unknown keys."""
    given = scenario.numerics.get(solver.name, {})
    try:
        return solver.Config(**given)
    except ValidationError as error:
        item = error.errors()[0]
        key = ".".join(str(part) for part in item["loc"])
        if item["type"] == "extra_forbidden":
            raise UserError(
                f"numerics.{solver.name}: unknown key '{key}'{suggestion(key, solver.Config.model_fields)}"
            ) from None
        words = item["msg"].removeprefix("Value error, ")
        raise UserError(f"numerics.{solver.name}.{key}: {words} (got {quoted(item['input'])})") from None


def check_numerics(scenario: Scenario) -> None:
    """Raise UserError for a section of `numerics` that no method reads, or that its method refuses."""
    names = solver_names()
    for name in scenario.numerics:
        if name not in names:
            raise UserError(f"numerics.{quoted(name)[1:-1]}: no method of that name{suggestion(name, names)}")
        configure(get_solver(name), scenario)
