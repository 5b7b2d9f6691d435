"""The rules by which `table1` judges, as functions of finished runs; their words and thresholds are in definitions.py.

An order between methods needs a minimum effect, and between times also distance beyond the spread of the repeats.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from statistics import mean, stdev

import numpy as np

from ..method.verdict import Evidence
from ..runs.record import Run
from ..study.trials import Trial
from .definitions import (
    CONFIRMED,
    COST_CASES,
    EFFECT,
    FEWEST,
    GOOD,
    JUDGED,
    METHODS,
    OPEN,
    POOR,
    REFUTED,
    TOLERANCES,
)

BEYOND = math.log(100.0)  # how far a power law may be drawn out


def answers_of(trials: Sequence[Trial], methods: Sequence[str], physics: Sequence[str]) -> list[Trial]:
    """The known answers of these methods and classes that count."""
    own = [t for t in trials if t.method in methods and t.case.physics in physics and t.level in JUDGED]
    return [t for t in own if t.judged]


def told(trials: Sequence[Trial]) -> bool:
    """Whether all of these say something of their method: nothing rests on what a crash or a limit of time cut off."""
    return all(t.evidence is not Evidence.NOTHING for t in trials)


def answers_to(trials: Sequence[Trial], names: Sequence[str], method: str) -> list[Trial]:
    """A method's answers to these cases that count."""
    return [t for t in trials if t.case.name in names and t.method == method and t.level in JUDGED and t.judged]


def within(trials: Sequence[Trial], factor: float = 1.0) -> tuple[int, int]:
    """(within a factor of their tolerance, judged): a run that blew up is not within, one that says nothing of the
    method is not judged."""
    own = [t for t in trials if t.evidence is not Evidence.NOTHING]
    return sum(t.error <= factor * t.tolerance for t in own), len(own)


def share_is(trials: Sequence[Trial], right: Callable[[float], bool], factor: float = 1.0) -> str:
    """The verdict on a statement about the share of these known answers that is within tolerance."""
    passed, judged = within(trials, factor)
    if judged < FEWEST or not told(trials):
        return OPEN
    return CONFIRMED if right(passed / judged) else REFUTED


def high(share: float) -> bool:
    return share >= GOOD


def low(share: float) -> bool:
    return share <= POOR


def sensitivity(trials: Sequence[Trial], judge: Callable[[Sequence[Trial], float], str]) -> str:
    """What becomes of a verdict, `judge(known answers, factor on tolerances)`, without any one of the cases, and at
    half and twice the tolerances."""
    verdict = judge(trials, 1.0)
    if verdict == OPEN:
        return ""
    without: dict[str, list[str]] = {}
    for name in dict.fromkeys(t.case.name for t in trials):
        other = judge([t for t in trials if t.case.name != name], 1.0)
        if other != verdict:
            without.setdefault(other, []).append(name)
    lines = [f"{other} without {' or '.join(names)}" for other, names in without.items()]
    lines = lines or ["the same without any one of its cases"]
    lines += [f"{judge(trials, f)} at {f:g} times the tolerances" for f in TOLERANCES]
    return "; ".join(lines)


def ranked(figures: dict[str, list[float]]) -> dict[str, tuple[int, int]]:
    """For each method (how many are clearly below it, how many clearly above): by EFFECT, and beyond the spread."""

    def clear(a: list[float], b: list[float]) -> bool:
        spread = 2.0 * math.hypot(*(stdev(v) if len(v) > 1 else 0.0 for v in (a, b)))
        return mean(b) > EFFECT * mean(a) and mean(b) - mean(a) > spread

    return {
        m: (
            sum(clear(v, own) for k, v in figures.items() if k != m),
            sum(clear(own, v) for k, v in figures.items() if k != m),
        )
        for m, own in figures.items()
    }


def agreed(verdicts: Sequence[str]) -> str:
    """The verdict that every resolution gives; not decidable where they disagree."""
    return verdicts[0] if len(set(verdicts)) == 1 else OPEN


def placed(place: tuple[int, int], word: str) -> str:
    """Whether a place among three is the lowest, the highest or between, as the word says."""
    below, above = place
    right = {"lowest": above == 2, "highest": below == 2, "middle": below == 1 and above == 1, "upper": below >= 1}[
        word
    ]
    return CONFIRMED if right else REFUTED


def seconds(trial: Trial) -> float:
    """What a trial cost [s]: CPU time on a CPU, where other work may share the machine, wall time on a GPU."""
    on_cpu = all(run.record.device == "cpu" for run in trial.runs.values())
    return trial.cost["cpu_s" if on_cpu and "cpu_s" in trial.cost else "wall_s"]


