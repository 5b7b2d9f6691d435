"""The command line: parses, calls a study, prints. Heavy imports stay inside the commands."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .errors import UserError

if TYPE_CHECKING:
    from .scenario import Scenario
    from .study.execute import Finished

app = typer.Typer(
    name="fluidbench", no_args_is_help=True, add_completion=False, rich_markup_mode=None,
    help="Measure MPM, weakly compressible SPH and PBD on identical extrusion scenarios: fidelity beside cost.",
)  # fmt: skip

ScenarioName = Annotated[str, typer.Argument(help="a shipped scenario (see `fluidbench list`) or a TOML file")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="override a key, e.g. material.yield_stress=50")]
Spacing = Annotated[float | None, typer.Option(help="particle spacing [m], instead of the scenario's")]
Device = Annotated[str, typer.Option(help="cpu, or cuda:0, cuda:1, ...")]
Out = Annotated[Path | None, typer.Option(help="output folder; default fluidbench-out/SCENARIO")]
WallLimit = Annotated[float, typer.Option(help="seconds a run may take; what cannot make it is stopped early")]
Frames = Annotated[bool, typer.Option("--frames", help="keep a snapshot of every output, not only of the last")]


@app.command()
def compare(
    scenario: ScenarioName,
    solvers: Annotated[str, typer.Option(help="methods, separated by commas; default all that are installed")] = "",
    set_: Settings = None,
    spacing: Spacing = None,
    repeats: Annotated[int, typer.Option(min=1, help="runs of each method, for the spread of the cost")] = 1,
    device: Device = "cpu",
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    frames: Frames = False,
) -> None:
    """Run one scenario through several methods and put fidelity and cost side by side.

    A second call with the same inputs reuses the runs that are finished.
    """
    _study(scenario, solvers, set_, spacing, repeats, device, out, wall_limit, frames)


@app.command()
def run(
    scenario: ScenarioName,
    solver: Annotated[str, typer.Option(help="the method")] = "mpm",
    set_: Settings = None,
    spacing: Spacing = None,
    device: Device = "cpu",
    out: Out = None,
    wall_limit: WallLimit = 900.0,
    frames: Frames = False,
) -> None:
    """Run one scenario through one method."""
    _study(scenario, solver, set_, spacing, 1, device, out, wall_limit, frames)


@app.command()
def validate(
    cases: Annotated[list[str] | None, typer.Argument(help="cases (see `fluidbench list`); default all")] = None,
    solvers: Annotated[str, typer.Option(help="methods, separated by commas; default all that are installed")] = "",
    levels: Annotated[str, typer.Option(help="spacings: rough, coarse, medium, fine (1.5, 1, 2/3, 1/2)")] = "coarse",
    quick: Annotated[bool, typer.Option("--quick", help="a few minutes: the cheap cases, every physics")] = False,
    device: Device = "cpu",
    out: Out = None,
    wall_limit: WallLimit = 1800.0,
    jobs: Annotated[int | None, typer.Option(min=1, help="runs at a time; default 2, or 1 on CUDA")] = None,
) -> None:
    """Run cases with known answers through every method: error, observed order and cost beside the tolerance.

    A second call reuses the runs that are finished.
    """
    from rich.console import Console

    from .report.validation import present
    from .solver import solver_names
    from .store import Store
    from .study.case import select
    from .study.validate import plan

    methods = _split(solvers) or solver_names()
    _check_device(device)
    trials = plan(select(cases or []), methods, _split(levels), quick, device, wall_limit)
    store = Store((out or Path("fluidbench-out") / "validate").resolve())
    _validate(trials, store, jobs or (2 if device == "cpu" else 1), Console(stderr=True))
    if not present(trials, store.root, Console(width=None if sys.stdout.isatty() else 120)):
        raise typer.Exit(1)


def _validate(trials: list[Any], store: Any, workers: int, console: Any) -> None:
    """Run the trials: at a terminal under a live display, otherwise with a line for each that has ended."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from .report.validation import line
    from .study.validate import run

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


