"""list, show and doctor: what there is, before anything runs."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app
from .options import ScenarioName, Settings, Spacing, load_scenario


@app.command("list")
def list_() -> None:
    """Shipped scenarios, cases with known answers and installed methods, one line each."""
    from ..registry import get_method
    from ..scenario.library import load, shipped
    from ..study.case import cases
    from ..study.workplace import methods_of

    typer.echo("scenarios")
    for name in shipped():
        typer.echo(f"  {name:<20} {load(name).title}")
    typer.echo("cases with known answers, for validate")
    for name, case in cases().items():
        typer.echo(f"  {name:<20} {case.title} ({case.physics})")
    typer.echo("solvers")
    for name in methods_of(None):
        typer.echo(f"  {name:<20} {(get_method(name).__doc__ or '').strip().splitlines()[0]}")


@app.command()
def show(
    scenario: ScenarioName,
    set_: Settings = None,
    spacing: Spacing = None,
    path: Annotated[bool, typer.Option("--path", help="the nozzle's path instead: its strokes, and a picture")] = False,
) -> None:
    """The resolved scenario, its derived numbers, each method's bounds, and what a run will need.

    With --path where the nozzle goes, how fast and how much it extrudes, before anything runs; path.png goes to
    fluidbench-out and the scenario.
    """
    from rich.console import Console

    from ..report.table import show as print_table
    from ..study.preview import preview

    resolved = load_scenario(scenario, set_, spacing)
    console = Console()
    if path:
        from ..study.route import draw, route

        tables, remarks = route(resolved)
        for table in tables:
            print_table(console, table)
        for line in remarks:
            console.print(line, markup=False, highlight=False)
        typer.echo(f"picture: {draw(resolved, Path('fluidbench-out') / resolved.name)}")
        return
    text, tables = preview(resolved)
    console.print(text, markup=False, highlight=False)
    for table in tables:
        print_table(console, table)


@app.command()
def doctor() -> None:
    """Devices and versions, what is missing and how to get it."""
    from ..study.preview import diagnosis

    for line in diagnosis():
        typer.echo(line)