def _curves(trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """log(error), log(cost) of each method at its spacings, two or more; none where a run says nothing of its
    method."""
    if not told([t for t in trials if t.judged]):
        return {}
    points = {}
    for m in dict.fromkeys(t.method for t in trials):
        own = [(t.error, seconds(t)) for t in trials if t.method == m and t.finding is not None and t.error > 0]
        if len(own) >= 2:
            points[m] = np.log(np.array(own))
    return points if len(points) >= 2 else {}


def at_equal_error(trials: Sequence[Trial]) -> dict[str, float]:
    """Time [s] of each method at the error that the worst of them reaches at its best: by a power law through its
    spacings, or, where its error does not fall with cost, its cheapest run within that error; of one that was never so
    far off, its cheapest run. Nothing where a run says nothing of its method."""
    curves = _curves(trials)
    target = max((p[:, 0].min() for p in curves.values()), default=0.0)
    return {m: math.exp(_falling(min(target, p[:, 0].max()), p[:, 0], p[:, 1])) for m, p in curves.items()}


def at_equal_cost(trials: Sequence[Trial]) -> dict[str, float]:
    """Error of each method at the least cost that all of them were run at, by a power law through its spacings; of one
    whose finest run is cheaper, that run's."""
    curves = _curves(trials)
    target = max((p[:, 1].min() for p in curves.values()), default=0.0)
    return {m: math.exp(_falling(min(target, p[:, 1].max()), p[:, 1], p[:, 0])) for m, p in curves.items()}


def _falling(target: float, x: np.ndarray, y: np.ndarray) -> float:
    """y at x = target on the line through the points; where y does not fall with x, the least y up to there."""
    fit = np.polyfit(x, y, 1)
    if fit[0] < 0:
        return float(np.polyval(fit, target))
    return float(y[x <= target + 1e-9].min())


def equal_error(trials: Sequence[Trial], method: str, place: str) -> tuple[str, dict[str, float]]:
    """(verdict on a method's place, its time over the cheapest's by case) at the error that all three reach."""
    if not told([t for t in trials if t.case.name in COST_CASES and t.judged]):
        return OPEN, {}
    every = {name: at_equal_error([t for t in trials if t.case.name == name]) for name in COST_CASES}
    equal = {name: costs for name, costs in every.items() if len(costs) == 3}
    shares = {name: costs[method] / min(costs.values()) for name, costs in equal.items()}
    tops = [placed(ranked({k: [v] for k, v in costs.items()})[method], place) for costs in equal.values()]
    if len(tops) < FEWEST:
        return OPEN, shares
    return CONFIRMED if tops.count(CONFIRMED) > len(tops) / 2 else REFUTED, shares


def winners(trials: Sequence[Trial], physics: Sequence[str], factor: float = 1.0) -> dict[str, int]:
    """On how many cases each method is the cheapest of those within a factor of the tolerance; "none" where nobody
    is. A case of which a run says nothing of its method does not count."""
    wins: dict[str, int] = {}
    rows = [t for t in answers_of(trials, METHODS, physics) if t.case.drive is None]
    for name in dict.fromkeys(t.case.name for t in rows):
        own = [t for t in rows if t.case.name == name]
        if not told(own):
            continue
        good = [t for t in own if t.error <= factor * t.tolerance]
        first = min(good, key=seconds).method if good else "none"
        wins[first] = wins.get(first, 0) + 1
    return wins


def pace(run: Run) -> float:
    """Seconds for a simulated one: CPU time on a CPU, where other work may share the machine, wall time on a GPU."""
    return (run.cost.cpu_s if run.record.device == "cpu" else run.cost.wall_s) / run.cost.simulated_s


def in_real_time(runs: Sequence[Run]) -> float:
    """The most particles with which a simulated second takes no more than one, by a power law through these runs; NaN
    where one has no result, where time does not rise with their number, or where that is too far beyond them to say."""
    if len(runs) < 2 or not all(run.ok for run in runs):
        return math.nan
    n, cost = np.log([(run.cost.peak_particles, pace(run)) for run in runs]).T
    if len(set(n)) < 2:
        return math.nan
    slope, at_one = np.polyfit(n, cost, 1)
    found = -at_one / slope if slope > 0 else math.inf
    return math.exp(found) if n.min() - BEYOND <= found <= n.max() + BEYOND else math.nan
