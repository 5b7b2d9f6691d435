"""The application, its options and what the commands share."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import UserError, suggestion

if TYPE_CHECKING:
    from ..scenario import Scenario
    from ..target import Target

app = typer.Typer(
    name="fluidbench", no_args_is_help=True, add_completion=False, rich_markup_mode=None,
    help="Measure MPM, weakly compressible SPH and PBD on identical extrusion scenarios: fidelity beside cost.",
)  # fmt: skip

ScenarioName = Annotated[str, typer.Argument(help="a shipped scenario (see `fluidbench list`) or a TOML file")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="override a key, e.g. material.yield_stress=50")]
Spacing = Annotated[float | None, typer.Option(help="particle spacing [m], instead of the scenario's")]
Device = Annotated[str, typer.Option(help="cpu, or cuda:0, cuda:1, ...")]
Backend = Annotated[str, typer.Option(help="language of the kernels: warp or taichi")]
Threads = Annotated[int, typer.Option(min=1, help="CPU threads of taichi; with several, the last bits vary")]
Out = Annotated[Path | None, typer.Option(help="output folder; default fluidbench-out/SCENARIO")]
WallLimit = Annotated[float, typer.Option(help="seconds a run may take; what cannot make it is stopped early")]
Film = Annotated[float | None, typer.Option("--render-every", min=1e-6, help="simulated seconds between pictures, "
                                            "drawn beside the run into its folder film/")]  # fmt: skip
Frames = Annotated[bool, typer.Option("--frames", help="keep a snapshot of every output, not only of the last")]


def load_scenario(name: str, settings: list[str] | None, spacing: float | None, quick: bool = False) -> "Scenario":
    from ..library import load

    extra = [f"spacing={spacing!r}"] if spacing is not None else []
    return load(name, [*(settings or []), *extra], quick)


def split(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def target_of(device: str, backend: str, threads: int) -> "Target":
    """Where to run; raises UserError unless the device exists and the backend is installed."""
    from importlib.util import find_spec

    from ..target import BACKENDS, Target

    if backend not in BACKENDS:
        raise UserError(f"no backend '{backend}'{suggestion(backend, list(BACKENDS))}")
    if find_spec(backend) is None:
        raise UserError(f"the backend {backend} is not installed: pip install {BACKENDS[backend]}")
    _check_device(device)
    return Target(device, backend, threads)


def one_target(device: str, backend: str, threads: int) -> "Target":
    """`target_of` for a verb with one backend; raises UserError for threads that it would not use."""
    target = target_of(device, backend, threads)
    if target.threads != threads:
        raise UserError(f"--threads {threads} is for taichi on the CPU; warp runs one thread there, a GPU its own")
    return target


def workers_for(jobs: int | None, target: "Target") -> int:
    """Runs at a time: as asked, or as many as two cores hold; one on a GPU."""
    return jobs or (max(1, 2 // target.threads) if target.device == "cpu" else 1)


def targets_of(device: str, backends: str, threads: int) -> "list[Target]":
    """A target for each of several backends, separated by commas."""
    names = split(backends)
    if not names:
        raise UserError(f"--backend '{backends}' names no backend")
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"--backend names {name} twice; --repeats runs each method several times")
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
        raise UserError(f"no device '{device}' on this machine; it has {', '.join(known)} (see `fluidbench doctor`)")


def fraction(text: str) -> float:
    """'5%' or '0.05' -> 0.05; raises UserError for what is no positive share."""
    try:
        value = float(text.strip().removesuffix("%")) / (100.0 if text.strip().endswith("%") else 1.0)
    except ValueError:
        value = -1.0
    if not 0.0 < value < 10.0:
        raise UserError(f"--tolerance takes a share such as 5% or 0.05; got '{text}'")
    return value


def count_of(text: str, option: str) -> int:
    """'298000' -> 298000; raises UserError for what is no positive whole number."""
    if not text.isdecimal() or int(text) == 0:
        raise UserError(f"{option} takes whole numbers such as 298000, or fit; got '{text}'")
    return int(text)


def budget_of(text: str) -> tuple[float, float]:
    """'60s' -> (60, inf), 'realtime' -> (inf, 1), '' -> (inf, inf): wall time [s] and wall s per simulated s."""
    word = text.strip().lower()
    if word in ("", "none"):
        return float("inf"), float("inf")
    if word == "realtime":
        return float("inf"), 1.0
    scale = {"s": 1.0, "m": 60.0, "h": 3600.0}.get(word[-1])
    try:
        value = float(word[:-1] if scale else word) * (scale or 1.0)
    except ValueError:
        value = -1.0
    if not value > 0:
        raise UserError(f"--budget takes a time such as 60s, 5m or 1h, or realtime; got '{text}'")
    return value, float("inf")
