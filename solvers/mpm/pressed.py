"""Whether MPM can press matter through a rigid body."""

from typing import Any

from fluidbench.scenario import Scenario
from fluidbench.scenario.stream import COLUMN

from .grid import cells_of

ACROSS = 6.0  # cells across a bore: with fewer its resistance can be off by more than 10 % (docs/physics)
THICK = (
    2.75  # cells of a wall: nodes behind the middle of a thinner one, which matter still reaches, are tied to its back
)


def unpressed(scenario: Scenario, config: Any) -> str | None:
    """Why it cannot: where viscosity is solved for no nodes are tied (tied.py), or what feeds a bore ends within reach
    of what flows; None where it can, or there is no body."""
    if scenario.fed_from is None:
        return None
    if config.viscosity == "implicit":
        return "it does not solve for viscosity beside a body; use numerics.mpm.viscosity = 'explicit'"
    dx = float(cells_of(scenario.domain, config.grid_ratio * scenario.spacing)[1][2])
    if (COLUMN - 0.5) * scenario.spacing < 1.5 * dx:
        return f"its cells ({dx:.3g} m) are too large to feed a bore; use numerics.mpm.grid_ratio = 1"
    return None


def roughly_pressed(scenario: Scenario, config: Any) -> list[str]:
    """What a coarse grid makes of a bore and of the wall about it."""
    if scenario.fed_from is None:
        return []
    cell = config.grid_ratio * scenario.spacing
    cells, thick = scenario.narrowest / cell, scenario.wall_thickness / cell
    better, told = "; use numerics.mpm.grid_ratio = 1 or a smaller spacing", []
    if cells < ACROSS:
        told.append(
            f"what it presses through is {cells:.2g} cells wide: below {ACROSS:g} its resistance can be off by more "
            f"than 10 %{better}"
        )
    if thick < THICK:
        told.append(f"the wall about it is {thick:.2g} cells thick: below {THICK:g} pressure leaks through it{better}")
    return told
