"""How a run ends, and what that is evidence of: the one rule that every tally, rank, fit and verdict goes by."""

from collections.abc import Iterable
from enum import StrEnum
from typing import Protocol


class Verdict(StrEnum):
    """How a run ended. Only `completed` carries results to be compared."""

    COMPLETED = "completed"
    DIVERGED = "diverged"
    OUT_OF_CAPACITY = "out_of_capacity"
    TIMEOUT = "timeout"
    ERROR = "error"
    REFUSED = "refused"


class Evidence(StrEnum):
    """What a run tells of its method."""

    RESULT = "a result"  # of accuracy and of cost
    INSTABILITY = "an instability"  # at the method's own step: it did not get there
    NOTHING = "nothing"  # not of its accuracy, nor of its cost


FINAL = {Verdict.COMPLETED, Verdict.DIVERGED, Verdict.OUT_OF_CAPACITY, Verdict.REFUSED}
"""Verdicts that another attempt would not change."""


def evidence_of(verdict: str) -> Evidence:
    """What a run that ended so is evidence of (design, section 7): a crash, a limit of time or of memory and a refusal
    say nothing of how accurate a method is or what it costs. Raises ValueError for what is no verdict."""
    return {Verdict.COMPLETED: Evidence.RESULT, Verdict.DIVERGED: Evidence.INSTABILITY}.get(
        Verdict(verdict), Evidence.NOTHING
    )


class Ended(Protocol):
    """A run as far as this module knows it."""

    @property
    def name(self) -> str: ...

    @property
    def verdict(self) -> str: ...

    @property
    def reason(self) -> str: ...

    @property
    def evidence(self) -> Evidence: ...


def lacking(runs: Iterable[Ended], refusals: bool = True) -> list[str]:
    """One line a run that a study needed and has nothing of, with the reason; a refusal may be an answer in itself
    (`refusals` False)."""
    missing = [run for run in runs if run.evidence is Evidence.NOTHING]
    if not refusals:
        missing = [run for run in missing if run.verdict != Verdict.REFUSED]
    return list(dict.fromkeys(f"{run.name}: {run.verdict}: {run.reason}" for run in missing))
