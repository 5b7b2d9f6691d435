"""The application, its options and what the commands share."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import UserError, quoted, suggestion

if TYPE_CHECKING:
    from ..scenario import Scenario
    from ..store import Store
    from ..target import Target

app = typer.Typer(
    name="fluidbench", no_args_is_help=True, add_completion=False, rich_markup_mode=None,
    help="Measure MPM, weakly compressible SPH and PBD on identical extrusion scenarios: fidelity beside cost.",
)  # fmt: skip

MOST_REPEATS = 1000
SHORTEST, LONGEST = 1e-3, 3.2e7  # wall time that a run may be given [s]
ScenarioName = Annotated[str, typer.Argument(help="a shipped scenario (see `fluidbench list`) or a TOML file")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="override a key, e.g. material.yield_stress=50")]
Spacing = Annotated[float | None, typer.Option(help="particle spacing [m], instead of the scenario's")]
Solvers = Annotated[
    str | None, typer.Option(help="methods, separated by commas; default all that are installed", show_default=False)
]
Device = Annotated[str, typer.Option(help="cpu, or cuda:0, cuda:1, ...")]
Backend = Annotated[str, typer.Option(help="language of the kernels: warp or taichi")]
Threads = Annotated[int, typer.Option(min=1, help="CPU threads of taichi; with several, the last bits vary")]
Out = Annotated[Path | None, typer.Option(help="output folder; default fluidbench-out/SCENARIO")]
WallLimit = Annotated[float, typer.Option(help="seconds a run may take; what cannot make it is stopped early")]
Fresh = Annotated[bool, typer.Option("--fresh", help="run everything again, whatever is stored")]
Checkpoint = Annotated[float, typer.Option("--checkpoint-every", help="wall seconds between checkpoints, from which "
                                           "the same command resumes a run that was killed; 0 for none")]  # fmt: skip
Film = Annotated[float | None, typer.Option("--render-every", help="simulated seconds between pictures, "
                                            "drawn beside the run into its folder film/")]  # fmt: skip
Frames = Annotated[bool, typer.Option("--frames", help="keep a snapshot of every output, not only of the last")]


def load_scenario(name: str, settings: list[str] | None, spacing: float | None, quick: bool = False) -> "Scenario":
    from ..library import load

    if spacing is not None and not (math.isfinite(spacing) and spacing > 0):
        raise UserError(f"--spacing takes a positive number of metres; got {spacing:g}")
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


def methods_of(solvers: str | None) -> list[str]:
    """The methods that --solvers lists, or all that are installed."""
    from ..solver import get_solver, solver_names

    methods = solver_names() if solvers is None else names_in(solvers, "--solvers", "method")
    for method in methods:
        get_solver(method)
    return methods


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


def store_in(out: Path | None, default: str, fresh: bool) -> "Store":
    """The output folder, which comes into being with the first result; raises UserError where it cannot."""
    from ..store import Store

    return Store((out or Path("fluidbench-out") / default).absolute(), fresh)


def target_of(device: str, backend: str, threads: int) -> "Target":
    """Where to run; raises UserError unless the device exists and the backend is installed."""
    import os
    from importlib.util import find_spec

    from ..target import BACKENDS, Target

    if backend not in BACKENDS:
        raise UserError(f"--backend: no {quoted(backend)}{suggestion(backend, list(BACKENDS))}")
    if find_spec(backend) is None:
        raise UserError(f"the backend {backend} is not installed: pip install {BACKENDS[backend]}")
    if threads > 4 * (os.cpu_count() or 1):
        raise UserError(f"--threads {threads} are more than this machine's {os.cpu_count()} cores can be shared among")
    _check_device(device)
    return Target(device, backend, threads)


def one_target(device: str, backend: str, threads: int) -> "Target":
    """`target_of` for a verb with one backend; raises UserError for threads that it would not use."""
    if "," in backend:
        raise UserError(f"--backend takes one language here; got {quoted(backend)} (compare takes several)")
    target = target_of(device, backend, threads)
    if target.threads != threads:
        raise UserError(f"--threads {threads} is for taichi on the CPU; warp runs one thread there, a GPU its own")
    return target


def workers_for(jobs: int | None, target: "Target") -> int:
    """Runs at a time: as asked, or as many as two cores hold; one on a GPU."""
    import os

    if jobs is not None and jobs > 8 * (os.cpu_count() or 1):
        raise UserError(f"--jobs {jobs} at a time are too many for this machine's {os.cpu_count()} cores")
    return jobs or (max(1, 2 // target.threads) if target.device == "cpu" else 1)


def targets_of(device: str, backends: str, threads: int) -> "list[Target]":
    """A target for each of several backends, separated by commas."""
    names = names_in(backends, "--backend", "backend")
    if len(names) == 1:
        return [one_target(device, names[0], threads)]
    return [target_of(device, name, threads) for name in names]


def _check_device(device: str) -> None:
    if device == "cpu":
        return
    import warp as wp

    from ..device import quiet_warp

    quiet_warp()
    wp.init()
    known = ["cpu", *[d.alias for d in wp.get_cuda_devices()]]
    if device not in known:
        raise UserError(f"no device {quoted(device)} on this machine; it has {', '.join(known)} (`fluidbench doctor`)")


def fraction(text: str) -> float:
    """'5%' or '0.05' -> 0.05; raises UserError for what is no positive share: a share above 1 needs its percent sign,
    since 5 would be 500 %."""
    percent = text.strip().endswith("%")
    try:
        value = float(text.strip().removesuffix("%")) / (100.0 if percent else 1.0)
    except ValueError:
        value = -1.0
    if not (1e-6 <= value < 10.0):
        raise UserError(f"--tolerance takes a share such as 5% or 0.05; got {quoted(text)}")
    if value > 1.0 and not percent:
        raise UserError(
            f"--tolerance {text.strip()} would be {100 * value:g} %; write {text.strip()}% or a share below 1"
        )
    return value


def count_of(text: str, option: str) -> int:
    """'298000' -> 298000; raises UserError for what is no positive whole number."""
    if not (text.isascii() and text.isdecimal()) or len(text) > 30 or int(text) == 0:
        raise UserError(f"{option} takes whole numbers such as 298000, or fit; got {quoted(text)}")
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
    scale = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(word[-1:])
    try:
        value = float(word[:-1] if scale else word) * (scale or 1.0)
    except ValueError:
        value = -1.0
    if not SHORTEST <= value <= LONGEST:
        raise UserError(f"--budget takes a time such as 60s, 5m or 1h, or realtime; got {quoted(text)}")
    return value, math.inf
