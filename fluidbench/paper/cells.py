"""A cell of the judged table, and what several rows take from the evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..runs.record import Run
from ..study.trials import Trial
from .definitions import OPEN
from .evidence import Evidence, Runs
from .verdicts import pace


@dataclass
class Cell:
    """What the paper says of a method in a row of its table, what was measured (`brief`: in a few words), by which
    experiment, the verdict of which rule, and the runs behind it.

    `sensitivity` says what the verdict hangs on; `elsewhere` holds the verdicts of the same rule under other
    conditions, by what they are.
    """

    row: str
    aspect: str
    method: str
    paper: str
    brief: str
    measured: str
    experiment: str
    rule: str
    verdict: str
    runs: list[Run] = field(default_factory=list)
    sensitivity: str = ""
    elsewhere: dict[str, str] = field(default_factory=dict)

    @property
    def place(self) -> tuple[str, str, str]:
        """Where it stands: the same in every study."""
        return self.row, self.aspect, self.method

    @property
    def name(self) -> str:
        """The cell in words."""
        return f"{self.row}, {self.method}: {self.statement}"

    @property
    def statement(self) -> str:
        """What the paper says, and of what."""
        return self.paper if self.aspect in self.paper else f"{self.paper}, {self.aspect}"

    @property
    def differs(self) -> dict[str, str]:
        """Where the rule decides otherwise."""
        return {where: v for where, v in self.elsewhere.items() if v != self.verdict and OPEN not in (v, self.verdict)}


def runs_of(trials: Sequence[Trial]) -> list[Run]:
    return [run for t in trials for run in t.runs.values()]


def figures(repeats: Runs, key: str) -> dict[str, list[float]]:
    """A cost figure of every repeat; methods of which one is not a result are missing."""
    return {m: [getattr(r.cost, key) for r in runs] for m, runs in repeats.items() if runs and all(r.ok for r in runs)}


def paces(repeats: Runs) -> dict[str, list[float]]:
    """Seconds for a simulated one, likewise."""
    return {m: [pace(r) for r in runs] for m, runs in repeats.items() if runs and all(r.ok for r in runs)}


def all_runs(e: Evidence) -> list[Run]:
    return [run for runs in e.repeats.values() for run in runs]
