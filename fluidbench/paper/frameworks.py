"""Every verdict on cost once more, in the other backend: is it the method's, or the implementation's?"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import mean

from ..runs.record import Run
from .cells import Cell, all_runs, figures, runs_of
from .evidence import Evidence
from .verdicts import DIFFERS, HOLDS, OPEN, equal_error, placed, ranked

IN_BOTH = "in both frameworks:"  # how such rows begin


def frameworks(e: Evidence) -> list[Cell]:
    """Each verdict on cost once more: does it hold in the other backend, or was it the implementation's?"""
    lines = (
        ("cost at equal spacing", "mpm", "mid-high", "upper"),
        ("cost at equal spacing", "sph", "high", "highest"),
        ("cost at equal spacing", "pbd", "low", "lowest"),
        ("claim", "sph", "would be the most expensive", "highest"),
        ("best for", "pbd", "real-time previews", "lowest"),
    )
    both = [figures(runs, "wall_per_simulated_s") for runs in (e.repeats, e.other)]
    runs = all_runs(e) + [run for group in e.other.values() for run in group]
    cells = []
    for row, m, word, place in lines:
        decided = all(len(walls) == 3 and min(map(len, walls.values())) > 1 for walls in both)
        verdicts = [placed(ranked(walls)[m], place) for walls in both] if decided else []
        costs = "; ".join(", ".join(f"{k} {mean(v):.3g}" for k, v in walls.items()) for walls in both if walls)
        measured = f"here and in the other backend, wall s / simulated s: {costs}"
        cells.append(_held(row, m, word, measured, "compare, both backends", verdicts, runs))
    for m, word, place in (("mpm", "mid-high", "upper"), ("sph", "high", "highest"), ("pbd", "low", "lowest")):
        found = [equal_error(trials, m, place) for trials in (e.trials, e.other_trials)]
        verdicts = [verdict for verdict, _ in found] if OPEN not in {verdict for verdict, _ in found} else []
        measured = "here and in the other backend, over the cheapest: " + "; ".join(s or "not run" for _, s in found)
        own = runs_of([t for t in e.other_trials if t.method == m])
        cells.append(_held("cost at equal error", m, word, measured, "validate, both backends", verdicts, own))
    why = "all known answers would be needed in the other backend"
    best = (("mpm", "realistic viscoelastoplastic fluids"), ("sph", "realistic liquids"))
    return [*cells, *(_held("best for", m, word, why, "none", [], []) for m, word in best)]


def _held(
    row: str, method: str, word: str, measured: str, experiment: str, verdicts: Sequence[str], runs: list[Run]
) -> Cell:
    """Whether a verdict is the same in both backends; `verdicts` is empty where one of them has none."""
    verdict = OPEN if not verdicts else HOLDS if len(set(verdicts)) == 1 else DIFFERS
    measured = f"{' and '.join(verdicts) or 'not decided in both'}; {measured}"
    return Cell(f"{IN_BOTH} {row}", method, word, measured, experiment, "frameworks", verdict, runs)
