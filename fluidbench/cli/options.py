"""What commands take: each option declared once, read once, refused in one line."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import UserError, quoted
from ..scenario.units import amount

if TYPE_CHECKING:
    from ..scenario import Scenario
    from ..study.workplace import Options

MOST_REPEATS = 1000
MOST_VALUES = 1000  # of a key of a sweep
SHORTEST, LONGEST = 1e-3, 3.2e7  # wall time that a run may be given [s]
ScenarioName = Annotated[str, typer.Argument(help="a shipped scenario (see `fluidbench list`) or a TOML file")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="override a key, e.g. material.yield_stress=50")]


def length(text: str) -> float:
    """'0.002' or '2 mm' -> 0.002; raises UserError for what is no length."""
    try:
        return amount(text, "m")
    except ValueError as error:
        raise UserError(f"--spacing takes a length such as 0.002 or 2mm: {error}") from None


def folder(text: str) -> Path:
    """A folder's path; raises UserError for none, which would be the current one."""
    if not text.strip():
        raise UserError(f"--out takes an output folder (got {quoted(text)}); `--out .` is the current one")
    return Path(text)


Spacing = Annotated[
    float | None,
    typer.Option(
        parser=length, metavar="LENGTH", help="particle spacing, as 0.002 [m] or 2mm, instead of the scenario's"
    ),
]
Solvers = Annotated[
    str | None, typer.Option(help="methods, separated by commas; default all that are installed", show_default=False)
]
Device = Annotated[str, typer.Option(help="cpu, or cuda:0, cuda:1, ...; cuda: all GPUs, shared out")]
Backend = Annotated[str, typer.Option(help="language of the kernels: warp or taichi")]
Threads = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="threads of the CPU for a run; default all cores for a single run, one where costs are compared. "
        "Warp's results are the same whatever their number, the last bits of taichi's are not",
        show_default=False,
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(parser=folder, metavar="PATH", help="output folder; default fluidbench-out/ and the scenario or verb"),
]
WallLimit = Annotated[float, typer.Option(help="seconds a run may take; what cannot make it is stopped early")]
Fresh = Annotated[bool, typer.Option("--fresh", help="run everything again, whatever is stored")]
Jobs = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="runs at a time where timing does not matter, and in compare if given; default all cores, or 1 on CUDA",
    ),
]
Executor = Annotated[
    str | None,
    typer.Option(
        help="where runs happen: here (default), or slurm, through submitit, as "
        "in slurm or slurm:slurm_partition=gpu,timeout_min=60"
    ),
]
Checkpoint = Annotated[
    float,
    typer.Option(
        "--checkpoint-every",
        help="wall seconds between checkpoints, from which the same command resumes a run that was killed; 0 for none",
    ),
]
Pictures = Annotated[
    float | None,
    typer.Option(
        "--render-every", help="simulated seconds between pictures, drawn beside the run into its folder film/"
    ),
]
Frames = Annotated[bool, typer.Option("--frames", help="keep a snapshot of every output, not only of the last")]
MeasuredFile = Annotated[
    Path | None,
    typer.Option(
        "--measured",
        help="what was measured on a real print: CSV with quantity, value and, where known, uncertainty, layer, place",
        show_default=False,
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        min=0, max=2**32 - 1, help="shift what bodies begin with at random, by up to a twentieth of a spacing; 0: not"
    ),
]
From = Annotated[
    Path | None,
    typer.Option(
        "--from",
        help="run nothing: judge again what studies have kept in this folder, or in folders inside it",
        show_default=False,
    ),
]
Within = Annotated[
    str | None,
    typer.Option(
        help="time that the whole study may take on a CPU, e.g. 5m: spacings are finer or coarser, method by method",
        show_default=False,
    ),
]
Shorter = Annotated[bool, typer.Option("--quick", help="the scenario's own shorter and coarser version")]
Quick = Annotated[bool, typer.Option("--quick", help="fewer points and shorter runs: minutes instead of an hour")]

