"""stability, ablate, select, table1 and table2: studies made of many runs."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .app import (
    Backend,
    Device,
    Fresh,
    Out,
    ScenarioName,
    Settings,
    Solvers,
    Spacing,
    Threads,
    WallLimit,
    app,
    budget_of,
    count_of,
    fraction,
    load_scenario,
    methods_of,
    names_in,
    one_target,
    repeats_of,
    seconds,
    store_in,
    workers_for,
)

if TYPE_CHECKING:
    from ..store import Store
    from ..target import Target

Quick = Annotated[bool, typer.Option("--quick", help="fewer points and shorter runs: minutes instead of an hour")]
Jobs = Annotated[int | None, typer.Option(min=1, help="experiments at a time; default 2, or 1 on CUDA")]


@app.command()
def stability(
    scenario: ScenarioName = "line_bead",
    axis: Annotated[str | None, typer.Option(help="axes, separated by commas; default all: viscosity, youngs_modulus, "
                                             "poisson_ratio, yield_stress, exit_speed, density, spacing, "
                                             "particles_per_cell")] = None,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    quick: Quick = False,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    jobs: Jobs = None,
    fresh: Fresh = False,
) -> None:  # fmt: skip
    """Find the largest stable time step along material and numerical axes, beside each method's bound and theory.

    A second call reuses the points that are finished.
    """
    from ..report.stability import report
    from ..study.case import select
    from ..study.stability import HELD, REFUSED, block_tasks, choose, measure_blocks, measure_points, point_tasks

    resolved = load_scenario(scenario, set_, spacing)
    axes = choose([] if axis is None else names_in(axis, "--axis", "axis"))
    target = one_target(device, backend, threads)
    methods, store, workers = _prepare(solvers, target, out, "stability", jobs, fresh)
    blocks = block_tasks(methods, quick, target)
    points = point_tasks(resolved, axes, methods, quick, target)
    stiffness = select(["pbd_stiffness"]) if "pbd" in methods and target.device == "cpu" else []
    with _watch("stability", len(blocks) + len(points)) as tell:
        measured = measure_blocks(blocks, store, workers, lambda i, _: tell(blocks[i][0]))
        rows = measure_points(points, store, workers, lambda i, r: tell(f"{points[i][0]} {r['verdict']}"))
    trials = _judged(stiffness, ["pbd"], target, store, workers)
    _publish(report(resolved, rows, measured, trials), store.root)
    if any(row["verdict"] not in (HELD, REFUSED) for row in rows) or any("reason" in block for block in measured):
        raise typer.Exit(1)


def _prepare(
    solvers: str | None, target: "Target", out: Path | None, verb: str, jobs: int | None, fresh: bool
) -> "tuple[list[str], Store, int]":
    """Methods, output folder and number of workers; everything is checked before anything is written."""
    from ..device import quiet_warp
    from ..solver import check_backend, get_solver

    quiet_warp()
    methods, workers = methods_of(solvers), workers_for(jobs, target)
    for method in methods:
        check_backend(get_solver(method), target)
    return methods, store_in(out, verb, fresh), workers


def _end_with(missing: list[str]) -> None:
    """Name the runs that a study lacks, and end with a status that says so."""
    import sys

    for line in missing:
        print(f"fluidbench: lacking: {line}", file=sys.stderr)
    if missing:
        raise typer.Exit(1)


def _judged(cases: list[Any], methods: list[str], target: "Target", store: "Store", workers: int) -> list[Any]:
    """Cases with known answers, run and judged without a display."""
    from ..study.validate import plan, run

    trials = plan(cases, methods, ["coarse"], False, target, 1800.0)
    run(trials, store, workers, *[lambda *_: None] * 4)
    return trials


class _watch:
    """A progress bar over the steps of a study; quiet when not at a terminal."""

    def __init__(self, title: str, total: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        console = Console(stderr=True)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self.progress = Progress(*columns, console=console, disable=not console.is_terminal)
        self.task = self.progress.add_task(title, total=total)

    def __enter__(self) -> Callable[[str], None]:
        self.progress.start()
        return lambda text: self.progress.update(self.task, advance=1, description=text)

    def __exit__(self, *_: object) -> None:
        self.progress.stop()


def _publish(report: Any, root: Path) -> None:
    import sys

    from rich.console import Console

    from ..report.study import publish

    publish(report, root, Console(width=None if sys.stdout.isatty() else 120))


@app.command()
def ablate(
    scenario: ScenarioName,
    solvers: Solvers = None,
    tolerance: Annotated[str, typer.Option(help="how far a length may move, e.g. 5%")] = "5%",
    set_: Settings = None,
    spacing: Spacing = None,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    jobs: Jobs = None,
    fresh: Fresh = False,
) -> None:
    """Switch physical features off and numerical economies on, one at a time: what moves, what is saved.

    Ends with the leanest mix that stays within the tolerance, confirmed by a run. A second call reuses finished runs.
    """
    from ..report.ablate import report
    from ..study.ablate import ablate as study
    from ..study.ablate import changes
    from ..study.execute import Hooks

    resolved, share = load_scenario(scenario, set_, spacing), fraction(tolerance)
    target = one_target(device, backend, threads)
    limit = seconds(wall_limit, "--wall-limit")
    methods, store, workers = _prepare(solvers, target, out, "ablate", jobs, fresh)
    total = len(methods) + sum(len(methods) if c.method is None else 1 for c in changes(resolved, methods))
    with _watch("ablate", total) as tell:
        hooks = Hooks(lambda *_: None, lambda *_: None, lambda _, r: tell(f"{r.label} {r.record['verdict']}"))
        done = study(resolved, methods, share, store, hooks, workers, target, limit)
    given = [*(set_ or []), *([f"spacing={spacing!r}"] if spacing is not None else [])]
    _publish(report(resolved, scenario, given, done, share, store.root), store.root)
    _end_with(done.missing())


@app.command()
def select(
    scenario: ScenarioName,
    tolerance: Annotated[str, typer.Option(help="largest relative error of any length, e.g. 5%")] = "5%",
    budget: Annotated[str | None, typer.Option(help="wall time of a run, e.g. 60s, or realtime; default none")] = None,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    fresh: Fresh = False,
) -> None:
    """Recommend a method, spacing and time step: least cost within a tolerance, on this machine, with the evidence.

    Runs every method at four spacings. A second call, with another tolerance or budget, reuses the runs.
    """
    from ..report.select import report
    from ..study.execute import Hooks
    from ..study.select import FACTORS
    from ..study.select import select as study

    resolved, share = load_scenario(scenario, set_, spacing), fraction(tolerance)
    longest, pace = budget_of(budget)
    target = one_target(device, backend, threads)
    limit = seconds(wall_limit, "--wall-limit")
    methods, store, _ = _prepare(solvers, target, out, f"select-{resolved.name}", 1, fresh)
    with _watch("select", len(methods) * len(FACTORS)) as tell:
        hooks = Hooks(lambda *_: None, lambda *_: None, lambda _, r: tell(f"{r.label} {r.record['verdict']}"))
        chosen = study(resolved, methods, store, hooks, target, limit)
    _publish(report(resolved, scenario, chosen, share, longest, pace, store.root), store.root)
    _end_with(chosen.missing())
    if not chosen.candidates:
        raise typer.Exit(1)


@app.command()
def table1(
    scenario: ScenarioName = "line_bead",
    repeats: Annotated[int, typer.Option(min=2, help="runs of each method on the scenario, for the spread")] = 3,
    set_: Settings = None,
    spacing: Spacing = None,
    quick: Quick = False,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 1800.0,
    jobs: Jobs = None,
    fresh: Fresh = False,
) -> None:
    """Judge the published table of adjectives: every cell beside a measured number and a verdict computed by a rule.

    A second call reuses the runs that are finished.
    """
    from ..report.table1 import report
    from ..study.evidence import COST_CASES, METHODS, chosen_cases, gather, levels_of, planned, shipped
    from ..study.execute import Hooks
    from ..study.validate import plan, run

    coarser = 4 / 3 if quick and spacing is None else 1.0
    resolved = load_scenario(scenario, set_, spacing)
    resolved = load_scenario(scenario, set_, coarser * resolved.spacing)
    target = one_target(device, backend, threads)
    limit, repeats = seconds(wall_limit, "--wall-limit"), repeats_of(repeats)
    methods, store, workers = _prepare(",".join(METHODS), target, out, "table1", jobs, fresh)

    def known_answers(chosen: list[Any], where: "Target") -> list[Any]:
        trials = [t for c in chosen for t in plan([c], methods, levels_of(c, quick), False, where, limit)]
        with _watch(f"known answers{where.suffix}", len(trials)) as tell:
            none = lambda *_: None  # noqa: E731
            run(trials, store, workers, none, none, none, lambda t: tell(f"{t.case.name} {t.method} {t.verdict}"))
        return trials

    trials = known_answers(chosen_cases(quick), target) + (shipped() if quick else [])
    others = []
    if target.other is not None and not quick:
        others = known_answers([case for case in chosen_cases(quick) if case.name in COST_CASES], target.other)
    with _watch("the scenario", planned(repeats, target)) as tell:
        hooks = Hooks(lambda *_: None, lambda *_: None, lambda _, r: tell(f"{r.label} {r.record['verdict']}"))
        evidence = gather(resolved, trials, repeats, quick, store, hooks, workers, target, limit)
    evidence.other_trials = others
    _publish(report(evidence, store.root), store.root)
    _end_with(evidence.missing())


@app.command()
def table2(
    solvers: Solvers = "mpm",
    pools: Annotated[str, typer.Option(help="pool sizes to preallocate; `fit` is as many as needed")] = "fit,298000",
    repeats: Annotated[int, typer.Option(min=1, help="runs of each row, without and with pictures")] = 5,
    quick: Quick = False,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 1800.0,
    fresh: Fresh = False,
) -> None:
    """Time the printed tower, feature by feature, with and without pictures; the paper's claims as verdicts.

    A second call reuses the runs that are finished.
    """
    from ..report.table2 import report
    from ..study.execute import Hooks
    from ..study.table2 import VARIANTS, check_pools
    from ..study.table2 import table2 as study

    target = one_target(device, backend, threads)
    limit, repeats = seconds(wall_limit, "--wall-limit"), repeats_of(repeats)
    sizes = [None if part == "fit" else count_of(part, "--pools") for part in names_in(pools, "--pools", "pool")]
    check_pools(sizes, quick)
    methods, store, _ = _prepare(solvers, target, out, "table2", 1, fresh)
    with _watch("table2", 2 * repeats * len(VARIANTS) * len(methods) * len(sizes)) as tell:
        hooks = Hooks(lambda *_: None, lambda *_: None, lambda _, r: tell(f"{r.label} {r.record['verdict']}"))
        rows = study(methods, sizes, repeats, quick, store, hooks, target, limit)
    _publish(report(rows, store.root), store.root)
    _end_with([line for row in rows for line in row.missing()])
