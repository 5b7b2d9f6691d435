"""The application, and how a study's result leaves it."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import Halted, Obstacle

if TYPE_CHECKING:
    from ..study.result import Result

app = typer.Typer(
    name="fluidbench",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="Measure MPM, weakly compressible SPH and PBD on identical extrusion scenarios: fidelity beside cost.",
)


def _tell_version(asked: bool) -> None:
    from .. import __version__

    if asked:
        typer.echo(f"fluidbench {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", help="say which version this is", callback=_tell_version, is_eager=True)
    ] = False,
) -> None:
    """What goes before any command."""


def finish(result: Result, width: int | None = 120) -> None:
    """Write and print a result; `width` is that of the tables where nobody looks. Names what the study lacks, and exits
    with 1 where it does not say what it was asked for."""
    from rich.console import Console

    try:
        page = result.save()
    except Obstacle as error:
        raise (Halted(str(error)) if result.runs and not result.kept else error) from None
    console = Console(width=None if sys.stdout.isatty() else width)
    result.show(console)
    console.print(f"report: {page}", markup=False, highlight=False, soft_wrap=True)
    for line in result.missing:
        print(f"fluidbench: lacking: {line}", file=sys.stderr)
    if not result.ok:
        raise typer.Exit(1)