SHARED: dict[str, tuple[Any, Any]] = {
    "device": (Device, "cpu"),
    "backend": (Backend, "warp"),
    "threads": (Threads, None),
    "out": (Out, None),
    "wall_limit": (WallLimit, None),
    "jobs": (Jobs, None),
    "fresh": (Fresh, False),
    "executor": (Executor, None),
}
"""Options of every command that runs something, with their defaults."""


def running(wall_limit: float) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a command the SHARED options; it gets them, checked, as `options` (study.workplace.Options)."""
    shared = {**SHARED, "wall_limit": (WallLimit, wall_limit)}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        kept = [p for p in own.parameters.values() if p.name != "options"]
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
            for name, (kind, default) in shared.items()
        ]

        @functools.wraps(command)
        def called(**given: Any) -> None:
            options = {name: given.pop(name) for name in shared}
            options["wall_limit"] = seconds(options["wall_limit"], "--wall-limit")
            command(**given, options=options)

        vars(called)["__signature__"] = own.replace(parameters=[*kept, *added])
        called.__annotations__ = {p.name: p.annotation for p in [*kept, *added]}
        return called

    return decorate


def given(context: typer.Context, name: str) -> bool:
    """Whether the command line says this parameter."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def limited(context: typer.Context, options: Options) -> Options:
    """The options without a limit of a run that the command line does not say, for a verb that knows a better one."""
    made = options.copy()
    if not given(context, "wall_limit"):
        del made["wall_limit"]
    return made


def alone(context: typer.Context, option: str, *fine: str) -> None:
    """Raise UserError for what the command line says beside an option that runs nothing, but for --out and what is
    `fine`."""
    others = [p for p in context.command.params if p.name and given(context, p.name)]
    names = [max(p.opts, key=len) for p in others if p.name not in (option, "out", *fine)]
    if names:
        raise UserError(f"--{option.rstrip('_')} runs nothing, and goes without {', '.join(names)}")


def placed(options: Options, default: str) -> Options:
    """The options with the output folder's default filled in."""
    return {**options, "out": Path(options.get("out") or Path("fluidbench-out") / default)}


def load_scenario(name: str, settings: list[str] | None, spacing: float | None, quick: bool = False) -> Scenario:
    """The scenario as the command line has it; raises UserError for what is none, and for a spacing given twice."""
    from ..scenario.library import load

    if spacing is not None and not (math.isfinite(spacing) and spacing > 0):
        raise UserError(f"--spacing takes a positive number of metres; got {spacing:g}")
    if spacing is not None and any(text.partition("=")[0].strip() == "spacing" for text in settings or []):
        raise UserError("--spacing and --set spacing=... both give the spacing; give one of them")
    extra = [f"spacing={spacing!r}"] if spacing is not None else []
    return load(name, [*(settings or []), *extra], quick)


def names_in(text: str, option: str, what: str) -> list[str]:
    """The names that an option lists, separated by commas; raises UserError for none, and for one twice."""
    found = [part.strip() for part in text.split(",")]
    if not any(found):
        raise UserError(f"{option} {quoted(text)} names no {what}")
    if not all(found):
        raise UserError(f"{option} takes each {what} once, separated by commas; got {quoted(text)}")
    for name in found:
        if found.count(name) > 1:
            raise UserError(f"{option} names {quoted(name)[1:-1]} twice")
    return found


def methods_in(solvers: str | None) -> list[str] | None:
    """The methods that --solvers lists; None where it is not given."""
    return None if solvers is None else names_in(solvers, "--solvers", "method")


def positive(value: float, option: str, zero: bool = False) -> float:
    """The value; raises UserError unless it is finite and positive (or `zero`)."""
    if not math.isfinite(value) or value < 0 or (value == 0 and not zero) or 0 < value < 1e-9 or value > 1e9:
        raise UserError(f"{option} takes a {'number of 0 or more' if zero else 'positive number'}; got {value:g}")
    return value


