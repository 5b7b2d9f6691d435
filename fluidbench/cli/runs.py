"""compare, run and validate: scenarios and cases through the methods."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .app import (
    Backend,
    Device,
    Film,
    Frames,
    Out,
    ScenarioName,
    Settings,
    Spacing,
    Threads,
    WallLimit,
    app,
    load_scenario,
    one_target,
    split,
    targets_of,
    workers_for,
)

if TYPE_CHECKING:
    from ..study.execute import Finished

Quick = Annotated[bool, typer.Option("--quick", help="the scenario's own shorter and coarser version")]


@app.command()
def compare(
    scenario: ScenarioName,
    solvers: Annotated[str, typer.Option(help="methods, separated by commas; default all that are installed")] = "",
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
) -> None:
    """Run one scenario through several methods and put fidelity and cost side by side.

    A second call with the same inputs reuses the runs that are finished.
    """
    _study(
        scenario,
        solvers,
        set_,
        spacing,
        repeats,
        (device, backend, threads),
        out,
        wall_limit,
        frames,
        quick,
        render_every,
    )


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
) -> None:
    """Run one scenario through one method."""
    _study(scenario, solver, set_, spacing, 1, (device, backend, threads), out, wall_limit, frames, quick, render_every)


@app.command()
def validate(
    cases: Annotated[list[str] | None, typer.Argument(help="cases (see `fluidbench list`); default all")] = None,
    solvers: Annotated[str, typer.Option(help="methods, separated by commas; default all that are installed")] = "",
    levels: Annotated[str, typer.Option(help="spacings: rough, coarse, medium, fine (1.5, 1, 2/3, 1/2)")] = "coarse",
    quick: Annotated[bool, typer.Option("--quick", help="a few minutes: the cheap cases, every physics")] = False,
    device: Device = "cpu",
    backend: Backend = "warp",
    threads: Threads = 1,
    out: Out = None,
    wall_limit: WallLimit = 1800.0,
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default 2, or 1 on CUDA")] = None,
) -> None:
    """Run cases with known answers through every method: error, observed order and cost beside the tolerance.

    A second call reuses the runs that are finished.
    """
    from rich.console import Console

    from ..report.validation import present
    from ..solver import check_backend, get_solver, solver_names
    from ..store import Store
    from ..study.case import select
    from ..study.validate import plan

    methods = split(solvers) or solver_names()
    target = one_target(device, backend, threads)
    for method in methods:
        check_backend(get_solver(method), target)
    trials = plan(select(cases or []), methods, split(levels), quick, target, wall_limit)
    store = Store((out or Path("fluidbench-out") / "validate").resolve())
    _validate(trials, store, workers_for(jobs, target), Console(stderr=True))
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
    name: str, solvers: str, settings: list[str] | None, spacing: float | None, repeats: int,
    where: tuple[str, str, int], out: Path | None, wall_limit: float, frames: bool, quick: bool,
    film_every: float | None,
) -> None:  # fmt: skip
    """compare and run: everything is checked before anything is written."""
    from rich.console import Console

    from ..solver import solver_names
    from ..store import Store
    from ..study.compare import jobs

    scenario = load_scenario(name, settings, spacing, quick)
    methods = split(solvers) or solver_names()
    planned = jobs(scenario, methods, repeats, targets_of(*where), wall_limit, frames, film_every)
    console, errors = Console(), Console(stderr=True)
    for warning in scenario.warnings():
        errors.print(f"warning: {warning}", markup=False, highlight=False)
    store = Store((out or Path("fluidbench-out") / scenario.name).resolve())
    results = _run_all(planned, store, errors)
    _present(results, store.root, console)
    if not any(r.ok for r in results):
        raise typer.Exit(1)


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
            progress.update(tasks[i], completed=1.0, state=result.record["verdict"])

        return execute(planned, store, Hooks(started, step, ended))


def _present(results: list["Finished"], root: Path, console: Any) -> None:
    """Tables in the terminal; figures, tables and the page in the folder."""
    from ..report.figures import draw, draw_views
    from ..report.html import write_page
    from ..report.tables import against_reference, backends, costs, fidelity, successes
    from ..report.tables import show as print_table
    from ..report.traces import plots
    from ..study.compare import tidy, write_tables
    from ..study.execute import ADVICE

    write_tables(tidy(results), root)
    made = (fidelity(results), successes(results), against_reference(results), costs(results), backends(results))
    tables = [table for table in made if table is not None]
    drawn = plots(results)
    views = draw_views(results, root)
    for plot in drawn:
        draw(plot, root)
    page = write_page(results, tables, drawn, views, root)
    for table in tables:
        print_table(console, table)
    for result in results:
        if not result.ok:
            verdict = result.record["verdict"]
            console.print(
                f"{result.label}: {verdict}: {result.record['reason']}; {ADVICE.get(verdict, '')}", markup=False
            )
    console.print(f"report: {page}", markup=False, highlight=False, soft_wrap=True)
