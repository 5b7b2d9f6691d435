"""`select`: which method and spacing meet a tolerance at least cost on this machine, and on what evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

from ..runs.job import Job
from ..scenario import Scenario
from ..scenario.measured import Measured
from .result import Result
from .select_report import report
from .selection import FACTORS, FINEST, Selection, assess
from .workplace import Options, Workplace, as_scenario, measured_of, methods_of, require_number

WALL_LIMIT = 900.0  # s


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
    called: str = "",
    measured: str | Path | Sequence[Measured] = (),
    **options: Unpack[Options],
) -> Selected:
    """Recommend a method, spacing and time step: least cost within a `tolerance` (largest relative error of any
    length), within a `budget` of wall time [s] and a `pace` (wall s per simulated s), on this machine.

    Runs every method at four spacings, on a GPU at five. `scenario` is one, a shipped name or a TOML file; `methods`
    are names, default all. `called` is the scenario's name in the command that it recommends. `measured`: a table of
    what was measured on a real print (CSV), which errors are then counted from, beside what the scenario has of it.
    `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    require_number(tolerance, "tolerance", 1e-6)
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    beside = measured_of(resolved, measured)
    found = assess(resolved, names, place.run(candidates(resolved, names, place), "select"), beside)
    made = report(resolved, called or resolved.name, found, tolerance, budget, pace, place.store.root)
    missing = found.missing()
    ok = bool(found.candidates) and not missing
    return Selected(made, place.store.root, found.runs, missing, ok, place.keeper, found)


def candidates(scenario: Scenario, methods: Sequence[str], place: Workplace) -> list[Job]:
    """Every method at every spacing that the scenario can have."""
    factors = FACTORS if place.target.device == "cpu" else (*FACTORS, FINEST)
    tables = [scenario.model_dump(mode="json") | {"spacing": factor * scenario.spacing} for factor in factors]
    return [
        Job(table, method, place.target, wall_limit=place.wall_limit)
        for method in methods
        for table in tables
        if _valid(table)
    ]


def _valid(table: dict[str, Any]) -> bool:
    from pydantic import ValidationError

    try:
        Scenario.model_validate(table)
    except ValidationError:
        return False
    return True
