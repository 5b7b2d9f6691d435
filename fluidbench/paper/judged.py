"""The published table of adjectives, every cell beside what was measured, judged by verdicts.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import mean, stdev
from typing import Any

from ..method.verdict import Evidence as Weight
from ..registry import get_method
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.numerics import configure
from ..study.lengths import lengths_of
from ..study.points import HELD, varied
from ..study.trials import Trial
from .cells import Cell, all_runs, figures, runs_of
from .evidence import COST_CASES, METHODS, SHIPPED, Evidence
from .frameworks import frameworks
from .verdicts import (
    APART,
    COLLAPSE,
    CONFIRMED,
    EFFECT,
    FEWEST,
    GOOD,
    JUDGED,
    OPEN,
    POOR,
    REFUTED,
    agreed,
    answers_of,
    equal_error,
    placed,
    ranked,
    share_within,
    told,
    winners,
)

CLASSES = {
    "deformables and viscous": ("viscous", "yield stress", "elastic", "viscoelastic"),
    "liquids": ("liquid",),
}

VISCOSITIES, YIELDS = (1e-3, 1e3), (0.0, 1e4)  # ends of an axis: Pa s, Pa

DEFORMATION = ("slump_cylinder", "self_weight_column", "cantilever_sag", "viscous_column_slip")

COLLAPSING = ("collapse_threshold", "slump_slip")


def cells(e: Evidence) -> list[Cell]:
    """Every cell of the paper's table, then its claims in words. Where nothing ran there is no verdict at all: what is
    shipped, and bounds, say nothing of code that does not run."""
    found = [*paradigm(), *fidelity(e), *stability(e), *cost(e), *best_for(e), *limits(e), *claims(e), *frameworks(e)]
    if all(run.evidence is Weight.NOTHING for run in e.runs()):
        found = [replace(cell, verdict=OPEN) for cell in found]
    return found


def paradigm() -> list[Cell]:
    words = {"mpm": "hybrid particle-grid", "sph": "particles, mesh-free", "pbd": "particles, constraints"}
    return [Cell("paradigm", m, words[m], get_method(m).paradigm, "none", "definition", OPEN) for m in words]


def _tally(trials: Sequence[Trial], method: str, physics: Sequence[str]) -> tuple[int, int, str]:
    """(passed, judged, the same in words)."""
    passed, judged = share_within(trials, method, physics)
    own = answers_of(trials, [method], physics)
    old, lost = sum(t.note == SHIPPED for t in own), len(own) - judged
    words = f"{passed} of {judged} known answers within tolerance" + f" ({old} {SHIPPED})" * (old > 0)
    return passed, judged, words + f"; {lost} could not be run" * (lost > 0)


def fidelity(e: Evidence) -> list[Cell]:
    paper = {
        ("mpm", "deformables and viscous"): "high",
        ("sph", "liquids"): "good",
        ("pbd", "deformables and viscous"): "plausible, not accurate",
        ("pbd", "liquids"): "plausible, not accurate",
    }
    cells = []
    for kind, physics in CLASSES.items():
        for method in METHODS:
            passed, judged, measured = _tally(e.trials, method, physics)
            word = paper.get((method, kind), "-")
            verdict = OPEN
            own = answers_of(e.trials, [method], physics)
            if judged >= FEWEST and word != "-" and told(own):
                share = passed / judged
                low = word.startswith("plausible")
                verdict = CONFIRMED if (share <= POOR if low else share >= GOOD) else REFUTED
            runs = runs_of(own)
            cells.append(Cell(f"fidelity, {kind}", method, word, measured, "validate", "fidelity", verdict, runs))
    return cells


def stability(e: Evidence) -> list[Cell]:
    """Largest stable steps as measured at two spacings, over d/c; the default step in seconds beside them."""
    words = {
        "mpm": ("medium, medium dt", "middle"),
        "sph": ("low, smaller dt", "lowest"),
        "pbd": ("high, larger dt", "highest"),
    }
    speed, dts = e.scenario.wave_speed, figures(e.repeats, "mean_dt_s")
    measured = {
        m: [r["dt_lump_s"] * speed / (r["value"] * e.scenario.spacing) for r in rows if r["verdict"] == HELD]
        for m, rows in e.limits.items()
    }
    places = ranked({m: v for m, v in measured.items() if len(v) >= FEWEST and len(v) == len(e.limits[m])})
    cells = []
    for m, (word, place) in words.items():
        beyond = ">= " if any(not r.get("lump_limit_found", True) for r in e.limits.get(m, [])) else ""
        steps = " and ".join(f"{v:.2f}" for v in measured.get(m, [])) or "not found"
        text = f"largest stable dt {beyond}{steps} d/c"
        text += f"; mean default dt {mean(dts[m]):.3g} s" if m in dts else ""
        verdict = placed(places[m], place) if len(places) == 3 else OPEN
        cells.append(Cell("stability / dt", m, word, text, "stability, compare", "step", verdict, e.repeats[m]))
    return cells


def cost(e: Evidence) -> list[Cell]:
    words = {"mpm": ("mid-high", "upper"), "sph": ("high", "highest"), "pbd": ("low", "lowest")}
    walls = figures(e.repeats, "wall_per_simulated_s")
    places = ranked(walls)
    enough = len(places) == 3 and min(map(len, walls.values())) > 1
    cells = []
    for m, (word, place) in words.items():
        if m in walls:
            spread = stdev(walls[m]) if len(walls[m]) > 1 else 0.0
            measured = f"{mean(walls[m]):.3g} ± {spread:.1g} wall s / simulated s"
            verdict = placed(places[m], place) if enough else OPEN
            cells.append(Cell("cost at equal spacing", m, word, measured, "compare", "cost", verdict, e.repeats[m]))
    for m, (word, place) in words.items():
        verdict, shares = equal_error(e.trials, m, place)
        measured = f"over the cheapest: {shares or 'no case that all three can run at several spacings'}"
        runs = runs_of([t for t in e.trials if t.case.name in COST_CASES and t.method == m])
        cells.append(Cell("cost at equal error", m, word, measured, "validate, levels", "equal error", verdict, runs))
    return cells


def best_for(e: Evidence) -> list[Cell]:
    paper = {
        "mpm": ("realistic viscoelastoplastic fluids", ("yield stress", "viscoelastic", "elastic")),
        "sph": ("realistic liquids", ("liquid",)),
    }
    cells = []
    for m, (word, physics) in paper.items():
        wins = winners(e.trials, physics)
        judged = sum(wins.values())
        verdict = OPEN if judged < FEWEST else CONFIRMED if wins.get(m, 0) > judged / 2 else REFUTED
        tally = ", ".join(f"{k} {n}" for k, n in sorted(wins.items(), key=lambda item: -item[1])) or "none"
        runs = runs_of(answers_of(e.trials, METHODS, physics))
        cells.append(
            Cell("best for", m, word, f"cheapest within tolerance on: {tally}", "validate", "best", verdict, runs)
        )
    walls = figures(e.repeats, "wall_per_simulated_s")
    paces = ", ".join(f"{k} {mean(v):.3g}" for k, v in walls.items())
    verdict = placed(ranked(walls)["pbd"], "lowest") if len(walls) == 3 else OPEN
    measured = f"at equal spacing, wall s / simulated s: {paces}"
    return [*cells, Cell("best for", "pbd", "real-time previews", measured, "compare", "cost", verdict, all_runs(e))]


def limits(e: Evidence) -> list[Cell]:
    cells = []
    sizes = figures(e.repeats, "bytes_per_particle")
    if len(sizes) == 3:
        volume = e.scenario.spacing**3
        measured = ", ".join(f"{m} {v[0]:.0f} B ({v[0] / volume / 1e9:.3g} GB/m^3)" for m, v in sizes.items())
        verdict = placed(ranked(sizes)["mpm"], "highest")
        cells.append(Cell("limits: memory", "mpm", "memory", measured, "compare", "cost", verdict, all_runs(e)))
    cells.append(grid_artifacts(e, "limits: grid artifacts", "grid artifacts"))
    for name, key, ends, unit, more in (
        ("viscosity, explicit", "material.viscosity", VISCOSITIES, "Pa s", {"numerics.sph.viscosity": "explicit"}),
        ("viscosity, implicit", "material.viscosity", VISCOSITIES, "Pa s", {"numerics.sph.viscosity": "implicit"}),
        ("yield stress", "material.yield_stress", YIELDS, "Pa", {}),
    ):
        first, last = (bound_dt(e.scenario, "sph", {key: value} | more) for value in ends)
        verdict = CONFIRMED if first / last >= COLLAPSE else REFUTED
        measured = f"dt {first:.3g} s at {ends[0]:g} {unit}, {last:.3g} s at {ends[1]:g}: {first / last:.3g}-fold"
        word = "non-Newtonian" if name == "yield stress" else "high viscosity"
        cells.append(Cell(f"limits: {name}", "sph", word, measured, "bounds", "collapse", verdict))
    return [*cells, physical_accuracy(e)]


def bound_dt(scenario: Scenario, method: str, settings: dict[str, Any]) -> float:
    """The step that a method's bounds allow on a varied scenario [s]."""
    changed, solver = varied(scenario.model_dump(mode="json"), settings), get_method(method)
    return min(b.dt for b in solver.bounds(changed, configure(solver, changed), changed.reference_speed))