@app.command("list")
def list_() -> None:
    """Shipped scenarios, cases with known answers and installed methods, one line each."""
    from .library import load, shipped
    from .solver import get_solver, solver_names
    from .study.case import cases

    typer.echo("scenarios")
    for name in shipped():
        typer.echo(f"  {name:<20} {load(name).title}")
    typer.echo("cases with known answers, for validate")
    for name, case in cases().items():
        typer.echo(f"  {name:<20} {case.title} ({case.physics})")
    typer.echo("solvers")
    for name in solver_names():
        typer.echo(f"  {name:<20} {(get_solver(name).__doc__ or '').strip().splitlines()[0]}")


@app.command()
def show(scenario: ScenarioName, set_: Settings = None, spacing: Spacing = None) -> None:
    """The resolved scenario, its derived numbers, each method's bounds, and what a run will need."""
    from rich.console import Console

    from .report.preview import preview
    from .report.tables import show as print_table

    resolved = _load(scenario, set_, spacing)
    console = Console()
    text, tables = preview(resolved)
    console.print(text, markup=False, highlight=False)
    for table in tables:
        print_table(console, table)


@app.command()
def doctor() -> None:
    """Devices and versions, what is missing and how to get it."""
    from .report.preview import diagnosis

    for line in diagnosis():
        typer.echo(line)


def _load(name: str, settings: list[str] | None, spacing: float | None) -> "Scenario":
    from .library import load

    extra = [f"spacing={spacing!r}"] if spacing is not None else []
    return load(name, [*(settings or []), *extra])


def _split(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _check_device(device: str) -> None:
    """Raise UserError unless the device exists."""
    if device == "cpu":
        return
    import warp as wp

    wp.config.quiet = True
    wp.init()
    known = ["cpu", *[d.alias for d in wp.get_cuda_devices()]]
    if device not in known:
        raise UserError(f"no device '{device}' on this machine; it has {', '.join(known)} (see `fluidbench doctor`)")


def _study(
    name: str, solvers: str, settings: list[str] | None, spacing: float | None, repeats: int, device: str,
    out: Path | None, wall_limit: float, frames: bool,
) -> None:  # fmt: skip
    """compare and run: everything is checked before anything is written."""
    from rich.console import Console

    from .solver import solver_names
    from .store import Store
    from .study.compare import jobs

    scenario = _load(name, settings, spacing)
    methods = _split(solvers) or solver_names()
    planned = jobs(scenario, methods, repeats, device, "warp", wall_limit, frames)
    _check_device(device)
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

    from .study.execute import Hooks, execute

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        tasks: dict[int, Any] = {}

        def started(i: int, job: Any, reused: bool) -> None:
            state = "finished earlier" if reused else "compiling"
            tasks[i] = progress.add_task(f"{job.method:<5} {job.repeat + 1}", total=1.0, state=state)

        def step(i: int, state: dict[str, Any]) -> None:
            text = f"t = {state['time']:.3f} of {state['until']:g} s, top speed {state['speed']:.3g} m/s"
            progress.update(tasks[i], completed=state["time"] / state["until"], state=text)

        def ended(i: int, result: "Finished") -> None:
            progress.update(tasks[i], completed=1.0, state=result.record["verdict"])

        return execute(planned, store, Hooks(started, step, ended))


def _present(results: list["Finished"], root: Path, console: Any) -> None:
    """Tables in the terminal; figures, tables and the page in the folder."""
    from .report.figures import draw, draw_views
    from .report.html import write_page
    from .report.tables import against_reference, costs, fidelity
    from .report.tables import show as print_table
    from .report.traces import plots
    from .study.compare import tidy, write_tables
    from .study.execute import ADVICE

    write_tables(tidy(results), root)
    tables = [t for t in (fidelity(results), against_reference(results), costs(results)) if t is not None]
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


def main() -> None:
    """Entry point: user errors are one line and exit code 2, an interruption can be resumed."""
    try:
        app(standalone_mode=True)
    except UserError as error:
        for line in str(error).splitlines():
            print(f"fluidbench: {line}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("fluidbench: interrupted; the same command resumes with what is not finished", file=sys.stderr)
        sys.exit(130)