def seconds(value: float, option: str, zero: bool = False) -> float:
    """The value; raises UserError unless it is a time that a run can take, up to a year [s]."""
    if positive(value, option, zero) > LONGEST or 0 < value < SHORTEST:
        raise UserError(f"{option} takes seconds, from {SHORTEST:g} up to a year; got {value:g}")
    return value


def repeats_of(value: int) -> int:
    if value > MOST_REPEATS:
        raise UserError(f"--repeats takes up to {MOST_REPEATS}; got {value}")
    return value


def count_of(text: str, option: str) -> int:
    """'298000' -> 298000; raises UserError for what is no positive whole number."""
    if not (text.isascii() and text.isdecimal()) or len(text) > 30 or int(text) == 0:
        raise UserError(f"{option} takes whole numbers such as 298000; got {quoted(text)}")
    return int(text)


def budget_of(text: str | None) -> tuple[float, float]:
    """'60s' -> (60, inf), 'realtime' -> (inf, 1), None -> (inf, inf): wall time [s] and wall s per simulated s."""
    if text is None:
        return math.inf, math.inf
    word = text.strip().lower()
    if word in ("", "none"):
        return math.inf, math.inf
    if word == "realtime":
        return math.inf, 1.0
    return time_of(text, "--budget", " or realtime"), math.inf


def time_of(text: str, option: str, other: str = "") -> float:
    """'5m' -> 300.0 [s]; raises UserError for what is no time."""
    word = text.strip().lower()
    scale = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(word[-1:])
    try:
        value = float(word[:-1] if scale else word) * (scale or 1.0)
    except ValueError:
        value = -1.0
    if not SHORTEST <= value <= LONGEST:
        raise UserError(f"{option} takes a time such as 60s, 5m or 1h{other and ','}{other}; got {quoted(text)}")
    return value


def within_of(text: str | None) -> float:
    """'5m' -> 300.0 [s], None -> for ever; raises UserError for what is no time."""
    return math.inf if text is None else time_of(text, "--within")


def axes_of(given: list[str]) -> dict[str, list[Any]]:
    """['a.b=20:200:5', 'c=1,2'] -> {'a.b': [20, 65, 110, 155, 200], 'c': [1, 2]}; raises UserError for what is none."""
    axes: dict[str, list[Any]] = {}
    for text in given:
        key, equals, values = text.partition("=")
        key = key.strip()
        if not equals or not key or not values.strip():
            raise UserError(f"--over takes key=values, such as material.yield_stress=20:200:5; got {quoted(text)}")
        if key in axes:
            raise UserError(f"--over names {quoted(key)[1:-1]} twice")
        parts = values.strip().split(":")
        axes[key] = _range(parts, text) if len(parts) > 1 else [_value(v) for v in names_in(values, "--over", "value")]
    return axes


def _range(parts: list[str], text: str) -> list[Any]:
    """first:last:count, evenly, or first:last:count:log, by equal factors."""
    log = parts[-1] == "log"
    try:
        first, last, count = parts[:-1] if log else parts
        low, high, number = float(first), float(last), int(count)
    except ValueError:
        low, high, number = math.nan, math.nan, 0
    if not (math.isfinite(low) and math.isfinite(high) and 2 <= number <= MOST_VALUES) or (log and min(low, high) <= 0):
        raise UserError(
            f"--over takes first:last:count, with 2 to {MOST_VALUES} values, evenly, or first:last:count:log, "
            f"positive and by equal factors; got {quoted(text)}"
        )
    if log:
        return [low * (high / low) ** (i / (number - 1)) for i in range(number)]
    return [low + (high - low) * i / (number - 1) for i in range(number)]


def _value(text: str) -> Any:
    """A number where it is one, else the text, which may have a unit."""
    from ..scenario.library import parse_override

    return parse_override(f"value={text}")[1]
