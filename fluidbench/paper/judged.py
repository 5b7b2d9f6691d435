"""The published table of adjectives, every cell beside what was measured, judged by verdicts.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import geometric_mean, mean, stdev
from typing import Any

from ..method.verdict import Evidence as Weight
from ..registry import get_method
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.numerics import configure
from ..study.lengths import lengths_of
from ..study.points import HELD, varied
from ..study.trials import Trial
from . import definitions as words
from .cells import Cell, all_runs, figures, paces, runs_of
from .claims import UNTOLD, claims
from .definitions import CONFIRMED, COST_CASES, COST_PLACES, EFFECT, FEWEST, METHODS, OPEN, REFUTED
from .elsewhere import EQUAL_ERROR, EQUAL_SPACING, ask_elsewhere, cost_place
from .evidence import SHIPPED, Evidence
from .verdicts import (
    agreed,
    answers_of,
    at_equal_cost,
    equal_error,
    high,
    in_real_time,
    low,
    placed,
    ranked,
    sensitivity,
    share_is,
    told,
    winners,
    within,
)

DEFORMABLES, LIQUIDS = "deformables and viscous", "liquids"
CLASSES = {DEFORMABLES: words.DEFORMABLE, LIQUIDS: words.LIQUIDS}
VISCOSITIES, YIELDS = (1e-3, 1e3), (0.0, 1e4)  # ends of an axis: Pa s, Pa


def cells(e: Evidence) -> list[Cell]:
    """Every cell of the paper's table, then its claims in words. Where nothing ran there is no verdict at all: what is
    shipped, and bounds, say nothing of code that does not run."""
    found = [*fidelity(e), *stability(e), *cost(e), *best_for(e), *limits(e), *claims(e)]
    ask_elsewhere(found, e)
    if all(run.evidence is Weight.NOTHING for run in e.runs()):
        found = [replace(cell, verdict=OPEN, sensitivity="", elsewhere={}) for cell in found]
    return found


def tally(own: Sequence[Trial]) -> str:
    """So many of so many known answers, in words."""
    passed, judged = within(own)
    old, lost = sum(t.note == SHIPPED for t in own), len(own) - judged
    said = f"{passed} of {judged} known answers within tolerance" + f" ({old} {SHIPPED})" * (old > 0)
    return said + f"; {lost} could not be run" * (lost > 0)


def answered(
    row: str, aspect: str, method: str, paper: str, rule: str, own: Sequence[Trial], right: Callable[[float], bool]
) -> Cell:
    """A cell on the share of a method's known answers that is within tolerance."""

    def judge(trials: Sequence[Trial], factor: float) -> str:
        return share_is(trials, right, factor)

    brief = "{} of {} known answers".format(*within(own))
    verdict = judge(own, 1.0)
    return Cell(
        row,
        aspect,
        method,
        paper,
        brief,
        tally(own),
        "validate",
        rule,
        verdict,
        runs_of(own),
        sensitivity(own, judge),
    )


def fidelity(e: Evidence) -> list[Cell]:
    paper = {
        ("mpm", DEFORMABLES): ("high", high),
        ("sph", LIQUIDS): ("good", high),
        ("pbd", DEFORMABLES): ("plausible, not accurate", low),
        ("pbd", LIQUIDS): ("plausible, not accurate", low),
    }
    found = []
    for (method, kind), (word, right) in paper.items():
        own = answers_of(e.trials, [method], CLASSES[kind])
        cell = answered("fidelity", kind, method, word, "fidelity", own, right)
        shares = equal_cost(e.trials, method, CLASSES[kind])
        cell.measured += f"; error over the best at equal cost: {shares}" if shares else ""
        found.append(cell)
    return found


def equal_cost(trials: Sequence[Trial], method: str, physics: Sequence[str]) -> str:
    """A method's error over the best one's at equal cost, on each case of a class that was run at several spacings."""
    shown = []
    for name in COST_CASES:
        own = [t for t in trials if t.case.name == name and t.case.physics in physics]
        errors = at_equal_cost(own)
        if method in errors:
            shown.append(f"{name} x {errors[method] / min(errors.values()):.2g} ({errors[method]:.2g})")
    return ", ".join(shown)


