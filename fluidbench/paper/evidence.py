"""What `table1` rests on: known answers, the scenario through every method, sweeps at two resolutions, step limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..measure.reference import table as reference
from ..method.target import Target
from ..method.verdict import lacking
from ..registry import get_method
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.numerics import configure
from ..study.case import Case, Finding, cases
from ..study.points import ERROR, Spacing, measure_points, point_tasks, varied
from ..study.trials import Trial
from ..study.workplace import Workplace

METHODS = ("mpm", "sph", "pbd")
GRID_RATIOS, ITERATIONS, ADVANCES = (1.0, 1.5, 2.0, 3.0), (1, 2, 5, 10), (0.0625, 0.125, 0.25, 0.5)
SECOND = 4 / 3  # the second resolution of every sweep, over the first: no verdict may hang on one
LIMITS = Spacing("spacing", (0.5, 1.0), (0.5, 1.0), "of the scenario's")  # where the largest stable step is measured
COST_CASES = ("dam_break", "elliptic_drop", "bead_area")  # cases that all methods can run, at several spacings
DEAR = (
    "slump_cylinder",
    "collapse_threshold",
    "oldroyd_drop_impact",
    "point_source_current",
    "viscous_column_slip",
    "self_weight_column",
    "bead_strand_shape",
    "slump_slip",
    "cantilever_sag",
    "rigid_rotation",
    "curing_bead_arrest",
    "free_expansion",
    "buildability_rate",
    "stiffening_under_load",
)
"""Cases that a quick study does not run: it takes their answers from the shipped table."""
SPREAD = 2  # runs in the other backend: the fewest that have a spread
SHIPPED = "from the shipped table of known answers"


@dataclass
class Evidence:
    """All that the verdicts rest on. Sweeps: setting -> a run at each resolution."""

    scenario: Scenario
    trials: list[Trial]
    repeats: dict[str, list[Run]]  # the scenario through each method, repeated
    second: dict[str, Run] = field(default_factory=dict)  # the same at the second resolution
    grids: dict[float, list[Run]] = field(default_factory=dict)
    iterations: dict[float, list[Run]] = field(default_factory=dict)
    advances: dict[float, list[Run]] = field(default_factory=dict)
    limits: dict[str, list[dict[str, Any]]] = field(default_factory=dict)  # measured points of `stability`
    other: dict[str, list[Run]] = field(default_factory=dict)  # `repeats` in the other backend
    other_trials: list[Trial] = field(default_factory=list)  # COST_CASES in the other backend

    def sweeps(self) -> list[Run]:
        """Every run of the scenario itself."""
        groups = [
            *self.repeats.values(),
            *self.grids.values(),
            *self.iterations.values(),
            *self.advances.values(),
            *self.other.values(),
            list(self.second.values()),
        ]
        return [run for group in groups for run in group]

    def runs(self) -> list[Run]:
        """Every run that was made for it."""
        return [*self.sweeps(), *(run for t in [*self.trials, *self.other_trials] for run in t.runs.values())]

    def missing(self) -> list[str]:
        """What it needed and has nothing of, one line each, with the reason."""
        points = [p for rows in self.limits.values() for p in rows if p.get("verdict") == ERROR]
        judged = [t for t in [*self.trials, *self.other_trials] if t.judged]
        return lacking([*self.sweeps(), *judged]) + [
            f"stability, {p['axis']} = {p['value']:g}, {p['method']}: {p['verdict']}: {p['reason']}" for p in points
        ]


def chosen_cases(quick: bool) -> list[Case]:
    """The known answers to be run: all, or the cheap ones."""
    return [c for c in cases().values() if not quick or c.name not in DEAR]


def levels_of(case: Case, quick: bool) -> tuple[str, ...]:
    """The spacings at which a case is run: several where cost is compared at equal error."""
    if case.name not in COST_CASES:
        return ("coarse",)
    return ("rough", "coarse") if quick else ("rough", "coarse", "medium")


def shipped() -> list[Trial]:
    """The dear known answers, as `validate` found them when the shipped table was made."""
    known, found = cases(), []
    for row in reference("known_answers").to_dict("records"):
        if row["case"] in DEAR and row["method"] in METHODS and row["verdict"] != "skipped":
            finding = None if row["error"] != row["error"] else Finding(row["error"])
            cost = {key: row[key] for key in ("particles", "wall_s", "wall_per_simulated_s")}
            found.append(
                Trial(
                    known[row["case"]],
                    row["method"],
                    "coarse",
                    row["spacing_m"],
                    {},
                    row["verdict"],
                    SHIPPED,
                    finding,
                    cost,
                )
            )
    return found


def gather(scenario: Scenario, trials: list[Trial], repeats: int, quick: bool, place: Workplace) -> Evidence:
    """The runs on the scenario itself, one at a time so that times mean something; known answers come finished."""
    table, target = scenario.model_dump(mode="json"), place.target
    other, cell = target.other, configure(get_method("mpm"), scenario).grid_ratio * scenario.spacing

    def job(method: str, settings: dict[str, Any], repeat: int = 0, where: Target = target) -> Job:
        changed = varied(table, settings).model_dump(mode="json")
        return Job(changed, method, where, repeat=repeat, wall_limit=place.wall_limit)

    def sweep(method: str, values: Sequence[float], setting: Callable[[float, float], dict[str, Any]]) -> list[Job]:
        return [job(method, setting(value, factor)) for value in values for factor in (1.0, SECOND)]

    groups = {
        "repeats": [job(m, {}, r) for m in METHODS for r in range(repeats)],
        "other": [job(m, {}, r, other) for m in METHODS for r in range(SPREAD)] if other is not None else [],
        "second": [job(m, {"spacing": SECOND * scenario.spacing}) for m in METHODS],
        "grids": sweep("mpm", GRID_RATIOS, lambda g, f: {"numerics.mpm.grid_ratio": g, "spacing": f * cell / g}),
        "iterations": sweep("pbd", ITERATIONS, lambda n, f: _pbd("iterations", n, f * scenario.spacing)),
        "advances": sweep("pbd", ADVANCES, lambda a, f: _pbd("advance", a, f * scenario.spacing)),
    }
    made = iter(place.run([work for group in groups.values() for work in group], "the scenario"))
    runs = {name: [next(made) for _ in group] for name, group in groups.items()}
    found = Evidence(scenario, trials, _by(METHODS, runs["repeats"]))
    found.other = _by(METHODS, runs["other"]) if runs["other"] else {}
    found.second = dict(zip(METHODS, runs["second"], strict=True))
    found.grids, found.iterations = _by(GRID_RATIOS, runs["grids"]), _by(ITERATIONS, runs["iterations"])
    found.advances = _by(ADVANCES, runs["advances"])
    tasks = point_tasks(scenario, {"spacing": LIMITS}, METHODS, quick, target)
    rows = measure_points(tasks, lambda work: place.run(work, "limits", together=True))
    found.limits = {m: [r for r in rows if r["method"] == m] for m in METHODS}
    return found


def _by(keys: Sequence[Any], runs: list[Run]) -> dict[Any, list[Run]]:
    """Runs in equal shares, in order."""
    share = len(runs) // len(keys)
    return {key: runs[i * share : (i + 1) * share] for i, key in enumerate(keys)}


def _pbd(key: str, value: float, spacing: float) -> dict[str, Any]:
    return {f"numerics.pbd.{key}": value, "spacing": spacing}