def grid_artifacts(e: Evidence, row: str, word: str) -> Cell:
    """The bead's area at one particle a cell against eight and more, on each of two grids."""
    exact = _exact_area(e)
    off = {
        g: [abs(lengths_of(r.record)["bead_area_m2"] / exact - 1.0) for r in runs if r.ok]
        for g, runs in e.grids.items()
    }
    runs = [r for group in e.grids.values() for r in group]
    measured = "; ".join(
        f"{g**3:.2g} a cell: area off by {' and '.join(f'{a:.1%}' for a in v)}" for g, v in off.items() if v
    )
    if any(len(off.get(g, [])) < 2 for g in (1.0, 2.0, 3.0)):
        return Cell(row, "mpm", word, f"not every run completed; {measured}", "grid ratios", "artifacts", OPEN, runs)
    verdicts = [
        CONFIRMED if off[1.0][i] > max(EFFECT * max(off[2.0][i], off[3.0][i]), 0.01) else REFUTED for i in range(2)
    ]
    return Cell(row, "mpm", word, measured, "grid ratios, two grids", "artifacts", agreed(verdicts), runs)


def _exact_area(e: Evidence) -> float:
    """Q / V of the scenario [m^2]."""
    assert e.scenario.nozzle is not None and e.scenario.toolpath is not None
    return e.scenario.nozzle.rate / e.scenario.toolpath.speed


