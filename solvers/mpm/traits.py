"""What MPM is, and what it says of a scenario before anything is allocated."""

import math
from typing import Any, ClassVar

from fluidbench.method.contract import Economy, NumericalAxis
from fluidbench.method.features import Feature
from fluidbench.method.target import BACKENDS
from fluidbench.method.timestep import Bound
from fluidbench.native.solver import Solver
from fluidbench.scenario import Scenario

from ..backends import LACKING
from ..theory import mpm_numbers, stable_dt
from ..viscosity import decided
from .bounds import bounds_of
from .config import ConfigMPM
from .grid import FAULT_BLOCKS, MAX_BLOCKS, blocks_of
from .particle import FAULT_STENCIL
from .pressed import roughly_pressed, unpressed

WORTH = 16.0  # times the substeps explicit viscosity may take before implicit is cheaper: docs/physics/viscosity.md


class TraitsMPM(Solver):
    """What the method is, can do, refuses and costs."""

    name = "mpm"
    rank = 1
    paradigm = "hybrid: particles carry state, a background grid carries momentum"
    shares_threads = True
    features = frozenset(Feature)
    backends: ClassVar = tuple(BACKENDS)
    lacking: ClassVar = LACKING
    Config: ClassVar = ConfigMPM
    faults: ClassVar = {
        FAULT_BLOCKS: "material spread over more grid blocks than allocated; raise numerics.mpm.blocks_per_particle",
        FAULT_STENCIL: "a particle left the blocks of the grid within one step",
    }

    typical_rate, typical_bytes = 4.0e6, 4000.0
    bare: ClassVar = {"viscosity": "explicit"}  # `auto` makes a thick block implicit, whose limit is another
    axes: ClassVar = (NumericalAxis("particles_per_cell", "grid_ratio", (1, 2, 4, 8, 27), (1, 8, 27), "-", 1 / 3),)

    @classmethod
    def weight_of_a_step(cls, scenario: Scenario, config: Any) -> float:
        return WORTH if config.viscosity == "implicit" else 1.0

    @classmethod
    def decided(cls, scenario: Scenario, config: Any) -> Any:
        only = scenario.domain.rubs or scenario.outline is not None
        return decided(cls, scenario, config, math.inf if only else WORTH)

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        blocks = blocks_of(scenario.domain, config.grid_ratio * scenario.spacing)
        if blocks > MAX_BLOCKS:
            return f"the domain holds {blocks:.3g} grid blocks; use a smaller domain or a larger spacing"
        if reason := unpressed(scenario, config):
            return reason
        if config.viscosity == "implicit" and scenario.domain.rubs:
            return "its walls have friction, which implicit viscosity knows nothing of; use viscosity = 'explicit'"
        return None

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        return roughly_pressed(scenario, config)

    @classmethod
    def memory(cls, scenario: Scenario, config: Any, particles: int) -> float:
        index = 4.0 * blocks_of(scenario.domain, config.grid_ratio * scenario.spacing)  # of every block, used or not
        solve = 5.0 * 64.0 * 16.0 * config.blocks_per_particle * particles  # nodes of its five arrays
        return super().memory(scenario, config, particles) + index + (solve if config.viscosity == "implicit" else 0.0)

    @classmethod
    def economies(cls, scenario: Scenario, config: Any) -> list[Economy]:
        return [
            Economy("coarser grid", {"grid_ratio": round(min(1.33 * config.grid_ratio, 4.0), 3)}),
            Economy("larger dt", {"safety": 1.0}),
            Economy("no shifting", {"shifting": 0.0, "separation": 0.0}),
        ]

    @classmethod
    def theory(cls, scenario: Scenario, config: Any) -> float:
        return stable_dt(cls, scenario, config, *mpm_numbers(config.safety))

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        return bounds_of(scenario, config, speed)
