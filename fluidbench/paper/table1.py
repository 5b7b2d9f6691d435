"""`table1`: the published table of adjectives, every cell beside what was measured, judged by verdicts.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from ..errors import UserError
from ..method.target import Target
from ..scenario import Scenario
from ..study.case import Case
from ..study.result import Result
from ..study.trials import LAST_SEED, Trial, plan, run, shaken
from ..study.workplace import Options, Workplace, as_scenario, require_number
from .archive import archives, keep
from .definitions import COST_CASES, METHODS
from .evidence import Evidence, chosen_cases, gather, levels_of, methods_of, shipped
from .table1_report import report

WALL_LIMIT = 3600.0  # s


@dataclass(repr=False)
class Table1(Result):
    """The published table of adjectives, judged: `table` has a row for every cell of every study in `studies`."""

    studies: dict[str, Evidence] = field(default_factory=dict)

    def keep(self, folder: Path) -> None:
        for e in self.studies.values():
            keep(e, folder)


def table1(
    scenario: Scenario | str | Path = "line_bead",
    *,
    repeats: int = 3,
    quick: bool = False,
    seed: int = 0,
    **options: Unpack[Options],
) -> Table1:
    """Judge the published table of adjectives: every cell beside a measured number and a verdict computed by a rule.

    `scenario` is one, a shipped name or a TOML file. `repeats`: runs of each method on it, for the spread; at least 2.
    `quick`: dear known answers are taken from the shipped table, and the spacing [m] is a third larger where the
    scenario is given by name. `seed`: another study of the same kind, with particles shifted at random. `options` are
    those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    require_number(seed, "seed", 0, whole=True, high=LAST_SEED)
    resolved = shaken(as_scenario(scenario), seed)
    if quick and not isinstance(scenario, Scenario):
        resolved = resolved.replace(spacing=coarser(resolved))
    require_number(repeats, "repeats", 2, whole=True)
    if resolved.nozzle is None or resolved.toolpath is None or resolved.toolpath.speed == 0:
        raise UserError(f"{resolved.name}: the table is judged on a bead that a moving nozzle lays, such as line_bead")
    place = Workplace.of(options, WALL_LIMIT, METHODS)
    chosen = chosen_cases(quick)
    trials = known_answers(chosen, place, place.target, quick, seed)
    others = []
    if (other := place.target.other) is not None and not quick:
        others = known_answers([c for c in chosen if c.name in COST_CASES], place, other, True, seed)
    e = gather(resolved, trials + (shipped() if quick else []), repeats, quick, place)
    e.other_trials, e.seed = others, seed
    missing = e.missing()
    studies = {e.label: e}
    root = place.store.root
    return Table1(report(studies, root), root, e.runs(), missing, not missing, place.keeper, studies)


def published(folder: str | Path, out: str | Path | None = None) -> Table1:
    """Judge the table again from what studies have kept in a `folder`, or in folders inside it: nothing is run. Where
    they disagree, a cell says so.

    Raises UserError where there is none, and for one that was changed since.
    """
    studies = archives(Path(folder).expanduser())
    root = Path(folder if out is None else out).expanduser().absolute()
    runs = [found for e in studies.values() for found in e.runs()]
    missing = [f"{label}: {line}" for label, e in studies.items() for line in e.missing()]
    return Table1(report(studies, root), root, runs, missing, not missing, kept=True, studies=studies)


def coarser(scenario: Scenario) -> float:
    """The spacing of a quick study [m]."""
    return 4 / 3 * scenario.spacing


def known_answers(chosen: Sequence[Case], place: Workplace, target: Target, quick: bool, seed: int = 0) -> list[Trial]:
    """Cases through the methods that are asked, run and judged: on a GPU one at a time where cost is compared."""
    limit = place.wall_limit
    trials = [t for c in chosen for t in plan([c], methods_of(c), levels_of(c, quick), False, target, limit, seed)]
    alone = [t for t in trials if t.case.name in COST_CASES and target.device != "cpu"]
    run([t for t in trials if t not in alone], place, f"known answers{target.suffix}")
    run(alone, place, f"known answers at several spacings{target.suffix}", together=False)
    return trials
