"""`table1`: the published table of adjectives, every cell beside what was measured, judged by verdicts.py."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from statistics import mean, stdev
from typing import Any

from ..run import Job
from ..scenario import Scenario
from ..solver import configure, get_solver
from ..store import Store
from .case import Case, cases
from .compare import lengths_of
from .execute import Finished, Hooks, execute
from .stability import varied
from .validate import Trial
from .verdicts import (
    COLLAPSE,
    CONFIRMED,
    EFFECT,
    FEWEST,
    GOOD,
    OPEN,
    POOR,
    REFUTED,
    at_equal_error,
    placed,
    ranked,
    share_within,
    winners,
)

CLASSES = {
    "deformables and viscous": ("viscous", "yield stress", "elastic", "viscoelastic"),
    "liquids": ("liquid",),
}
SWEEP_GRID, SWEEP_ITERATIONS = (1.0, 1.5, 2.0, 3.0), (1, 2, 5, 10)  # MPM grid ratios, PBD iterations
VISCOSITIES, YIELDS = (1e-3, 1e3), (0.0, 1e4)  # ends of an axis: Pa s, Pa
COST_CASES = ("dam_break", "elliptic_drop", "bead_area")  # cases that all methods can run, at several spacings
DEAR = (
    "slump_cylinder", "collapse_threshold", "oldroyd_drop_impact", "point_source_current", "viscous_column_slip",
    "self_weight_column", "bead_strand_shape", "slump_slip", "cantilever_sag", "rigid_rotation",
)  # fmt: skip
"""Cases that a quick study leaves out."""


@dataclass
class Cell:
    """A row of the table: what the paper says of a method, what was measured, by which experiment, and the verdict."""

    row: str
    method: str
    paper: str
    measured: str
    experiment: str
    rule: str
    verdict: str


@dataclass
class Evidence:
    """All that the verdicts rest on."""

    scenario: Scenario
    trials: list[Trial]  # known answers, several spacings for COST_CASES
    repeats: dict[str, list[Finished]]  # the scenario through each method, repeated
    grids: dict[float, Finished] = field(default_factory=dict)
    iterations: dict[int, Finished] = field(default_factory=dict)


def chosen_cases(quick: bool) -> list[Case]:
    """The known answers that verdicts rest on: all, or the cheap ones."""
    return [c for c in cases().values() if not quick or c.name not in DEAR]


def levels_of(case: Case, quick: bool) -> tuple[str, ...]:
    """The spacings at which a case is run: several where cost is compared at equal error."""
    if case.name not in COST_CASES:
        return ("coarse",)
    return ("rough", "coarse") if quick else ("rough", "coarse", "medium")


def gather(
    scenario: Scenario, trials: list[Trial], repeats: int, store: Store, hooks: Hooks, device: str, wall_limit: float
) -> Evidence:
    """The runs on the scenario itself, one at a time; known answers come finished."""

    def job(method: str, settings: dict[str, Any], repeat: int = 0) -> Job:
        changed = varied(scenario.model_dump(mode="json"), settings)
        return Job(changed.model_dump(mode="json"), method, device, repeat=repeat, wall_limit=wall_limit)

    methods = ("mpm", "sph", "pbd")
    planned = [job(m, {}, r) for m in methods for r in range(repeats)]
    cell = configure(get_solver("mpm"), scenario).grid_ratio * scenario.spacing
    planned += [job("mpm", {"numerics.mpm.grid_ratio": g, "spacing": cell / g}) for g in SWEEP_GRID]  # one grid
    planned += [job("pbd", {"numerics.pbd.iterations": n}) for n in SWEEP_ITERATIONS]
    runs = execute(planned, store, hooks)
    found = Evidence(scenario, trials, {})
    for i, method in enumerate(methods):
        found.repeats[method] = runs[i * repeats : (i + 1) * repeats]
    after = len(methods) * repeats
    found.grids = dict(zip(SWEEP_GRID, runs[after:], strict=False))
    found.iterations = dict(zip(SWEEP_ITERATIONS, runs[after + len(SWEEP_GRID) :], strict=False))
    return found


def table1(e: Evidence) -> list[Cell]:
    """Every cell of the paper's table, then its claims in words."""
    return [*paradigm(), *fidelity(e), *stability(e), *cost(e), *best_for(e), *limits(e), *claims(e)]


