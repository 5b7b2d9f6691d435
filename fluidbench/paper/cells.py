"""A cell of the judged table, and what several rows take from the evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..runs.record import Run
from ..study.trials import Trial
from .evidence import Evidence


@dataclass
class Cell:
    """A row of the table: what the paper says of a method, what was measured, by which experiment, the verdict, and
    the runs behind it."""

    row: str
    method: str
    paper: str
    measured: str
    experiment: str
    rule: str
    verdict: str
    runs: list[Run] = field(default_factory=list)


def runs_of(trials: Sequence[Trial]) -> list[Run]:
    return [run for t in trials for run in t.runs.values()]


def figures(repeats: dict[str, list[Run]], key: str) -> dict[str, list[float]]:
    """A cost figure of every repeat; methods of which one is not a result are missing."""
    return {m: [getattr(r.cost, key) for r in runs] for m, runs in repeats.items() if runs and all(r.ok for r in runs)}


def all_runs(e: Evidence) -> list[Run]:
    return [run for runs in e.repeats.values() for run in runs]
