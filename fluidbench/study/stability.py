"""`stability`: the largest stable time step along each axis, beside each method's own bound and theory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

from ..method.verdict import lacking
from ..runs.experiment import Experiment
from ..scenario import Scenario
from .case import cases
from .points import ERROR, HELD, REFUSED, block_tasks, choose, measure_blocks, measure_points, point_tasks
from .result import Result
from .stability_report import report
from .trials import plan, run
from .workplace import Options, Workplace, as_scenario, methods_of, names_of

WALL_LIMIT = 1800.0  # s


@dataclass(repr=False)
class StabilityMap(Result):
    """Limits of the time step: `table` has a row for every point of every axis, and for every block of theory."""

    points: list[dict[str, Any]] = field(default_factory=list)
    blocks: list[dict[str, Any]] = field(default_factory=list)


def stability(
    scenario: Scenario | str | Path = "line_bead",
    methods: Sequence[str] | None = None,
    *,
    axes: Sequence[str] = (),
    quick: bool = False,
    **options: Unpack[Options],
) -> StabilityMap:
    """Find the largest stable time step along material and numerical axes, beside each method's bound and theory.

    `scenario` is one, a shipped name or a TOML file; `methods` are names, default all. `axes` are names (AXES, and
    those of the methods' own numerics), values in the units that they have there; default all. `quick`: fewer points,
    less precise. Steps are in [s]. `options` are those of every verb, see Options.

    Raises UserError for what is not known, before anything is run.
    """
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    chosen, place = choose(names_of(axes, "axes") or [], names), Workplace.of(options, WALL_LIMIT, names)
    blocks, points = block_tasks(names, quick, place.target), point_tasks(resolved, chosen, names, quick, place.target)

    def limited(work: Sequence[Experiment], title: str) -> list[Any]:
        return place.run([replace(one, wall_limit=place.wall_limit) for one in work], title, together=True)

    measured = measure_blocks(blocks, lambda work: limited(work, "blocks"))
    rows = measure_points(points, lambda work: limited(work, "points"))
    own = [case for case in cases().values() if case.about in names and place.target.device == "cpu"]
    trials = [t for c in own for t in plan([c], [c.about], ["coarse"], False, place.target, place.wall_limit)]
    if trials:
        run(trials, place, "own numerics")
    missing = lacking(trials)
    missing += [
        f"{p['axis']} = {p['value']:g}, {p['method']}: {p.get('reason', '')}" for p in rows if p["verdict"] == ERROR
    ]
    missing += [f"{b['kind']} block, {b['method']}: {b['reason']}" for b in measured if "reason" in b]
    ok = all(row["verdict"] in (HELD, REFUSED) for row in rows) and all(t.held for t in trials) and not missing
    runs = [found for trial in trials for found in trial.runs.values()]
    made = report(resolved, chosen, rows, measured, trials)
    return StabilityMap(made, place.store.root, runs, missing, ok, keeper=place.keeper, points=rows, blocks=measured)