def paradigm() -> list[Cell]:
    words = {"mpm": "hybrid particle-grid", "sph": "particles, mesh-free", "pbd": "particles, constraints"}
    return [Cell("paradigm", m, words[m], get_solver(m).paradigm, "none", "definition", OPEN) for m in words]


def fidelity(e: Evidence) -> list[Cell]:
    paper = {
        ("mpm", "deformables and viscous"): "high", ("sph", "liquids"): "good",
        ("pbd", "deformables and viscous"): "plausible, not accurate", ("pbd", "liquids"): "plausible, not accurate",
    }  # fmt: skip
    cells = []
    for kind, physics in CLASSES.items():
        for method in ("mpm", "sph", "pbd"):
            passed, judged = share_within(e.trials, method, physics)
            word = paper.get((method, kind), "-")
            verdict = OPEN
            if judged >= FEWEST and word != "-":
                share = passed / judged
                low = word.startswith("plausible")
                verdict = CONFIRMED if (share <= POOR if low else share >= GOOD) else REFUTED
            measured = f"{passed} of {judged} known answers within tolerance"
            cells.append(Cell(f"fidelity, {kind}", method, word, measured, "validate", "fidelity", verdict))
    return cells


def _figures(e: Evidence, key: str) -> dict[str, list[float]]:
    """A cost figure of every completed repeat; methods that never completed are missing."""
    found = {m: [r.record["cost"][key] for r in runs if r.ok] for m, runs in e.repeats.items()}
    return {m: values for m, values in found.items() if values}


def stability(e: Evidence) -> list[Cell]:
    dts = _figures(e, "mean_dt_s")
    unit = e.scenario.spacing / e.scenario.wave_speed
    words = {
        "mpm": ("medium, medium dt", "middle"),
        "sph": ("low, smaller dt", "lowest"),
        "pbd": ("high, larger dt", "highest"),
    }
    places = ranked(dts)
    return [
        Cell("stability / dt", m, word, f"mean dt {mean(dts[m]):.3g} s = {mean(dts[m]) / unit:.2f} d/c", "compare",
             "step", placed(places[m], place) if len(places) == 3 else OPEN)
        for m, (word, place) in words.items() if m in dts
    ]  # fmt: skip


def cost(e: Evidence) -> list[Cell]:
    walls = _figures(e, "wall_per_simulated_s")
    places = ranked(walls)
    words = {"mpm": ("mid-high", "upper"), "sph": ("high", "highest"), "pbd": ("low", "lowest")}
    cells = []
    for m, (word, place) in words.items():
        if m in walls:
            spread = stdev(walls[m]) if len(walls[m]) > 1 else 0.0
            measured = f"{mean(walls[m]):.3g} ± {spread:.1g} wall s / simulated s"
            enough = len(places) == 3 and min(map(len, walls.values())) > 1
            verdict = placed(places[m], place) if enough else OPEN
            cells.append(Cell("cost at equal spacing", m, word, measured, "compare", "cost", verdict))
    equal = {name: at_equal_error([t for t in e.trials if t.case.name == name]) for name in COST_CASES}
    for m, (word, place) in words.items():
        seen = {name: costs[m] for name, costs in equal.items() if m in costs}
        shares = [seen[n] / min(equal[n].values()) for n in seen]
        verdict = OPEN
        if len(seen) >= FEWEST:
            tops = [placed(ranked({k: [v] for k, v in equal[n].items()})[m], place) for n in seen if len(equal[n]) == 3]
            if len(tops) >= FEWEST:
                verdict = CONFIRMED if tops.count(CONFIRMED) > len(tops) / 2 else REFUTED
        measured = (
            ", ".join(f"{n}: x {s:.2g}" for n, s in zip(seen, shares, strict=True)) or "no case at several spacings"
        )
        cells.append(
            Cell("cost at equal error", m, word, f"over the cheapest: {measured}", "validate, levels", "cost", verdict)
        )
    return cells


