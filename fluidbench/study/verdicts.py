"""The rules by which `table1` judges, in words (`RULES`) and as functions of finished runs.

An order between methods needs a minimum effect, and between times also distance beyond the spread of the repeats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean, stdev

import numpy as np

from .validate import Trial

CONFIRMED, REFUTED, OPEN = "confirmed", "refuted", "not decidable"
EFFECT = 1.2  # two figures that differ by less than this factor count as equal
GOOD, POOR = 0.75, 0.5  # share of known answers within tolerance that is high fidelity, or low
FEWEST = 2  # known answers that a verdict on a class needs
COLLAPSE = 10.0  # factor by which a step must shrink to count as collapsed
JUDGED = ("coarse", "quick")  # levels at which a known answer counts

RULES = {
    "fidelity": f"high or good: at least {GOOD:.0%} of the known answers of the class within tolerance; not accurate: "
    f"at most {POOR:.0%}; a class needs {FEWEST} of them",
    "step": f"methods ordered by their mean default dt on the scenario; a place needs a factor of {EFFECT:g}",
    "cost": f"methods ordered by the figure; a place needs a factor of {EFFECT:g}, and means more than two standard "
    "deviations of the repeats apart",
    "best": "the method that is cheapest, among those within tolerance, on most known answers of the class",
    "collapse": f"the step shrinks at least {COLLAPSE:g}-fold from one end to the other",
    "artifacts": f"at 1 particle a cell the bead's area is {EFFECT:g} times as far off as at 8 and 27, and over 1 %",
    "prediction": "off by more than the tolerance of the case, or by over 10 % from the mean of the other two methods",
    "definition": "a definition, not a claim",
}


def share_within(trials: Sequence[Trial], method: str, physics: Sequence[str]) -> tuple[int, int]:
    """(within tolerance, judged) of a method's known answers of these classes; a run that blew up is not within."""
    own = [t for t in trials if t.method == method and t.case.physics in physics and t.level in JUDGED]
    own = [t for t in own if t.verdict != "skipped"]
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


def placed(place: tuple[int, int], word: str) -> str:
    """Whether a place among three is the lowest, the highest or between, as the word says."""
    below, above = place
    right = {"lowest": above == 2, "highest": below == 2, "middle": below == 1 and above == 1,
             "upper": below >= 1}[word]  # fmt: skip
    return CONFIRMED if right else REFUTED


def at_equal_error(trials: Sequence[Trial]) -> dict[str, float]:
    """Wall time [s] of each method at the error that the worst of them reaches at its best, by power-law fits through
    its spacings; methods whose error does not fall with cost are left out."""
    points = {}
    for m in dict.fromkeys(t.method for t in trials):
        own = [(t.error, t.cost["wall_s"]) for t in trials if t.method == m and t.finding is not None and t.error > 0]
        if len(own) >= 2:
            points[m] = np.log(np.array(own))
    fits = {m: np.polyfit(p[:, 0], p[:, 1], 1) for m, p in points.items()}
    fits = {m: fit for m, fit in fits.items() if fit[0] < 0}
    if len(fits) < 2:
        return {}
    target = max(points[m][:, 0].min() for m in fits)
    return {m: float(np.exp(np.polyval(fit, target))) for m, fit in fits.items()}


def winners(trials: Sequence[Trial], physics: Sequence[str]) -> dict[str, int]:
    """On how many cases each method is the cheapest of those within tolerance."""
    wins: dict[str, int] = {}
    rows = [t for t in trials if t.case.physics in physics and t.level in JUDGED and t.case.drive is None]
    for name in dict.fromkeys(t.case.name for t in rows):
        good = [t for t in rows if t.case.name == name and t.error <= t.tolerance]
        if good:
            first = min(good, key=lambda t: t.cost["wall_s"]).method
            wins[first] = wins.get(first, 0) + 1
    return wins