def stability(e: Evidence) -> list[Cell]:
    """Largest stable steps as measured at two spacings, over d/c; the default step in seconds beside them."""
    paper = {
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
    more = {m for m, rows in e.limits.items() if any(not r.get("lump_limit_found", True) for r in rows)}
    known = len(places) == 3 and all(places[m][1] == 0 for m in more)  # what may be more is nobody's lower
    found = []
    for m, (word, place) in paper.items():
        beyond = ">= " if m in more else ""
        steps = [f"{v:.2f}" for v in measured.get(m, [])]
        text = f"largest stable dt {beyond}{' and '.join(steps) or 'not found'} d/c"
        text += f"; mean default dt {mean(dts[m]):.3g} s" if m in dts else ""
        verdict = placed(places[m], place) if known else OPEN
        brief = f"stable to {beyond}{', '.join(steps) or '?'} d/c"
        runs = e.repeats.get(m, [])
        by = f"fluidbench stability {e.scenario.name} --axis spacing --solvers {m}, and compare"
        found.append(Cell("stability and dt", "", m, word, brief, text, by, "step", verdict, runs))
    return found


def cost(e: Evidence) -> list[Cell]:
    walls = paces(e.repeats)
    found = []
    for m, (word, place) in COST_PLACES.items():
        brief, measured, verdict, runs = UNTOLD, UNTOLD, OPEN, e.repeats.get(m, [])
        if m in walls:
            spread = stdev(walls[m]) if len(walls[m]) > 1 else 0.0
            brief = f"{mean(walls[m]):.3g} s a simulated s"
            measured = f"{mean(walls[m]):.3g} ± {spread:.1g} s for a simulated second"
            verdict = cost_place(e.repeats, m, place)
        found.append(Cell("cost", EQUAL_SPACING, m, word, brief, measured, "compare", "cost", verdict, runs))
    for m, (word, place) in COST_PLACES.items():
        verdict, shares = equal_error(e.trials, m, place)
        measured = "over the cheapest: " + ", ".join(f"{n}: x {x:.2g}" for n, x in shares.items())
        measured = measured if shares else "no case that all three can run at several spacings"
        brief = f"x {geometric_mean(shares.values()):.2g} the cheapest" if shares else "not compared"
        runs = runs_of([t for t in e.trials if t.case.name in COST_CASES and t.method == m])
        cell = Cell("cost", EQUAL_ERROR, m, word, brief, measured, "validate, levels", "equal error", verdict, runs)
        found.append(cell)
    return found


def best_for(e: Evidence) -> list[Cell]:
    paper = {
        "mpm": ("realistic viscoelastoplastic fluids", words.FLUIDS),
        "sph": ("realistic liquids", words.LIQUIDS),
    }
    found = []
    for m, (word, physics) in paper.items():

        def judge(trials: Sequence[Trial], factor: float, m: str = m, physics: Sequence[str] = physics) -> str:
            wins = winners(trials, physics, factor)
            judged = sum(wins.values())
            if judged < FEWEST or not told(trials):
                return OPEN
            return CONFIRMED if wins.get(m, 0) > judged / 2 else REFUTED

        own = answers_of(e.trials, METHODS, physics)
        wins = winners(own, physics)
        shown = ", ".join(f"{k} {n}" for k, n in sorted(wins.items(), key=lambda item: -item[1])) or "no case"
        brief = f"cheapest on {wins.get(m, 0)} of {sum(wins.values())}"
        measured, verdict = f"cheapest within tolerance on: {shown}", judge(own, 1.0)
        runs, hangs = runs_of(own), sensitivity(own, judge)
        found.append(Cell("best for", "", m, word, brief, measured, "validate", "best", verdict, runs, hangs))
    return [*found, previews(e)]


def previews(e: Evidence) -> Cell:
    """Real time: with how many particles, and how far off the bead's area is at the spacing next to that."""
    every = {m: [*e.repeats.get(m, [])[:1], *e.second.get(m, []), *e.previews.get(m, [])] for m in METHODS}
    most = {m: in_real_time(runs) for m, runs in every.items()}
    shown = []
    for m, n in most.items():
        done = [r for r in every[m] if r.ok]
        if math.isfinite(n) and done:
            near = min(done, key=lambda r: abs(math.log(r.cost.peak_particles / n)))
            off = abs(bead_area(near) / exact_area(e) - 1.0)
            shown.append(f"{m} {n:.2g} (with {near.cost.peak_particles}, area off by {off:.1%})")
    others = [most[m] for m in METHODS if m != "pbd"]
    verdict = OPEN
    if all(map(math.isfinite, most.values())):
        verdict = CONFIRMED if most["pbd"] > EFFECT * max(others) else REFUTED
    brief = "particles in real time: " + ", ".join(f"{m} {n:.2g}" for m, n in most.items() if math.isfinite(n))
    measured = "particles in real time: " + (", ".join(shown) or "not found")
    runs = [r for group in every.values() for r in group]
    word = "real-time previews"
    return Cell("best for", "", "pbd", word, brief, measured, "compare, four spacings", "real time", verdict, runs)


def limits(e: Evidence) -> list[Cell]:
    found = []
    found.append(memory(e))
    found.append(grid_artifacts(e))
    for aspect, paper, key, ends, unit, more in (
        ("explicit viscosity", "high viscosity", "material.viscosity", VISCOSITIES, "Pa s", "explicit"),
        ("implicit viscosity", "high viscosity", "material.viscosity", VISCOSITIES, "Pa s", "implicit"),
        ("yield stress", "non-Newtonian", "material.yield_stress", YIELDS, "Pa", None),
    ):
        scheme = {} if more is None else {"numerics.sph.viscosity": more}
        first, last = (bound_dt(e.scenario, "sph", {key: value} | scheme) for value in ends)
        verdict = CONFIRMED if first / last >= words.COLLAPSE else REFUTED
        measured = f"dt {first:.3g} s at {ends[0]:g} {unit}, {last:.3g} s at {ends[1]:g}: {first / last:.3g}-fold"
        brief = "step as it is" if first / last < 1.01 else f"step shrinks {first / last:.3g}-fold"
        found.append(Cell("limits", aspect, "sph", paper, brief, measured, "bounds", "collapse", verdict))
    return [*found, physical_accuracy(e)]


def memory(e: Evidence) -> Cell:
    sizes = figures(e.repeats, "bytes_per_particle")
    brief, measured, verdict = UNTOLD, UNTOLD, OPEN
    if len(sizes) == 3:
        volume = e.scenario.spacing**3
        measured = ", ".join(f"{m} {v[0]:.0f} B ({v[0] / volume / 1e9:.3g} GB/m^3)" for m, v in sizes.items())
        brief = f"{sizes['mpm'][0]:.0f} B a particle (sph {sizes['sph'][0]:.0f}, pbd {sizes['pbd'][0]:.0f})"
        verdict = placed(ranked(sizes)["mpm"], "highest")
    return Cell("limits", "memory", "mpm", "memory", brief, measured, "compare", "cost", verdict, all_runs(e))


def bound_dt(scenario: Scenario, method: str, settings: dict[str, Any]) -> float:
    """The step that a method's bounds allow on a varied scenario [s]."""
    changed, solver = varied(scenario.model_dump(mode="json"), settings), get_method(method)
    return min(b.dt for b in solver.bounds(changed, configure(solver, changed), changed.reference_speed))


def grid_artifacts(e: Evidence) -> Cell:
    """The bead's area at one particle a cell against eight and more, on each of two grids."""
    exact, runs = exact_area(e), [r for group in e.grids.values() for r in group]
    off = {g: [abs(bead_area(r) / exact - 1.0) for r in own if r.ok] for g, own in e.grids.items()}
    shown = {g: [f"{a:.1%}" for a in v] + [str(r.verdict) for r in e.grids[g] if not r.ok] for g, v in off.items()}
    measured = "; ".join(f"{g**3:.2g} a cell: area off by {' and '.join(v)}" for g, v in shown.items() if v)
    brief = f"area off {', '.join(shown.get(1.0, []))} at 1 a cell, {', '.join(shown.get(2.0, []))} at 8"
    blown = [r.evidence is Weight.INSTABILITY for r in e.grids.get(1.0, [])]
    verdicts = [OPEN]
    finite = all(math.isfinite(a) for g in (1.0, 2.0, 3.0) for a in off.get(g, []))
    if finite and all(len(off.get(g, [])) == 2 for g in (2.0, 3.0)):
        if len(off.get(1.0, [])) == 2:
            full = [max(EFFECT * max(off[2.0][i], off[3.0][i]), words.ARTIFACT) for i in range(2)]
            verdicts = [CONFIRMED if off[1.0][i] > full[i] else REFUTED for i in range(2)]
        elif len(blown) == 2 and all(blown):
            verdicts = [CONFIRMED]
    return Cell(
        "limits",
        "grid",
        "mpm",
        "grid artifacts, if too few particles occupy a cell",
        brief,
        measured,
        "grid ratios, two grids",
        "artifacts",
        agreed(verdicts),
        runs,
    )


def bead_area(run: Run) -> float:
    """Of a finished bead [m^2]; NaN where none was laid."""
    return lengths_of(run.record).get("bead_area_m2", math.nan)


def exact_area(e: Evidence) -> float:
    """Q / V of the scenario [m^2]."""
    assert e.scenario.nozzle is not None and e.scenario.toolpath is not None
    return e.scenario.nozzle.rate / e.scenario.toolpath.speed


def physical_accuracy(e: Evidence) -> Cell:
    every = tuple(physics for group in CLASSES.values() for physics in group)
    own = answers_of(e.trials, ["pbd"], every)
    cell = answered("limits", "accuracy", "pbd", "low physical accuracy", "fidelity", own, low)
    for name, sweep in (("iterations", e.iterations), ("spacings a step", e.advances)):
        widths = [(v, bead_widths(runs)) for v, runs in sweep.items()]
        shown = "; ".join(f"{v:g}: {' and '.join(f'{1e3 * w:.1f}' for w in seen)}" for v, seen in widths if seen)
        cell.measured += f"; bead width [mm] over {name}: {shown}"
    cell.experiment = "validate, iterations, steps"
    sweeps = [r for sweep in (e.iterations, e.advances) for group in sweep.values() for r in group]
    cell.runs = [*sweeps, *cell.runs]
    return cell


def bead_widths(runs: Sequence[Run]) -> list[float]:
    """Widths of the beads that were laid [m]."""
    return [width for r in runs if r.ok and (width := lengths_of(r.record).get("bead_width_m")) is not None]
