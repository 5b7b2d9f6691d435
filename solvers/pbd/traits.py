"""What PBD is, and what it says of a scenario before anything is allocated."""

from typing import Any, ClassVar

from fluidbench.method.contract import Economy
from fluidbench.method.features import Feature
from fluidbench.method.target import BACKENDS
from fluidbench.method.timestep import Bound
from fluidbench.native.solver import Solver
from fluidbench.scenario import Scenario

from ..backends import LACKING
from ..neighbours import crowded
from ..search import FAULT_NEIGHBOURS
from .bounds import bounds_of, iterations_of
from .config import ConfigPBD


class TraitsPBD(Solver):
    """What the method is, can do, refuses and costs."""

    name = "pbd"
    rank = 3
    paradigm = "particles projected onto constraints; velocity follows from the change of position"
    shares_threads = makes_room = True
    features = frozenset(Feature)
    backends: ClassVar = tuple(BACKENDS)
    lacking: ClassVar = LACKING
    Config: ClassVar = ConfigPBD
    faults: ClassVar = {
        FAULT_NEIGHBOURS: "matter is more than 1.7 times too dense: a neighbour list is full",
    }

    typical_rate, typical_bytes = 1.5e5, 1300.0
    bounded = False

    @classmethod
    def decided(cls, scenario: Scenario, config: Any) -> Any:
        if config.iterations is not None:
            return config
        return config.model_copy(update={"iterations": iterations_of(scenario, config)})

    @classmethod
    def economies(cls, scenario: Scenario, config: Any) -> list[Economy]:
        return [
            Economy("fewer iterations", {"iterations": max(1, config.iterations // 2)}),
            Economy("larger dt", {"advance": min(2.0 * config.advance, 1.0)}),
            Economy("fewer neighbours", {"support_ratio": 2.0}),
        ]

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        m = scenario.material
        if m.expansion is not None and (reason := crowded(m.expansion)):
            return reason
        if m.is_solid and scenario.emits:
            return (
                f"a solid is fed in (it yields at {m.flow_threshold:.3g} Pa, and its shear modulus is "
                f"{m.shear_modulus:.3g} Pa): pieces that break off are torn on by gradients of velocity; set a "
                "material.yield_stress below the shear modulus"
            )
        return None

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        m, words = scenario.material, []
        if m.youngs_modulus is not None:
            words.append("elastic waves are damped: backward Euler takes w dt / 2 of one of frequency w in a radian")
        if (m.youngs_modulus is not None or m.viscosity > 0.0) and not m.is_solid:
            words.append("isotropic tension is a density constraint's: it draws together what lies within matter")
        return [*words, "pressure is whatever keeps rho <= rho0: no equation of state, no sound speed"]

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        return bounds_of(scenario, config, speed)
