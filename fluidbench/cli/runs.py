"""compare, run and validate: scenarios and cases through the methods."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .app import app, finish
from .options import (
    Checkpoint,
    Frames,
    MeasuredFile,
    Pictures,
    ScenarioName,
    Seed,
    Settings,
    Shorter,
    Solvers,
    Spacing,
    load_scenario,
    methods_in,
    names_in,
    placed,
    positive,
    repeats_of,
    running,
    seconds,
)

if TYPE_CHECKING:
    from ..scenario import Scenario

CHECKPOINTS = 300.0  # wall seconds, as runs.job has it


@app.command()
@running(wall_limit=900.0)
def compare(
    scenario: ScenarioName,
    solvers: Solvers = None,
    set_: Settings = None,
    spacing: Spacing = None,
    repeats: Annotated[int, typer.Option(min=1, help="runs of each method, for the spread of the cost")] = 1,
    frames: Frames = False,
    quick: Shorter = False,
    render_every: Pictures = None,
    checkpoint_every: Checkpoint = CHECKPOINTS,
    measured: MeasuredFile = None,
    *,
    options: Any,
) -> None:
    """Run one scenario through several methods and put fidelity and cost side by side.

    --backend takes several languages here, separated by commas. A second call with the same inputs reuses the runs
    that are finished.
    """
    from ..study.compare import compare as study

    resolved = load_scenario(scenario, set_, spacing, quick)
    backends, repeats = names_in(options.pop("backend"), "--backend", "backend"), repeats_of(repeats)
    watched = _watched(frames, render_every, checkpoint_every, measured)
    _warn(resolved)
    more = placed(options, resolved.name)
    finish(study(resolved, methods_in(solvers), repeats=repeats, backends=backends, **watched, **more), width=None)


@app.command()
@running(wall_limit=900.0)
def run(
    scenario: ScenarioName,
    solver: Annotated[str, typer.Option(help="the method")] = "mpm",
    set_: Settings = None,
    spacing: Spacing = None,
    frames: Frames = False,
    quick: Shorter = False,
    render_every: Pictures = None,
    checkpoint_every: Checkpoint = CHECKPOINTS,
    measured: MeasuredFile = None,
    *,
    options: Any,
) -> None:
    """Run one scenario through one method."""
    from ..method.target import DEFAULT_BACKEND
    from ..study.compare import compare as study

    resolved = load_scenario(scenario, set_, spacing, quick)
    watched = _watched(frames, render_every, checkpoint_every, measured)
    _warn(resolved)
    language = "" if options["backend"] == DEFAULT_BACKEND else f"-{options['backend']}"
    more = placed(options, resolved.name)
    finish(study(resolved, [solver], verb=f"run-{solver}{language}", **watched, **more), width=None)


def _watched(
    frames: bool, render_every: float | None, checkpoint_every: float, measured: Path | None
) -> dict[str, Any]:
    """How runs are watched, and what they are beside; raises UserError for times that are none."""
    return {
        "measured": measured or (),
        "frames": frames,
        "render_every": None if render_every is None else positive(render_every, "--render-every"),
        "checkpoint_every": seconds(checkpoint_every, "--checkpoint-every", zero=True),
    }


def _warn(scenario: "Scenario") -> None:
    for warning in scenario.warnings():
        print(f"warning: {warning}", file=sys.stderr)


@app.command()
@running(wall_limit=1800.0)
def validate(
    cases: Annotated[
        list[str] | None,
        typer.Argument(help="cases (see `fluidbench list`), or Python files that define CASE; default all"),
    ] = None,
    solvers: Solvers = None,
    levels: Annotated[str, typer.Option(help="spacings: rough, coarse, medium, fine (1.5, 1, 2/3, 1/2)")] = "coarse",
    quick: Annotated[bool, typer.Option("--quick", help="a few minutes: the cheap cases, every physics")] = False,
    seed: Seed = 0,
    *,
    options: Any,
) -> None:
    """Run cases with known answers through every method: error, observed order and cost beside the tolerance.

    A second call reuses the runs that are finished.
    """
    from ..study.validate import validate as study

    if cases:
        names_in(",".join(cases), "CASES", "case")
    more, spacings = placed(options, "validate"), names_in(levels, "--levels", "level")
    finish(study(cases or None, methods_in(solvers), levels=spacings, quick=quick, seed=seed, **more))
