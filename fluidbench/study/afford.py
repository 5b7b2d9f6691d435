"""Spacings that a study tries: those that a scenario can have, and that there is time for."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from functools import partial

from ..errors import UserError
from ..registry import get_method
from ..scenario import Scenario
from .estimate import estimate
from .selection import ENOUGH

STARTING = 4.0  # seconds before a run begins
STEP = 1.05  # spacings are widened by this factor at a time
FINEST, WIDEST = -14, 60  # times: from half of what they were, where there is time, to 18 times
NARROW = ((1.5, 1.25, 1.0), (1.0, 0.85, 0.7))  # over the scenario's spacing, where it cannot be as wide as is wanted

Cost = Callable[[Sequence[Scenario]], float]  # seconds that runs take


def spacings(scenario: Scenario, factors: Sequence[float]) -> list[Scenario]:
    """The scenario at so many times its spacing, where it can have that; at NARROW ones where that leaves fewer than
    ENOUGH; none where those do, too."""
    return next((found for ladder in (factors, *NARROW) if len(found := _spaced(scenario, ladder)) >= ENOUGH), [])


def afford(
    wanted: Sequence[tuple[Scenario, str]], factors: Sequence[float], seconds: float, paces: Sequence[float]
) -> list[list[Scenario]]:
    """For each scenario and method its `spacings`, all so much finer or wider that everything together takes so long on
    one core [s], with runs that take `paces` times as long as estimated; none where ENOUGH of them would take longer
    than their share.

    Everything gets an equal share, and what one leaves of its own goes to those that take longer.
    """

    def cost(i: int, scenarios: Sequence[Scenario]) -> float:
        """Seconds on one core, starting included."""
        return sum(STARTING + paces[i] * expected(scenario, wanted[i][1]) for scenario in scenarios)

    found: dict[int, list[Scenario]] = {}
    left = seconds
    for i in sorted(range(len(wanted)), key=lambda i: cost(i, spacings(wanted[i][0], factors))):
        found[i] = _finest(wanted[i][0], factors, left / (len(wanted) - len(found)), partial(cost, i))
        left -= cost(i, found[i])
    return [found[i] for i in range(len(wanted))]


def expected(scenario: Scenario, method: str) -> float:
    """Seconds on one core; none for what is refused, nor for an engine that picks its own step: it is not known."""
    made = estimate(scenario, get_method(method))
    return 0.0 if made.refusal else made.wall_s or 0.0


def _spaced(scenario: Scenario, factors: Sequence[float]) -> list[Scenario]:
    found = []
    for factor in factors:
        try:
            found.append(scenario.replace(spacing=factor * scenario.spacing))
        except UserError:
            continue
    return found


def _finest(scenario: Scenario, factors: Sequence[float], share: float, cost: Cost) -> list[Scenario]:
    """The finest spacings within a share of the time [s]: of `factors`, or else of the first NARROW ones."""
    return next((found for f in (factors, *NARROW) if (found := _widened(scenario, f, share, cost))), [])


def _widened(scenario: Scenario, factors: Sequence[float], share: float, cost: Cost) -> list[Scenario]:
    def wider(i: int) -> list[Scenario]:
        return _spaced(scenario, [STEP**i * factor for factor in factors])

    most = _first(range(FINEST, WIDEST), lambda i: len(wider(i)) < ENOUGH)
    i = _first(range(FINEST, most), lambda i: cost(wider(i)) <= share)
    return wider(i) if i < most else []


def _first(numbers: range, holds: Callable[[int], bool]) -> int:
    """The first number from which on something holds; one after the last where it never does."""
    return numbers.start + bisect_left(numbers, True, key=holds)
