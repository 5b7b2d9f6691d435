"""compare, run and validate: scenarios and cases through the methods."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..job import CHECKPOINTS
from .app import (
    Backend,
    Checkpoint,
    Device,
    Film,
    Frames,
    Fresh,
    Out,
    ScenarioName,
    Settings,
    Solvers,
    Spacing,
    Threads,
    WallLimit,
    app,
    load_scenario,
    methods_of,
    names_in,
    one_target,
    positive,
    repeats_of,
    seconds,
    store_in,
    targets_of,
    workers_for,
)

if TYPE_CHECKING:
    from ..study.execute import Finished

Quick = Annotated[bool, typer.Option("--quick", help="the scenario's own shorter and coarser version")]


@app.command()
def compare(
    scenario: ScenarioName,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    repeats: Annotated[int, typer.Option(min=1, help="runs of each method, for the spread of the cost")] = 1,
    device: Device = "cpu",
    backend: Annotated[str, typer.Option(help="languages of the kernels, separated by commas: warp, taichi")] = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    frames: Frames = False,
    quick: Quick = False,
    render_every: Film = None,
    fresh: Fresh = False,
    checkpoint_every: Checkpoint = CHECKPOINTS,
) -> None:
    """Run one scenario through several methods and put fidelity and cost side by side.

    A second call with the same inputs reuses the runs that are finished.
    """
    resolved = load_scenario(scenario, set_, spacing, quick)
    methods, targets = methods_of(solvers), targets_of(device, backend, threads)
    watched = _watched(wall_limit, frames, render_every, checkpoint_every)
    _study(resolved, methods, repeats_of(repeats), targets, watched, out, fresh, "compare")


@app.command()
def run(
    scenario: ScenarioName,
    solver: Annotated[str, typer.Option(help="the method")] = "mpm",
    set_: Settings = None,
    spacing: Spacing = None,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    frames: Frames = False,
    quick: Quick = False,
    render_every: Film = None,
    fresh: Fresh = False,
    checkpoint_every: Checkpoint = CHECKPOINTS,
) -> None:
    """Run one scenario through one method."""
    from ..solver import get_solver

    resolved, target = load_scenario(scenario, set_, spacing, quick), one_target(device, backend, threads)
    get_solver(solver)
    watched = _watched(wall_limit, frames, render_every, checkpoint_every)
    label = f"run-{solver}" + (f"-{backend}" if target.suffix else "")
    _study(resolved, [solver], 1, [target], watched, out, fresh, label)


def _watched(wall_limit: float, frames: bool, render_every: float | None, checkpoint_every: float) -> dict[str, Any]:
    """How runs are watched, as a Job says it; raises UserError for times that are none."""
    return {
        "wall_limit": seconds(wall_limit, "--wall-limit"), "keep_frames": frames,
        "film_every": None if render_every is None else positive(render_every, "--render-every"),
        "checkpoint_every": seconds(checkpoint_every, "--checkpoint-every", zero=True),
    }  # fmt: skip


@app.command()
def validate(
    cases: Annotated[list[str] | None, typer.Argument(help="cases (see `fluidbench list`); default all")] = None,
    solvers: Solvers = None,
    levels: Annotated[str, typer.Option(help="spacings: rough, coarse, medium, fine (1.5, 1, 2/3, 1/2)")] = "coarse",
    quick: Annotated[bool, typer.Option("--quick", help="a few minutes: the cheap cases, every physics")] = False,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 1800.0,
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default 2, or 1 on CUDA")] = None,
    fresh: Fresh = False,
) -> None:
    """Run cases with known answers through every method: error, observed order and cost beside the tolerance.

    A second call reuses the runs that are finished.
    """
    from rich.console import Console

    from ..report.validation import present
    from ..solver import check_backend, get_solver
    from ..study.case import select
    from ..study.validate import plan

    methods, target = methods_of(solvers), one_target(device, backend, threads)
    for method in methods:
        check_backend(get_solver(method), target)
    limit, workers = seconds(wall_limit, "--wall-limit"), workers_for(jobs, target)
    if cases:
        names_in(",".join(cases), "CASES", "case")
    trials = plan(select(cases or []), methods, names_in(levels, "--levels", "level"), quick, target, limit)
    store = store_in(out, "validate", fresh)
    _validate(trials, store, workers, Console(stderr=True))
    if not present(trials, store.root, Console(width=None if sys.stdout.isatty() else 120)):
        raise typer.Exit(1)


def _validate(trials: list[Any], store: Any, workers: int, console: Any) -> None:
    """Run the trials: at a terminal under a live display, otherwise with a line for each that has ended."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from ..report.validation import line
    from ..study.validate import run

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        overall = progress.add_task("cases", total=len(trials))
        tasks: dict[int, Any] = {}

        def started(i: int, trial: Any, reused: bool) -> None:
            if not reused:
                tasks[i] = progress.add_task(f"{trial.case.name} {trial.method} {trial.spacing:.3g} m", total=100)

        def step(i: int, state: dict[str, Any]) -> None:
            progress.update(tasks[i], completed=int(100 * state["time"] / state["until"]))

        def stopped(i: int) -> None:
            if i in tasks:
                progress.remove_task(tasks.pop(i))

        def ended(trial: Any) -> None:
            progress.advance(overall)
            console.print(line(trial), markup=False, highlight=False, soft_wrap=True)

        run(trials, store, workers, started, step, stopped, ended)


def _study(
    scenario: Any, methods: list[str], repeats: int, targets: list[Any], watched: dict[str, Any], out: Path | None,
    fresh: bool, label: str,
) -> None:  # fmt: skip
    """compare and run: everything is checked before anything is written."""
    from rich.console import Console

    from ..report.compare import publish
    from ..study.compare import jobs
    from ..verdict import lacking

    planned = jobs(scenario, methods, repeats, targets, **watched)
    store = store_in(out, scenario.name, fresh)
    console, errors = Console(), Console(stderr=True)
    for warning in scenario.warnings():
        errors.print(f"warning: {warning}", markup=False, highlight=False)
    results = _run_all(planned, store, errors)
    publish(results, store.root, console, label)
    _tell_reused(results, errors)
    if not any(r.ok for r in results) or lacking(results, refusals=False):
        raise typer.Exit(1)


def _tell_reused(results: list["Finished"], console: Any) -> None:
    """Which runs are of an earlier call, and of when."""
    old = [f"{r.label} ({r.record.get('machine', {}).get('time', 'no time')})" for r in results if r.reused]
    if old:
        console.print(f"reused: {', '.join(old)}; --fresh runs them again", markup=False, highlight=False)


def _run_all(planned: list[Any], store: Any, console: Any) -> list["Finished"]:
    """Run the jobs under a live display; quiet when not at a terminal."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from ..study.execute import Hooks, execute

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        tasks: dict[int, Any] = {}

        def started(i: int, job: Any, reused: bool) -> None:
            state = "finished earlier" if reused else "compiling"
            tasks[i] = progress.add_task(f"{job.method:<5}{job.target.suffix} {job.repeat + 1}", total=1.0, state=state)

        def step(i: int, state: dict[str, Any]) -> None:
            text = f"t = {state['time']:.3f} of {state['until']:g} s, top speed {state['speed']:.3g} m/s"
            progress.update(tasks[i], completed=state["time"] / state["until"], state=text)

        def ended(i: int, result: "Finished") -> None:
            progress.update(tasks[i], completed=1.0, state=result.verdict)

        return execute(planned, store, Hooks(started, step, ended))