def physical_accuracy(e: Evidence) -> Cell:
    every = tuple(physics for group in CLASSES.values() for physics in group)
    passed, judged, measured = _tally(e.trials, "pbd", every)
    for name, sweep in (("iterations", e.iterations), ("spacings a step", e.advances)):
        widths = [(v, _widths(runs)) for v, runs in sweep.items()]
        shown = "; ".join(f"{v:g}: {' and '.join(f'{1e3 * w:.1f}' for w in seen)}" for v, seen in widths if seen)
        measured += f"; bead width [mm] over {name}: {shown}"
    own = answers_of(e.trials, ["pbd"], every)
    verdict = OPEN if judged < FEWEST or not told(own) else CONFIRMED if passed <= POOR * judged else REFUTED
    runs = [r for sweep in (e.iterations, e.advances) for group in sweep.values() for r in group]
    runs += runs_of(own)
    word = "low physical accuracy"
    return Cell("limits: accuracy", "pbd", word, measured, "validate, iterations, steps", "fidelity", verdict, runs)


def _widths(runs: Sequence[Run]) -> list[float]:
    return [width for r in runs if r.ok and (width := lengths_of(r.record).get("bead_width_m")) is not None]


def claims(e: Evidence) -> list[Cell]:
    """The sentences of the paper's text."""
    cells = []
    dts, walls = figures(e.repeats, "mean_dt_s"), figures(e.repeats, "wall_per_simulated_s")
    if {"mpm", "sph"} <= set(dts) and len(walls) == 3:
        ratio = mean(dts["mpm"]) / mean(dts["sph"])
        cells.append(
            Cell(
                "claim",
                "sph",
                "needs prohibitively small steps in this setting",
                f"dt is 1 / {ratio:.2f} of MPM's",
                "compare",
                "collapse",
                CONFIRMED if ratio >= COLLAPSE else REFUTED,
                all_runs(e),
            )
        )
        costs = ", ".join(f"{m} {mean(v):.3g}" for m, v in walls.items())
        cells.append(
            Cell(
                "claim",
                "sph",
                "would be the most expensive",
                f"wall s / simulated s: {costs}",
                "compare",
                "cost",
                placed(ranked(walls)["sph"], "highest"),
                all_runs(e),
            )
        )
    cells.append(bead_width(e))
    cells.append(prediction(e, "cannot predict deformation under load", DEFORMATION))
    cells.append(prediction(e, "cannot predict collapse", COLLAPSING))
    return [*cells, grid_artifacts(e, "claim", "grid artifacts with too few particles a cell")]


def prediction(e: Evidence, word: str, names: Sequence[str]) -> Cell:
    """PBD's known answers on a set of cases."""
    own = [t for t in e.trials if t.case.name in names and t.method == "pbd" and t.level in JUDGED and t.judged]
    missed = [t for t in own if not t.error <= t.tolerance]
    measured = ", ".join(
        f"{t.case.name}: " + (f"error {t.error:.2g} of {t.tolerance:g}" if t.finding is not None else str(t.verdict))
        for t in own
    )
    measured += f" ({SHIPPED})" if any(t.note == SHIPPED for t in own) else ""
    verdict = OPEN if len(own) < FEWEST or not told(own) else CONFIRMED if len(missed) > len(own) / 2 else REFUTED
    return Cell("claim", "pbd", word, measured or "not run", "validate", "prediction", verdict, runs_of(own))


def bead_width(e: Evidence) -> Cell:
    """PBD's bead against the mean of the others, at two spacings; open where those two disagree themselves."""
    word, verdicts, lines = "cannot predict bead width", [], []
    runs = [group[0] for group in e.repeats.values()] + list(e.second.values())
    for level in ({m: group[0] for m, group in e.repeats.items()}, e.second):
        widths = {m: _widths([run])[0] for m, run in level.items() if _widths([run])}
        if len(widths) < 3 or any(math.isnan(w) for w in widths.values()):
            verdicts.append(OPEN)
            continue
        others = mean([widths["mpm"], widths["sph"]])
        off, apart = abs(widths["pbd"] / others - 1.0), abs(widths["mpm"] - widths["sph"]) / others
        verdicts.append(OPEN if apart > APART else CONFIRMED if off > APART else REFUTED)
        lines.append(", ".join(f"{m} {1e3 * w:.1f} mm" for m, w in widths.items()) + f": off by {off:.0%}")
    measured = "; ".join(lines) or "a method did not lay a bead"
    return Cell("claim", "pbd", word, measured, "compare, two spacings", "prediction", agreed(verdicts), runs)
