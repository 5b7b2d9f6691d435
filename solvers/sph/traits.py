"""What SPH is, and what it says of a scenario before anything is allocated."""

from typing import Any, ClassVar

from fluidbench.method.contract import Economy
from fluidbench.method.features import Feature
from fluidbench.method.target import BACKENDS
from fluidbench.method.timestep import Bound
from fluidbench.native.solver import Solver
from fluidbench.scenario import Scenario

from ..backends import LACKING
from ..lattice import drag_rate
from ..neighbours import crowded
from ..search import FAULT_NEIGHBOURS
from ..theory import sph_waves, stable_dt
from ..viscosity import WORTH, decided
from .bounds import SHOCK_RATE, bounds_of, damping
from .config import ConfigSPH
from .particle import THINNEST

SPRAYED = 3.0  # particles across what is fed below which a paste that lands is sprayed: seen at 2.4, not at 3.4
FASTEST = 0.8  # Mach number beyond which shocks make matter too dense for its lists
FASTEST_GROWTH = 0.3  # the same for foam that expands: its halves are pressed together


class TraitsSPH(Solver):
    """What the method is, can do, refuses and costs."""

    name = "sph"
    rank = 2
    paradigm = "Lagrangian particles, kernel sums over neighbours, pressure from an equation of state"
    shares_threads = True
    features = frozenset(Feature)
    backends: ClassVar = tuple(BACKENDS)
    lacking: ClassVar = LACKING
    Config: ClassVar = ConfigSPH
    faults: ClassVar = {FAULT_NEIGHBOURS: "matter is more than 1.7 times too dense: a neighbour list is full"}

    typical_rate, typical_bytes = 5.0e5, 1400.0
    bare: ClassVar = {
        "density_diffusion": 0.0,
        "density_feedback": 0.0,
        "artificial_viscosity": 0.0,
        "artificial_viscosity_solid": 0.0,
        "hourglass": 0.0,
        "shifting": 0.0,
        "viscosity": "explicit",  # `auto` makes a thick block implicit, whose limit is another
    }

    @classmethod
    def weight_of_a_step(cls, scenario: Scenario, config: Any) -> float:
        return WORTH if config.viscosity == "implicit" else 1.0

    @classmethod
    def decided(cls, scenario: Scenario, config: Any) -> Any:
        return decided(cls, scenario, config)

    @classmethod
    def economies(cls, scenario: Scenario, config: Any) -> list[Economy]:
        key = config.smoothing_key(scenario.material)
        return [
            Economy("fewer neighbours", {key: round(max(0.8 * getattr(config, key), 1.2), 3)}),
            Economy("larger dt", {"cfl": 2.0 * config.cfl, "viscous_number": 0.1}),
            Economy("no shifting", {"shifting": 0.0}),
        ]

    @classmethod
    def theory(cls, scenario: Scenario, config: Any) -> float:
        ratio = config.smoothing(scenario.material)
        if config.viscosity == "implicit":
            scenario = scenario.made_of(scenario.material.model_copy(update={"viscosity": 0.0}))
        # own steps hold for thin matter, theory is of a lattice that goes on for ever
        longest = 2.0 / (ratio * ratio * drag_rate((0, 0, 0), 2.0 * ratio, THINNEST))
        viscous = longest * damping(scenario, ratio) / (SHOCK_RATE * config.viscous_number)
        return stable_dt(cls, scenario, config, sph_waves(ratio) / config.cfl, viscous)

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        across = scenario.narrowest / scenario.spacing
        if not scenario.emits or not scenario.material.elastic or across >= SPRAYED:
            return []
        return [f"{across:.2g} particles across what is fed: below {SPRAYED:g} what lands is sprayed about"]

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        speed, c = scenario.reference_speed, scenario.wave_speed
        expansion = scenario.material.expansion
        if expansion is not None and (reason := crowded(expansion)):
            return reason
        if speed < (FASTEST if expansion is None else FASTEST_GROWTH) * c:
            return None
        return (
            f"it moves at {speed:.3g} m/s, too near its own sound ({c:.3g} m/s): particles would be pushed "
            "through each other; raise material.youngs_modulus, bulk_modulus or sound_speed"
        )

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        return bounds_of(scenario, config, speed)
