"""`select`: which method and spacing meet a tolerance at least cost on this machine, and on what evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from ..scenario import Scenario
from ..scenario.measured import Measured
from .candidates import limit_within, run_candidates
from .result import Result
from .select_report import report
from .selection import Selection, assess
from .workplace import Options, Workplace, as_scenario, measured_of, methods_of, require_number, share_of


@dataclass(repr=False)
class Selected(Result):
    """A recommendation with its evidence: `table` has a row for every candidate; `found` is all that it rests on."""

    found: Selection = field(default_factory=lambda: Selection([], {}, {}, []))


def select(
    scenario: Scenario | str | Path,
    methods: Sequence[str] | None = None,
    *,
    tolerance: float | str = 0.05,
    budget: float = math.inf,
    pace: float = math.inf,
    within: float = math.inf,
    called: str = "",
    measured: str | Path | Sequence[Measured] = (),
    **options: Unpack[Options],
) -> Selected:
    """Recommend a method, spacing and time step: least cost within a `tolerance` (largest relative error of any
    length, as 0.05 or "5%"), within a `budget` of time [s] and a `pace` (s per simulated s), on this machine.

    Runs every method at four spacings, on a GPU at five. `scenario` is one, a shipped name or a TOML file; `methods`
    are names, default all. `called` is the scenario's name in the command that it recommends. `measured`: a table of
    what was measured on a real print (CSV), which errors are then counted from, beside what the scenario has of it.
    `within`: time [s] that the study may take on a CPU: spacings are so much finer or coarser, method by method, by
    what a run of each takes here. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is; Obstacle where `within` proves too short.
    """
    share = share_of(tolerance, "tolerance")
    for value, what in ((budget, "budget"), (pace, "pace")):
        require_number(value, what, 0.0, high=math.inf)
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    place = Workplace.of(options, limit_within(within), names)
    beside = measured_of(resolved, measured)
    (tried,) = run_candidates({resolved.name: resolved}, names, place, "select", within).values()
    found = assess(resolved, names, tried.runs, beside, tried.untried)
    made = report(resolved, called or resolved.name, found, share, budget, pace, place.store.root)
    missing = found.missing()
    ok = bool(found.candidates) and not missing
    return Selected(made, place.store.root, found.runs, missing, ok, place.keeper, found)
