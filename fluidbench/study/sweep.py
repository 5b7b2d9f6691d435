"""`sweep`: a scenario over the points of a grid, through every method; many points in one launch where a method can."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from ..errors import UserError, quoted
from ..method.verdict import Evidence, Verdict, evidence_of, lacking
from ..registry import get_method
from ..runs.experiment import CRASH, Experiment
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Scenario
from .points import varied
from .result import Result
from .sweep_report import report
from .workplace import Options, Workplace, as_scenario, methods_of, require_number
from .worlds import MOST, run_batches, shared

WALL_LIMIT = 900.0  # s
LARGEST = 10_000  # points
PER_PROCESS = 8  # batches that a process on a GPU runs, one after the other: starting one takes longer than many runs
Axes = Mapping[str, Sequence[Any]]


@dataclass
class Point:
    """One point through one method, and what came of it: `together` points shared the launches and the cost."""

    settings: dict[str, Any]
    scenario: Scenario
    method: str
    verdict: str = ""
    reason: str = ""
    measures: dict[str, float] = field(default_factory=dict)
    cost: dict[str, float] = field(default_factory=dict)
    together: int = 1
    print: str = ""  # what became of one
    warnings: list[str] = field(default_factory=list)
    run: Run | None = None  # where it ran alone

    @property
    def name(self) -> str:
        """The point in words."""
        return f"{self.method}, " + ", ".join(f"{key} = {value}" for key, value in self.settings.items())

    @property
    def evidence(self) -> Evidence:
        return evidence_of(self.verdict)


@dataclass(repr=False)
class Sweep(Result):
    """A scenario over a grid: `table` has a row for every point and method."""

    points: list[Point] = field(default_factory=list)


def sweep(
    scenario: Scenario | str | Path,
    over: Axes,
    methods: Sequence[str] | None = None,
    *,
    worlds: int | None = None,
    quick: bool = False,
    **options: Unpack[Options],
) -> Sweep:
    """Run a scenario at every combination of values of some of its keys, through every method.

    `scenario` is one, a shipped name (`quick`: its shorter version) or a TOML file. `over`: values by dotted key, as
    {"material.yield_stress": [20, 65, 110]}, in SI units or with a unit; `methods` are names, default all. Points that
    differ in their material or body force alone (and little in wave speed) share launches, up to `worlds` at once:
    default 64 on a GPU, and 1 on a CPU, where that saves nothing. They advance by the smallest step that any of them
    needs. Where such a batch fails, its points run one by one. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    resolved, names = as_scenario(scenario, quick), methods_of(methods, options)
    if worlds is not None:
        require_number(worlds, "worlds", 1, whole=True, high=LARGEST)
    place = Workplace.of(options, WALL_LIMIT, names)
    grid = points_of(resolved, over)
    points = [Point(settings, s, method) for method in names for settings, s in grid]
    most = worlds or (1 if place.target.device == "cpu" else MOST)
    machine, notes = run_shared(points, place, most)
    run_alone([p for p in points if not p.verdict], place)
    missing = lacking(points, refusals=False)
    ok = any(p.evidence is Evidence.RESULT for p in points) and not missing
    runs = [p.run for p in points if p.run is not None]
    root = place.store.root
    return Sweep(
        report(resolved, list(over), points, machine, notes, root), root, runs, missing, ok, place.keeper, points
    )


