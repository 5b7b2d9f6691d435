"""Spacings that a study has time for, where it may take so long and no longer."""

from __future__ import annotations

from collections.abc import Sequence

from ..registry import get_method
from ..scenario import Scenario
from .estimate import estimate
from .selection import ENOUGH

STARTING = 4.0  # seconds before a run begins
WIDER, MOST_WIDER = 1.05, 60  # spacings are widened by this factor at a time, to 18 times at most
NEAR = (1.5, 1.25, 1.0)  # over the scenario's spacing, where it cannot be as wide as the others would have to be


def afford(wanted: Sequence[tuple[Scenario, str]], factors: Sequence[float], seconds: float) -> list[list[Scenario]]:
    """For each scenario and method, the scenario at `factors` times its spacing, all so much wider that everything
    together takes so long on one core [s], as estimated; at NEAR ones where it cannot be that wide; none where fewer
    than ENOUGH spacings can be computed.

    Everything gets an equal share, and what one leaves of its own goes to those that take longer.
    """
    found: dict[int, list[Scenario]] = {}
    left = seconds
    for i in sorted(range(len(wanted)), key=lambda i: _cost(spaced(wanted[i][0], factors), wanted[i][1])):
        found[i] = _finest(*wanted[i], factors, left / (len(wanted) - len(found)))
        left -= _cost(found[i], wanted[i][1])
    return [found[i] for i in range(len(wanted))]


def spaced(scenario: Scenario, factors: Sequence[float]) -> list[Scenario]:
    """The scenario at so many times its spacing, where it can have that."""
    found = []
    for factor in factors:
        try:
            found.append(scenario.replace(spacing=factor * scenario.spacing))
        except ValueError:
            continue
    return found


def _finest(scenario: Scenario, method: str, factors: Sequence[float], share: float) -> list[Scenario]:
    """The finest spacings within a share of the time [s]."""
    for ladder in (factors, NEAR):
        for i in range(MOST_WIDER):
            found = spaced(scenario, [WIDER**i * factor for factor in ladder])
            if len(found) < ENOUGH:
                break
            if _cost(found, method) <= share:
                return found
    return []


def _cost(scenarios: Sequence[Scenario], method: str) -> float:
    """Seconds on one core, starting included."""
    return sum(STARTING + _expected(scenario, method) for scenario in scenarios)


def _expected(scenario: Scenario, method: str) -> float:
    """Seconds on one core; none for what is refused, nor for an engine that picks its own step: it is not known."""
    made = estimate(scenario, get_method(method))
    return 0.0 if made.refusal else made.wall_s or 0.0