def best_for(e: Evidence) -> list[Cell]:
    paper = {"mpm": ("realistic viscoelastoplastic fluids", ("yield stress", "viscoelastic", "elastic")),
             "sph": ("realistic liquids", ("liquid",)),
             "pbd": ("real-time previews", ("liquid", "viscous", "yield stress"))}  # fmt: skip
    cells = []
    for m, (word, physics) in paper.items():
        if m == "pbd":
            walls = _figures(e, "wall_per_simulated_s")
            fastest = min(walls, key=lambda k: mean(walls[k]), default="")
            verdict = OPEN if len(walls) < 3 else CONFIRMED if fastest == m else REFUTED
            paces = ", ".join(f"{k} {mean(v):.3g}" for k, v in walls.items())
            measured = f"fastest at equal spacing: {fastest} (wall s / s: {paces})"
            cells.append(Cell("best for", m, word, measured, "compare", "cost", verdict))
            continue
        wins = winners(e.trials, physics)
        judged = sum(wins.values())
        verdict = OPEN if judged < FEWEST else CONFIRMED if wins.get(m, 0) > judged / 2 else REFUTED
        tally = ", ".join(f"{k} {n}" for k, n in sorted(wins.items(), key=lambda item: -item[1])) or "none"
        cells.append(Cell("best for", m, word, f"cheapest within tolerance on: {tally}", "validate", "best", verdict))
    return cells


def limits(e: Evidence) -> list[Cell]:
    cells = []
    sizes = _figures(e, "bytes_per_particle")
    order = ranked(sizes)
    if "mpm" in sizes:
        volume = e.scenario.spacing**3
        measured = ", ".join(f"{m} {v[0]:.0f} B ({v[0] / volume / 1e9:.3g} GB/m^3)" for m, v in sizes.items())
        verdict = placed(order["mpm"], "highest") if len(order) == 3 else OPEN
        cells.append(Cell("limits: memory", "mpm", "memory", measured, "compare", "cost", verdict))
    cells.append(grid_artifacts(e))
    for name, key, ends, unit in (("viscosity", "material.viscosity", VISCOSITIES, "Pa s"),
                                  ("yield stress", "material.yield_stress", YIELDS, "Pa")):  # fmt: skip
        first, last = (bound_dt(e.scenario, "sph", {key: value}) for value in ends)
        verdict = CONFIRMED if first / last >= COLLAPSE else REFUTED
        measured = f"dt {first:.3g} s at {ends[0]:g} {unit}, {last:.3g} s at {ends[1]:g}: {first / last:.3g}-fold"
        word = "high viscosity" if name == "viscosity" else "non-Newtonian"
        cells.append(Cell(f"limits: {name}", "sph", word, measured, "bounds", "collapse", verdict))
    cells.append(physical_accuracy(e))
    return cells


def bound_dt(scenario: Scenario, method: str, settings: dict[str, Any]) -> float:
    """The step that a method's bounds allow on a varied scenario [s]."""
    changed, solver = varied(scenario.model_dump(mode="json"), settings), get_solver(method)
    return min(b.dt for b in solver.bounds(changed, configure(solver, changed), changed.reference_speed))


def grid_artifacts(e: Evidence) -> Cell:
    """The bead's area at one particle a cell against eight and more, on one grid."""
    done = {g: lengths_of(r.record) for g, r in e.grids.items() if r.ok}
    word, rule = "grid artifacts", "artifacts"
    if 1.0 not in done or 2.0 not in done or 3.0 not in done:
        return Cell("limits: grid artifacts", "mpm", word, "a run did not complete", "grid ratios", rule, OPEN)
    area = {g: abs(row["bead_area_m2"] / _exact_area(e) - 1.0) for g, row in done.items() if "bead_area_m2" in row}
    measured = ", ".join(f"{g**3:.2g} a cell: area off by {a:.1%}" for g, a in area.items())
    dense = max(area[2.0], area[3.0])
    verdict = CONFIRMED if area[1.0] > EFFECT * max(dense, 0.01) else REFUTED
    return Cell("limits: grid artifacts", "mpm", word, measured, "grid ratios", rule, verdict)