def points_of(scenario: Scenario, over: Axes) -> list[tuple[dict[str, Any], Scenario]]:
    """(settings, scenario) of every point; the last key varies fastest. Raises UserError for a key or a value that the
    scenario does not have, for none and for too many."""
    if not isinstance(over, Mapping) or not over:
        raise UserError("over: a key and its values are wanted, as material.yield_stress=20:200:5")
    over = {key: values.tolist() if isinstance(values, np.ndarray) else values for key, values in over.items()}
    for key, values in over.items():
        if not isinstance(key, str):
            raise UserError(f"over: keys are names such as material.yield_stress (got {quoted(key)})")
        if isinstance(values, str | bytes) or not isinstance(values, Sequence) or not values:
            raise UserError(f"over: {quoted(key)[1:-1]}: a list of values is wanted (got {quoted(values)})")
        if len({str(value) for value in values}) < len(values):
            raise UserError(f"over: {quoted(key)[1:-1]}: a value is named twice")
    grid = list(itertools.islice(itertools.product(*over.values()), LARGEST + 1))
    if len(grid) > LARGEST:
        raise UserError(f"over: more than {LARGEST} points")
    table, found = scenario.model_dump(mode="json"), []
    for values in grid:
        settings = dict(zip(over, values, strict=True))
        where = ", ".join(f"{quoted(key)[1:-1]} = {quoted(value)}" for key, value in settings.items())
        try:
            found.append((settings, varied(table, settings)))
        except UserError as error:
            raise UserError(f"over: {where}: {error}") from None
    return found


def run_shared(points: Sequence[Point], place: Workplace, most: int) -> tuple[dict[str, str], list[str]]:
    """Run points that can share launches; returns on what, and which batches did not complete, whose points are left as
    they were."""
    machine: dict[str, str] = {}
    notes: list[str] = []
    several = 1 if place.target.device == "cpu" else PER_PROCESS
    chunks: list[list[list[Point]]] = []
    for method in dict.fromkeys(p.method for p in points):
        own = [p for p in points if p.method == method]
        groups = shared(get_method(method), [p.scenario for p in own], place.target, most)
        batches = [[own[i] for i in group] for group in groups if len(group) > 1]
        chunks += [batches[i : i + several] for i in range(0, len(batches), several)]
    found = place.run([_experiment(chunk, place) for chunk in chunks], "batches", together=True) if chunks else []
    for chunk, ended in zip(chunks, found, strict=True):
        if CRASH in ended:
            notes.append(f"{sum(map(len, chunk))} points of {chunk[0][0].method} ran alone: {ended[CRASH]}")
            continue
        machine = ended["machine"]
        for batch, told in zip(chunk, ended["batches"], strict=True):
            if told["verdict"] == Verdict.COMPLETED:
                _tell(batch, told)
            else:
                notes.append(f"{len(batch)} points of {batch[0].method} ran alone: {told['verdict']}: {told['reason']}")
    return machine, notes


def _tell(batch: Sequence[Point], told: dict[str, Any]) -> None:
    """Give the points of a batch what came of it; one that broke is left as it was."""
    for point, own in zip(batch, told["points"], strict=True):
        if own["complaint"]:
            continue
        point.verdict, point.measures = told["verdict"], own["measures"]
        point.cost, point.together = told["cost"], len(batch)
        point.print = own["print"] or ""
        point.warnings = [*point.scenario.warnings(), *own["warnings"]]  # as those of a point that ran alone


def _experiment(chunk: Sequence[Sequence[Point]], place: Workplace) -> Experiment:
    first, number = chunk[0][0], sum(map(len, chunk))
    task = {
        "batches": [[p.scenario.model_dump(mode="json") for p in batch] for batch in chunk],
        "method": first.method,
        "target": asdict(place.target),
        "wall_limit": place.wall_limit,
    }
    function = f"{run_batches.__module__}:{run_batches.__name__}"
    label, limit = f"{first.scenario.name}-{first.method}-x{number}", len(chunk) * place.wall_limit
    return Experiment(function, label, first.method, task, place.target, limit)


def run_alone(points: Sequence[Point], place: Workplace) -> None:
    """Run points in processes of their own."""
    planned = [
        Job(p.scenario.model_dump(mode="json"), p.method, place.target, wall_limit=place.wall_limit) for p in points
    ]
    for point, run in zip(points, place.run(planned, "points", together=True) if planned else [], strict=True):
        point.verdict, point.reason, point.run = run.verdict, run.reason, run
        point.measures = run.record.measures
        point.print, point.warnings = run.record.print or "", list(run.record.warnings)
        point.cost = run.record.counted.model_dump(exclude_none=True) if run.record.counted is not None else {}
