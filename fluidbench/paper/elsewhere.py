"""Every verdict on cost once more under other conditions (the other language of the kernels, a viscous liquid by both
schemes of viscosity): is it the method's, or that of the implementation, or of the scene?"""

from __future__ import annotations

from collections.abc import Callable
from statistics import mean

from .cells import Cell, figures, paces
from .definitions import COLLAPSE, CONFIRMED, COST_PLACES, OPEN, REFUTED
from .evidence import SCHEMES, VISCOUS, Evidence, Runs
from .verdicts import equal_error, placed, ranked

Judge = Callable[[Runs], str]
EQUAL_SPACING, EQUAL_ERROR = "at equal spacing", "at equal error"
SMALL_STEPS, MOST_EXPENSIVE = "needs prohibitively small steps", "would be the most expensive"


def cost_place(repeats: Runs, method: str, place: str) -> str:
    """Whether a method's cost has its place among three; open without two repeats of each."""
    found = paces(repeats)
    if len(found) < 3 or min(map(len, found.values())) < 2:
        return OPEN
    return placed(ranked(found)[method], place)


def small_steps(repeats: Runs) -> str:
    """Whether SPH's step is a small part of MPM's."""
    dts = figures(repeats, "mean_dt_s")
    if not {"mpm", "sph"} <= set(dts):
        return OPEN
    return CONFIRMED if mean(dts["mpm"]) / mean(dts["sph"]) >= COLLAPSE else REFUTED


def judges() -> dict[tuple[str, str, str], Judge]:
    """What can be asked of any scene that every method was run on, by the cell that asks."""
    found: dict[tuple[str, str, str], Judge] = {
        ("cost", EQUAL_SPACING, m): lambda runs, m=m, place=place: cost_place(runs, m, place)
        for m, (_, place) in COST_PLACES.items()
    }
    found["claims", SMALL_STEPS, "sph"] = small_steps
    found["claims", MOST_EXPENSIVE, "sph"] = lambda runs: cost_place(runs, "sph", "highest")
    return found


def ask_elsewhere(cells: list[Cell], e: Evidence) -> None:
    """Give every cell that asks for cost the verdicts of the same rule under other conditions."""
    scenes = {f"{VISCOUS}, {scheme} viscosity": getattr(e, scheme) for scheme in SCHEMES}
    scenes["the other backend"] = e.other
    asked = judges()
    for cell in cells:
        if cell.place in asked:
            cell.elsewhere |= {where: asked[cell.place](runs) for where, runs in scenes.items() if runs}
        if cell.place[:2] == ("cost", EQUAL_ERROR) and e.other_trials:
            place, levels = COST_PLACES[cell.method][1], {t.level for t in e.other_trials}
            here, _ = equal_error([t for t in e.trials if t.level in levels], cell.method, place)
            if here == cell.verdict:  # else the spacings decide, not the backend
                cell.elsewhere["the other backend"] = equal_error(e.other_trials, cell.method, place)[0]
