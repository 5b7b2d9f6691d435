"""`select`: which method and spacing meet a tolerance at least cost on this machine, and on what evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from ..errors import UserError
from ..registry import get_method
from ..runs.job import Job
from ..scenario import Scenario
from ..scenario.measured import Measured
from .estimate import estimate
from .result import Result
from .select_report import report
from .selection import ENOUGH, FACTORS, FINEST, Selection, assess
from .workplace import Options, Workplace, as_scenario, measured_of, methods_of, require_number

WALL_LIMIT = 900.0  # s
STARTING = 4.0  # seconds before a run begins
WIDER, MOST_WIDER = 1.05, 60  # spacings are widened by this factor at a time, to 18 times at most


@dataclass(repr=False)
class Selected(Result):
    """A recommendation with its evidence: `table` has a row for every candidate; `found` is all that it rests on."""

    found: Selection = field(default_factory=lambda: Selection([], {}, {}, []))


def select(
    scenario: Scenario | str | Path,
    methods: Sequence[str] | None = None,
    *,
    tolerance: float = 0.05,
    budget: float = math.inf,
    pace: float = math.inf,
    within: float = math.inf,
    called: str = "",
    measured: str | Path | Sequence[Measured] = (),
    **options: Unpack[Options],
) -> Selected:
    """Recommend a method, spacing and time step: least cost within a `tolerance` (largest relative error of any
    length), within a `budget` of time [s] and a `pace` (s per simulated s), on this machine.

    Runs every method at four spacings, on a GPU at five. `scenario` is one, a shipped name or a TOML file; `methods`
    are names, default all. `called` is the scenario's name in the command that it recommends. `measured`: a table of
    what was measured on a real print (CSV), which errors are then counted from, beside what the scenario has of it.
    `within`: time [s] that the study may take, as estimated: spacings are coarser, for each method as much as it needs;
    on a CPU alone. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    require_number(tolerance, "tolerance", 1e-6)
    if within != math.inf:
        require_number(within, "within", 1.0)
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    beside = measured_of(resolved, measured)
    if within < math.inf and place.target.device != "cpu":
        raise UserError("within: time is estimated for a CPU alone")
    planned, notes = candidates(resolved, names, place, within)
    if not planned:
        raise UserError(f"within {within:g} s: {'; '.join(notes)}")
    found = assess(resolved, names, place.run(planned, "select", together=shares_cores(place)), beside)
    found.notes[:0] = notes
    made = report(resolved, called or resolved.name, found, tolerance, budget, pace, place.store.root)
    missing = found.missing()
    ok = bool(found.candidates) and not missing
    return Selected(made, place.store.root, found.runs, missing, ok, place.keeper, found)


def shares_cores(place: Workplace) -> bool:
    """Whether runs may go side by side: where what they cost is the CPU time of one core."""
    return place.target.device == "cpu" and place.target.threads == 1


def candidates(
    scenario: Scenario, methods: Sequence[str], place: Workplace, within: float = math.inf
) -> tuple[list[Job], list[str]]:
    """(every method at every spacing that the scenario can have, one line for each method that is left out): all so
    much coarser that a method's runs take its share of the time [s] that the study has."""
    factors = FACTORS if place.target.device == "cpu" else (*FACTORS, FINEST)
    if math.isinf(within):
        tables = [_at(scenario, factor) for factor in factors]
        return [_job(s, method, place) for method in methods for s in tables if s is not None], []
    share = within * place.workers / len(methods)
    planned, notes = [], []
    for method in methods:
        found = _affordable(scenario, method, factors, share)
        planned += [_job(s, method, place) for s in found]
        if not found:
            notes.append(f"{method}: left out: {ENOUGH} spacings take longer than its share of the time, {share:.0f} s")
        elif found[-1].spacing > (1.0 + 1e-9) * factors[-1] * scenario.spacing:
            notes.append(f"{method}: no finer than {1e3 * found[-1].spacing:.3g} mm, for want of time")
    return planned, notes


def _job(scenario: Scenario, method: str, place: Workplace) -> Job:
    return Job(scenario.model_dump(mode="json"), method, place.target, wall_limit=place.wall_limit)


def _affordable(scenario: Scenario, method: str, factors: Sequence[float], share: float) -> list[Scenario]:
    """The scenario at the finest spacings that a method computes in its share of the time [s], as estimated; none where
    it cannot compute ENOUGH of them."""
    for i in range(MOST_WIDER):
        found = [s for factor in factors if (s := _at(scenario, WIDER**i * factor)) is not None]
        if len(found) < ENOUGH:
            break
        if sum(STARTING + _expected(s, method) for s in found) <= share:
            return found
    return []


def _expected(scenario: Scenario, method: str) -> float:
    """Seconds on one core; nothing is known of an engine that picks its own step."""
    return estimate(scenario, get_method(method)).wall_s or 0.0


def _at(scenario: Scenario, factor: float) -> Scenario | None:
    """The scenario at so many times its spacing; None where it cannot have it."""
    try:
        return scenario.replace(spacing=factor * scenario.spacing)
    except ValueError:
        return None
