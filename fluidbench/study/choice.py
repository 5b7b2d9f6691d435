"""What one would take for a job on a machine, within a tolerance: how sure that is, and what would change it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .selection import Candidate, Selection, confidence

CLOSE = 1.5  # factor of cost within which another method is as good a choice


@dataclass(frozen=True)
class Choice:
    """The cheapest setting within a tolerance, or the nearest to it (`why` it is not within)."""

    job: str
    machine: str
    tolerance: float
    best: Candidate | None
    why: str
    sure: str  # high, medium or low: and why
    change: str

    @property
    def met(self) -> bool:
        """Whether something tried is within the tolerance."""
        return self.best is not None and not self.why

    @property
    def confidence(self) -> str:
        """high, medium or low."""
        return self.sure.partition(":")[0]


def choices(studies: Mapping[str, Mapping[str, Selection]], tolerances: Sequence[float]) -> list[Choice]:
    """For every job, machine and tolerance, in this order."""
    jobs = dict.fromkeys(job for found in studies.values() for job in found)
    return [
        _choice(job, machine, tolerance, found[job])
        for job in jobs
        for machine, found in studies.items()
        if job in found
        for tolerance in tolerances
    ]


def _choice(job: str, machine: str, tolerance: float, found: Selection) -> Choice:
    best, why = found.recommend(tolerance, math.inf, math.inf)
    sure = confidence(found, tolerance, best)
    return Choice(job, machine, tolerance, best, why, sure, _change(found, tolerance, best) if best else "")


def _change(found: Selection, tolerance: float, best: Candidate) -> str:
    """The nearest rival, and another choice where a method's bias is doubted."""
    within = [c for c in found.candidates if c.error <= tolerance]
    if not within:
        return f"{_finer(found, tolerance, best)}a tolerance of {math.ceil(1000 * best.error) / 10:.3g} %"
    parts = []
    rivals = [c for c in within if c.method != best.method]
    if rivals:
        rival = min(rivals, key=lambda c: c.seconds)
        factor = rival.seconds / best.seconds
        close = "as good: " if factor < CLOSE else ""
        parts.append(f"{close}{setting(rival)} takes {_times(factor)} as long")
    else:
        others = [c for c in found.candidates if c.method != best.method]
        near = min(others, key=lambda c: c.error, default=None)
        parts.append("no other method was judged" if near is None else f"{setting(near)} is {near.error:.0%} off")
    unbiased = [c for c in found.candidates if c.unbiased <= tolerance]
    other = min(unbiased, key=lambda c: c.seconds)
    if other.method != best.method:
        saved = f"{setting(other)} in {time_of(other.seconds)}"
        parts.append(f"{saved}, if its own limit is the right one ({other.bias:.0%} from the consensus)")
    return "; ".join(parts)


def _finer(found: Selection, tolerance: float, best: Candidate) -> str:
    """Whether a finer spacing would be within the tolerance."""
    return "a finer spacing than was tried, or " if best.bias < tolerance and found.converges(best.method) else ""


def _times(factor: float) -> str:
    return f"{factor:.0f} times" if factor >= 10 else f"{factor:.2g} times"


def time_of(seconds: float) -> str:
    """In the unit that reads best."""
    unit, size = next(((u, n) for u, n in (("h", 3600.0), ("min", 60.0)) if seconds >= 2 * n), ("s", 1.0))
    value = seconds / size
    return f"{value:.0f} {unit}" if value >= 10 else f"{value:.2g} {unit}"


def setting(c: Candidate) -> str:
    """Method and spacing."""
    return f"{c.method.upper()} at {1e3 * c.spacing:.3g} mm"
