"""`ablate`: what a scenario requires, and what it pays for without need: one change at a time, then the leanest mix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from ..scenario import Scenario
from .ablate_report import report
from .ablation import Ablation, ablation
from .result import Result
from .workplace import Options, Workplace, as_scenario, methods_of, share_of

WALL_LIMIT = 900.0  # s


@dataclass(repr=False)
class Ablated(Result):
    """What a scenario requires: `table` has a row for every change; `found` is all that it rests on."""

    found: Ablation = field(default_factory=lambda: Ablation({}))


def ablate(
    scenario: Scenario | str | Path,
    methods: Sequence[str] | None = None,
    *,
    tolerance: float | str = 0.05,
    called: str = "",
    given: Sequence[str] = (),
    **options: Unpack[Options],
) -> Ablated:
    """Switch physical features off and numerical economies on, one at a time: what moves, what is saved. Ends with the
    leanest mix that moves no length by more than the `tolerance`, a share [-], as 0.05 or "5%",
    confirmed by a run.

    `scenario` is one, a shipped name or a TOML file; `methods` are names, default all. `called` and `given` are the
    scenario's name and settings (key=value) in the commands that it recommends. `options` are those of every verb, see
    Options.

    Raises UserError for what cannot be run, before anything is.
    """
    share = share_of(tolerance, "tolerance")
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    found = ablation(resolved, names, share, place)
    made = report(resolved, called or resolved.name, given, found, share, place.store.root)
    missing = found.missing()
    ok = not missing and any(run.ok for run in found.base.values())
    return Ablated(made, place.store.root, found.runs(), missing, ok, place.keeper, found)
