"""What `table1` rests on: known answers, the scenario through every method, sweeps at two resolutions, step limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..measure.reference import table as reference
from ..method.target import Target
from ..method.verdict import lacking
from ..registry import get_method
from ..runs.archive import where
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.library import load
from ..scenario.numerics import configure
from ..study.case import Case, Finding, cases
from ..study.points import ERROR, Spacing, measure_points, point_tasks, varied
from ..study.trials import Trial
from ..study.workplace import Workplace
from . import definitions as words
from .definitions import COST_CASES, METHODS

GRID_RATIOS, ITERATIONS, ADVANCES = (1.0, 1.5, 2.0, 3.0), (1, 2, 5, 10), (0.0625, 0.125, 0.25, 0.5)
SECOND = 4 / 3  # the second resolution of every sweep, over the first: no verdict may hang on one
LIMITS = Spacing("spacing", (0.5, 1.0), (0.5, 1.0), "of the scenario's")  # where the largest stable step is measured
VISCOUS = "honey_line"  # where the schemes of viscosity are told apart; PBD has one of its own
SCHEMES = ("explicit", "implicit")
NAMED = {words.STRANDS, *COST_CASES, *words.STRUCTURE, *words.CURING, *words.DEFORMATION, *words.COLLAPSING}
DEAR = (
    "slump_cylinder",
    "collapse_threshold",
    "oldroyd_drop_impact",
    "point_source_current",
    "viscous_column_slip",
    "self_weight_column",
    "slump_slip",
    "cantilever_sag",
    "curing_bead_arrest",
    "buildability_rate",
    "stiffening_under_load",
    words.STRANDS,
)
"""Cases that a quick study does not run: it takes their answers from the shipped table."""
SPREAD = 2  # runs in the other backend: the fewest that have a spread
SHIPPED = "from the shipped table of known answers"

Runs = dict[Any, list[Run]]
GROUPS = ("repeats", "second", "previews", "grids", "iterations", "advances", "other", *SCHEMES)
"""Runs of the scenario itself, by what they are for."""
SWEPT = ("grids", "iterations", "advances")  # those among them whose time is not asked for


@dataclass
class Evidence:
    """All that the verdicts rest on. Runs are of the scenario itself, by method or by a sweep's setting; of a sweep
    there is one at each resolution."""

    scenario: Scenario
    trials: list[Trial]
    repeats: Runs  # the scenario through each method, repeated
    second: Runs = field(default_factory=dict)  # the same at the second resolution
    previews: Runs = field(default_factory=dict)  # and coarser
    grids: Runs = field(default_factory=dict)
    iterations: Runs = field(default_factory=dict)
    advances: Runs = field(default_factory=dict)
    other: Runs = field(default_factory=dict)  # `repeats` in the other backend
    explicit: Runs = field(default_factory=dict)  # a viscous liquid, by explicit viscosity
    implicit: Runs = field(default_factory=dict)  # and by implicit
    limits: dict[str, list[dict[str, Any]]] = field(default_factory=dict)  # measured points of `stability`
    other_trials: list[Trial] = field(default_factory=list)  # COST_CASES in the other backend
    seed: int = 0

    @property
    def machine(self) -> str:
        """What it was run on, in a word or two."""
        return where(run for runs in self.repeats.values() for run in runs)

    @property
    def label(self) -> str:
        """What sets it apart from another study: the machine, and the seed where one was given."""
        return self.machine + f", seed {self.seed}" * (self.seed > 0)

    def group(self, name: str) -> Runs:
        """One of GROUPS."""
        return getattr(self, name)

    def take(self, name: str, runs: Runs) -> None:
        """Fill one of GROUPS."""
        setattr(self, name, runs)

    def sweeps(self) -> list[Run]:
        """Every run of the scenario itself."""
        return [run for name in GROUPS for runs in self.group(name).values() for run in runs]

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
    """The known answers that a rule asks for: all of them, or the cheap ones."""
    asked = [c for c in cases().values() if c.physics in (*words.DEFORMABLE, *words.LIQUIDS) or c.name in NAMED]
    return [c for c in asked if c.drive is None and not (quick and c.name in DEAR)]


def methods_of(case: Case) -> tuple[str, ...]:
    """The methods that a rule asks of a case."""
    return ("pbd",) if case.name == words.STRANDS else METHODS


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
    """The runs on the scenario itself, one at a time where their times are compared; known answers come finished."""
    table, target = scenario.model_dump(mode="json"), place.target
    honey = load(VISCOUS, quick=quick).model_dump(mode="json")
    other, cell = target.other, configure(get_method("mpm"), scenario).grid_ratio * scenario.spacing

    def job(
        method: str, settings: dict[str, Any], repeat: int = 0, where: Target = target, of: dict[str, Any] = table
    ) -> Job:
        changed = varied(of, settings).model_dump(mode="json")
        return Job(changed, method, where, repeat=repeat, wall_limit=place.wall_limit)

    def each(make: Callable[[str], list[Job]]) -> dict[Any, list[Job]]:
        return {m: make(m) for m in METHODS}

    def sweep(
        method: str, values: Sequence[float], setting: Callable[[float, float], dict[str, Any]]
    ) -> dict[Any, list[Job]]:
        return {value: [job(method, setting(value, factor)) for factor in (1.0, SECOND)] for value in values}

    def viscous(scheme: str) -> dict[Any, list[Job]]:
        def setting(m: str) -> dict[str, Any]:
            return {} if m == "pbd" else {f"numerics.{m}.viscosity": scheme}

        return each(lambda m: [job(m, setting(m), r, of=honey) for r in range(SPREAD)])

    groups = {
        "repeats": each(lambda m: [job(m, {}, r) for r in range(repeats)]),
        "second": each(lambda m: [job(m, {"spacing": SECOND * scenario.spacing})]),
        "previews": each(lambda m: [job(m, {"spacing": f * scenario.spacing}) for f in words.PREVIEWS]),
        "grids": sweep("mpm", GRID_RATIOS, lambda g, f: {"numerics.mpm.grid_ratio": g, "spacing": f * cell / g}),
        "iterations": sweep("pbd", ITERATIONS, lambda n, f: _pbd("iterations", n, f * scenario.spacing)),
        "advances": sweep("pbd", ADVANCES, lambda a, f: _pbd("advance", a, f * scenario.spacing)),
        "other": {} if other is None else each(lambda m: [job(m, {}, r, other) for r in range(SPREAD)]),
        **{scheme: viscous(scheme) for scheme in SCHEMES},
    }
    found = Evidence(scenario, trials, {})
    for together, title in ((False, "the scenario"), (True, "sweeps")):
        own = {name: group for name, group in groups.items() if (name in SWEPT) == together}
        planned = [work for group in own.values() for works in group.values() for work in works]
        made = iter(place.run(planned, title, together=together))
        for name, group in own.items():
            found.take(name, {key: [next(made) for _ in works] for key, works in group.items()})
    tasks = point_tasks(scenario, {"spacing": LIMITS}, METHODS, quick, target)
    rows = measure_points(tasks, lambda work: place.run(work, "limits", together=True))
    found.limits = {m: [r for r in rows if r["method"] == m] for m in METHODS}
    return found


def _pbd(key: str, value: float, spacing: float) -> dict[str, Any]:
    return {f"numerics.pbd.{key}": value, "spacing": spacing}
