"""`table1`: the published table of adjectives, every cell beside what was measured, judged by verdicts.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Unpack

from ..method.target import Target
from ..scenario import Scenario
from ..study.case import Case
from ..study.result import Result
from ..study.trials import Trial, plan, run
from ..study.workplace import Options, Workplace, as_scenario
from .evidence import COST_CASES, METHODS, Evidence, chosen_cases, gather, levels_of, shipped
from .table1_report import report

WALL_LIMIT = 1800.0  # s


@dataclass(repr=False)
class Table1(Result):
    """The published table of adjectives, judged: `table` has a row for every cell."""

    evidence: Evidence | None = None


def table1(
    scenario: Scenario | str | Path = "line_bead", *, repeats: int = 3, quick: bool = False, **options: Unpack[Options]
) -> Table1:
    """Judge the published table of adjectives: every cell beside a measured number and a verdict computed by a rule.

    `scenario` is one, a shipped name or a TOML file. `repeats`: runs of each method on it, for the spread; at least 2.
    `quick`: dear known answers are taken from the shipped table, and the spacing [m] is a third larger where the
    scenario is given by name. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    resolved = as_scenario(scenario)
    if quick and not isinstance(scenario, Scenario):
        resolved = resolved.replace(spacing=coarser(resolved))
    place = Workplace.of(options, WALL_LIMIT, METHODS)
    trials = known_answers(chosen_cases(quick), place, place.target, quick)
    others = []
    if (other := place.target.other) is not None and not quick:
        others = known_answers([c for c in chosen_cases(quick) if c.name in COST_CASES], place, other, quick)
    e = gather(resolved, trials + (shipped() if quick else []), repeats, quick, place)
    e.other_trials = others
    missing = e.missing()
    return Table1(report(e, place.store.root), place.store.root, e.runs(), missing, not missing, place.keeper, e)


def coarser(scenario: Scenario) -> float:
    """The spacing of a quick study [m]."""
    return 4 / 3 * scenario.spacing


def known_answers(chosen: Sequence[Case], place: Workplace, target: Target, quick: bool) -> list[Trial]:
    """Cases through every method, run and judged."""
    trials = [t for c in chosen for t in plan([c], METHODS, levels_of(c, quick), False, target, place.wall_limit)]
    run(trials, place, f"known answers{target.suffix}")
    return trials
