"""The rules by which `table1` judges, in words (`RULES`) and as functions of finished runs.

An order between methods needs a minimum effect, and between times also distance beyond the spread of the repeats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean, stdev

import numpy as np

from ..method.verdict import Evidence
from ..study.trials import Trial
from .evidence import COST_CASES, METHODS

CONFIRMED, REFUTED, OPEN = "confirmed", "refuted", "not decidable"
HOLDS, DIFFERS = "the same in both", "not the same in both"  # of a verdict, in the other backend
EFFECT = 1.2  # two figures that differ by less than this factor count as equal
GOOD, POOR = 0.75, 0.5  # share of known answers within tolerance that is high fidelity, or low
FEWEST = 2  # known answers that a verdict on a class needs
APART = 0.1  # relative difference of two lengths that counts as disagreement
COLLAPSE = 10.0  # factor by which a step must shrink to count as collapsed
JUDGED = ("coarse", "quick")  # levels at which a known answer counts

RULES = {
    "fidelity": f"high or good: at least {GOOD:.0%} of the known answers of the class within tolerance; not accurate: "
    f"at most {POOR:.0%}; a class needs {FEWEST} of them",
    "step": f"methods ordered by the largest dt over d/c that a thrown lump survives, at two spacings; a place needs a "
    f"factor of {EFFECT:g} and two standard deviations",
    "equal error": f"ordered by the time to reach the error that all three reach, a factor of {EFFECT:g} apart, on "
    f"most of at least {FEWEST} cases",
    "frameworks": "whether the rule of a verdict on cost says the same of the methods written in Warp and in Taichi",
    "cost": f"methods ordered by the figure; a place needs a factor of {EFFECT:g}, and means more than two standard "
    "deviations of the repeats apart",
    "best": "the method that is cheapest, among those within tolerance, on most known answers of the class",
    "collapse": f"the step shrinks at least {COLLAPSE:g}-fold from one end to the other",
    "artifacts": f"at 1 particle a cell the bead's area is {EFFECT:g} times as far off as at 8 and 27, and over 1 %, "
    "on both of two grids",
    "prediction": f"most of at least {FEWEST} known answers missed; for the bead's width, over {APART:.0%} from the "
    "mean of the other two methods (which must agree as well) at both of two spacings",
    "definition": "a definition, not a claim",
}


def answers_of(trials: Sequence[Trial], methods: Sequence[str], physics: Sequence[str]) -> list[Trial]:
    """The known answers of these methods and classes that count."""
    own = [t for t in trials if t.method in methods and t.case.physics in physics and t.level in JUDGED]
    return [t for t in own if t.judged]


def told(trials: Sequence[Trial]) -> bool:
    """Whether all of these say something of their method: nothing rests on what a crash or a limit of time cut off."""
    return all(t.evidence is not Evidence.NOTHING for t in trials)


def share_within(trials: Sequence[Trial], method: str, physics: Sequence[str]) -> tuple[int, int]:
    """(within tolerance, judged) of a method's known answers of these classes; a run that blew up is not within, one
    that says nothing of the method is not judged."""
    own = [t for t in answers_of(trials, [method], physics) if t.evidence is not Evidence.NOTHING]
    return sum(t.error <= t.tolerance for t in own), len(own)


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


def at_equal_error(trials: Sequence[Trial]) -> dict[str, float]:
    """Wall time [s] of each method at the error that the worst of them reaches at its best: by a power law through its
    spacings, or, where its error does not fall with cost, its cheapest run within that error. Nothing where a run says
    nothing of its method."""
    points = {}
    if not told([t for t in trials if t.judged]):
        return {}
    for m in dict.fromkeys(t.method for t in trials):
        own = [(t.error, t.cost["wall_s"]) for t in trials if t.method == m and t.finding is not None and t.error > 0]
        if len(own) >= 2:
            points[m] = np.log(np.array(own))
    if len(points) < 2:
        return {}
    target = max(p[:, 0].min() for p in points.values())
    return {m: math.exp(_cost_at(target, p)) for m, p in points.items()}


def equal_error(trials: Sequence[Trial], method: str, place: str) -> tuple[str, str]:
    """(verdict on a method's place, its times over the cheapest) at the error that all three reach."""
    every = {name: at_equal_error([t for t in trials if t.case.name == name]) for name in COST_CASES}
    equal = {name: costs for name, costs in every.items() if len(costs) == 3}
    shares = ", ".join(f"{n}: x {costs[method] / min(costs.values()):.2g}" for n, costs in equal.items())
    tops = [placed(ranked({k: [v] for k, v in costs.items()})[method], place) for costs in equal.values()]
    if len(tops) < FEWEST:
        return OPEN, shares
    return CONFIRMED if tops.count(CONFIRMED) > len(tops) / 2 else REFUTED, shares


def _cost_at(target: float, points: np.ndarray) -> float:
    """log(cost) at log(error) = target from rows (log error, log cost)."""
    fit = np.polyfit(points[:, 0], points[:, 1], 1)
    if fit[0] < 0:
        return float(np.polyval(fit, target))
    return float(points[points[:, 0] <= target + 1e-9, 1].min())


def winners(trials: Sequence[Trial], physics: Sequence[str]) -> dict[str, int]:
    """On how many cases each method is the cheapest of those within tolerance."""
    wins: dict[str, int] = {}
    rows = [t for t in answers_of(trials, METHODS, physics) if t.case.drive is None]
    for name in dict.fromkeys(t.case.name for t in rows):
        own = [t for t in rows if t.case.name == name]
        good = [t for t in own if t.error <= t.tolerance]
        if good and told(own):
            first = min(good, key=lambda t: t.cost["wall_s"]).method
            wins[first] = wins.get(first, 0) + 1
    return wins
