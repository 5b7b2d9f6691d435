"""render: pictures and films of a finished run."""

from pathlib import Path
from typing import Annotated

import typer

from .app import app
from .options import positive


@app.command()
def render(
    run: Annotated[Path, typer.Argument(help="a run's folder (it holds record.json)")],
    colour: Annotated[str, typer.Option(help="layer, phase, speed, stress, density or height")] = "layer",
    turntable: Annotated[bool, typer.Option(help="also turntable.mp4, once around it")] = True,
    film: Annotated[bool, typer.Option("--film", help="also film.mp4 over the snapshots kept by --frames")] = False,
    pace: Annotated[float, typer.Option(help="simulated seconds in one of the film; 1 is real time")] = 1.0,
    export: Annotated[bool, typer.Option("--export", help="also a time series for ParaView")] = False,
) -> None:
    """Draw a finished run in three dimensions: a still, a turntable, a film, a time series for ParaView.

    Needs the extra viz: pip install 'fluidbench[viz]'.
    """
    from ..report import render as drawing

    made = drawing.render(run, colour, turntable, film, positive(pace, "--pace"))
    if export:
        made.append(drawing.export(run))
    for path in made:
        typer.echo(str(path))