def _exact_area(e: Evidence) -> float:
    """Q / V of the scenario [m^2]."""
    assert e.scenario.nozzle is not None and e.scenario.toolpath is not None
    return e.scenario.nozzle.rate / e.scenario.toolpath.speed


def physical_accuracy(e: Evidence) -> Cell:
    every = {physics for group in CLASSES.values() for physics in group}
    passed, judged = share_within(e.trials, "pbd", tuple(every))
    widths = [f"n = {n}: {1e3 * lengths_of(r.record)['bead_width_m']:.1f} mm" for n, r in e.iterations.items()
              if r.ok and "bead_width_m" in lengths_of(r.record)]  # fmt: skip
    verdict = OPEN if judged < FEWEST else CONFIRMED if passed <= POOR * judged else REFUTED
    measured = f"{passed} of {judged} known answers within tolerance; bead width over iterations: {', '.join(widths)}"
    return Cell(
        "limits: accuracy", "pbd", "low physical accuracy", measured, "validate, iterations", "fidelity", verdict
    )


def claims(e: Evidence) -> list[Cell]:
    cells = []
    dts, walls = _figures(e, "mean_dt_s"), _figures(e, "wall_per_simulated_s")
    if {"mpm", "sph"} <= set(dts) and len(walls) == 3:
        ratio = mean(dts["mpm"]) / mean(dts["sph"])
        cells.append(Cell(
            "claim", "sph", "needs prohibitively small steps in this setting", f"dt is 1 / {ratio:.2f} of MPM's",
            "compare", "collapse", CONFIRMED if ratio >= COLLAPSE else REFUTED,
        ))  # fmt: skip
        costs = ", ".join(f"{m} {mean(v):.3g}" for m, v in walls.items())
        cells.append(Cell(
            "claim", "sph", "would be the most expensive", f"wall s / simulated s: {costs}", "compare", "cost",
            placed(ranked(walls)["sph"], "highest"),
        ))  # fmt: skip
    cells += [bead_width(e)]
    for name, word in (("slump_cylinder", "cannot predict deformation under load"),
                       ("collapse_threshold", "cannot predict collapse")):  # fmt: skip
        own = [t for t in e.trials if t.case.name == name and t.method == "pbd" and t.level == "coarse"]
        if own:
            off = math.isnan(own[0].error) or own[0].error > own[0].tolerance
            measured = f"error {own[0].error:.3g} of {own[0].tolerance:g} ({own[0].verdict})"
            cells.append(Cell("claim", "pbd", word, measured, name, "prediction", CONFIRMED if off else REFUTED))
        else:
            cells.append(Cell("claim", "pbd", word, "not run in a quick study", name, "prediction", OPEN))
    artifacts = grid_artifacts(e)
    cells.append(Cell("claim", "mpm", "grid artifacts with too few particles a cell", artifacts.measured, "grid ratios",
                      "artifacts", artifacts.verdict))  # fmt: skip
    return cells


def bead_width(e: Evidence) -> Cell:
    widths = {
        m: [lengths_of(r.record).get("bead_width_m", math.nan) for r in runs if r.ok] for m, runs in e.repeats.items()
    }
    word, rule = "cannot predict bead width", "prediction"
    if any(not v or math.isnan(v[0]) for v in widths.values()) or len(widths) < 3:
        return Cell("claim", "pbd", word, "a method did not lay a bead", "compare", rule, OPEN)
    others = mean([widths["mpm"][0], widths["sph"][0]])
    off = abs(widths["pbd"][0] / others - 1.0)
    apart = abs(widths["mpm"][0] - widths["sph"][0]) / others
    verdict = OPEN if apart > 0.1 else CONFIRMED if off > 0.1 else REFUTED
    measured = ", ".join(f"{m} {1e3 * v[0]:.1f} mm" for m, v in widths.items())
    return Cell("claim", "pbd", word, f"{measured}; off by {off:.0%}", "compare", rule, verdict)
