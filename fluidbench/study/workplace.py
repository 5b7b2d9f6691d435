"""Where and how the work of a study is done: what every verb takes beside its own arguments."""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypedDict

from ..errors import UserError, quoted, suggestion
from ..method.suitability import can_share, check_backend
from ..method.target import BACKENDS, DEFAULT_BACKEND, Target
from ..registry import get_method, method_names
from ..report.progress import Display, Line
from ..runs.cluster import check_executor, executor_of
from ..runs.execute import as_executor, execute
from ..runs.store import Store
from ..runs.work import Work
from ..scenario import Scenario
from ..scenario.layout import capacity_of
from ..scenario.library import load
from ..scenario.measured import Measured
from ..scenario.measured import read as read_measured

LEAST_SHARE = 1000  # particles that are worth a thread


class Options(TypedDict, total=False):
    """What every verb takes.

    - device: "cpu" (default), "cuda:0", ...; "cuda" shares out all GPUs where timing does not matter
    - backend: language of the kernels, "warp" (default) or "taichi"
    - threads: threads of the CPU for a run; default all cores where a single run is made, one where costs are compared.
      Warp's results are the same bits for any number; the last bits of taichi's vary with several
    - out: folder for the runs, where a later call finds them; default a temporary one that lives as long as the result
    - fresh: run everything again, whatever is stored
    - wall_limit: how long a run may take [s]; what cannot make it is stopped early
    - jobs: runs at a time where timing does not matter, and in `compare` if it is given; default as many as there are
      cores, or 1 on CUDA
    - executor: where runs happen instead of here: anything with the interface of concurrent.futures that reaches the
      same folders, a dask Client, or a name such as "slurm" (runs/cluster.py)
    - progress: whether to show it; default True
    """

    device: str
    backend: str
    threads: int | None
    out: str | Path | None
    fresh: bool
    wall_limit: float
    jobs: int | None
    executor: Any
    progress: bool


class Scratch:
    """A temporary folder that is there as long as somebody holds this."""

    def __init__(self) -> None:
        self.folder = tempfile.mkdtemp(prefix="fluidbench-")
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)


@dataclass
class Workplace:
    """Options that were found to be possible."""

    target: Target
    store: Store
    workers: int
    wall_limit: float
    executor: Any = None
    progress: bool = True
    gpus: tuple[str, ...] = ()  # to share out, where there are several

    @classmethod
    def of(cls, options: Options, wall_limit: float, methods: Sequence[str] = ()) -> Workplace:
        """Raises UserError for an option, a device, a backend or a folder that is not there, and for a method without
        the backend; nothing is written."""
        for name in options:
            if name not in Options.__annotations__:
                raise UserError(f"no option {quoted(name)}{suggestion(name, Options.__annotations__)}")
        limit = options.get("wall_limit", wall_limit)
        require_number(limit, "wall_limit", 1e-3)
        given = options.get("threads")
        threads = 1 if given is None else given
        require_number(threads, "threads", 1, whole=True)
        if options.get("jobs") is not None:
            require_number(options.get("jobs"), "jobs", 1, whole=True)
        for name in ("device", "backend"):
            if not isinstance(options.get(name, ""), str):
                raise UserError(f"{name}: a name is wanted (got {quoted(options.get(name))})")
        device = options.get("device", "cpu")
        gpus = visible_gpus() if device == "cuda" else ()
        device = "cuda:0" if device == "cuda" else device
        target = one_target(device, options.get("backend", DEFAULT_BACKEND), threads)
        for method in methods:
            check_backend(get_method(method), target)
        workers, executor = workers_for(options.get("jobs") or len(gpus) or None, target), options.get("executor")
        if isinstance(executor, str):
            check_executor(executor)
        elif executor is not None:
            executor = as_executor(executor)
        out, keeper = options.get("out"), None
        if out is None:
            keeper = Scratch()
            out = keeper.folder
        if not isinstance(out, str | Path) or not str(out):
            raise UserError(f"out: a folder is wanted (got {quoted(out)})")
        store = Store(Path(out).expanduser().absolute(), options.get("fresh", False), keeper)
        return cls(target, store, workers, limit, executor, options.get("progress", True), gpus)

    @property
    def keeper(self) -> Any:
        """Keeps a temporary folder as long as somebody holds it."""
        return self.store.keeper

    def run(self, planned: Sequence[Work], title: str, together: bool = False, line: Line | None = None) -> list[Any]:
        """Have work done and shown: one piece at a time, so that times mean something, unless it may run `together`."""
        with Display(title, planned, line, quiet=not self.progress) as hooks:
            workers, gpus = (self.workers, self.gpus) if together else (1, self.gpus[:1])
            executor = self.executor
            if isinstance(executor, str):
                executor = executor_of(executor, self.store.root)
            return execute(planned, self.store, hooks, workers, executor, gpus)


def as_scenario(given: Scenario | str | Path, quick: bool = False) -> Scenario:
    """A scenario, or the one meant by a name or a file."""
    if not isinstance(given, Scenario | str | Path):
        raise UserError(f"a scenario, a name or a file is wanted (got {quoted(given)})")
    if isinstance(given, Scenario):
        if quick:
            raise UserError(
                "quick: a scenario given as an object is run as it is; load it with quick=True, or set spacing"
            )
        return given
    return load(given, quick=quick)


def measured_of(scenario: Scenario, more: str | Path | Sequence[Measured]) -> tuple[Measured, ...]:
    """What was measured: what the scenario has, and a table in a file, or rows of one. Raises UserError for a row that
    no run of the scenario can have, with its line or its number."""
    from ..measure.beside import wanting

    rows = isinstance(more, Sequence) and all(isinstance(one, Measured) for one in more)
    if not rows and not isinstance(more, str | Path):
        raise UserError(f"measured: a file, or rows of one, are wanted (got {quoted(more)})")
    for own in (scenario.measured, () if isinstance(more, str | Path) else more):
        for i, one in enumerate(own):
            if reason := wanting(one, scenario):
                raise UserError(f"measured.{i}: {reason}")
    read = read_measured(more, lambda one: wanting(one, scenario)) if isinstance(more, str | Path) else more
    return (*scenario.measured, *read)


def names_of(given: Any, what: str) -> list[Any] | None:
    """A list of names, of paths or of cases, from one of them or several; None for None. Raises UserError for what is
    none, and for one that is named twice."""
    if given is None:
        return None
    found = [given] if isinstance(given, str | Path) or not isinstance(given, Iterable) else list(given)
    for name in found:
        if found.count(name) > 1:
            raise UserError(f"{what}: {quoted(str(name))[1:-1]} is named twice")
    return found


def require_number(value: Any, what: str, low: float, whole: bool = False, high: float = sys.float_info.max) -> None:
    """Raise UserError unless a value is a number from `low` to `high` (whole, where it counts something)."""
    kinds = int if whole else int | float
    if isinstance(value, bool) or not isinstance(value, kinds) or not low <= value <= high:
        kind = "whole number" if whole else "number"
        most = f" and at most {high:.10g}" if high < sys.float_info.max else ""
        raise UserError(f"{what}: a {kind} of at least {low:g}{most} is wanted (got {quoted(value)})")


def share_of(given: Any, what: str) -> float:
    """'5%', '0.05' or 0.05 -> 0.05; raises UserError for what is no positive share below 10. One above 1 needs its
    percent sign, since 5 would be 500 %."""
    text = given.strip() if isinstance(given, str) else None
    percent = text is not None and text.endswith("%")
    number = given if text is None else text.removesuffix("%")
    try:
        value = float(number) / (100.0 if percent else 1.0) if not isinstance(given, bool) else math.nan
    except (TypeError, ValueError, OverflowError):
        value = math.nan
    if not 1e-6 <= value < 10.0:
        raise UserError(f"{what}: a share such as 5% or 0.05 is wanted (got {quoted(given)})")
    if value > 1.0 and not percent:
        raise UserError(f"{what}: {value:g} would be {100 * value:g} %; write '{value:g}%' or a share of at most 1")
    return value


def methods_of(
    given: Sequence[str] | str | None, options: Options | None = None, backends: Sequence[str] | None = None
) -> list[str]:
    """The methods named, or all that can be used here, on the device and through the backends (default: the one) of
    these options; raises UserError with the nearest known name."""
    if given is None:
        options = options or {}
        device = options.get("device", "cpu").partition(":")[0]
        asked = set(backends or [options.get("backend", DEFAULT_BACKEND)])
        able = [m for m in map(get_method, method_names()) if device in m.devices and asked <= set(m.backends)]
        return [method.name for method in able if method.missing() is None]
    names = names_of(given, "methods")
    if not names:
        raise UserError("no method is named")
    for name in names:
        if not isinstance(name, str):
            raise UserError(f"methods are names; got {quoted(name)}")
        if reason := get_method(name).missing():
            raise UserError(reason)
    return names


def target_of(device: str, backend: str, threads: int) -> Target:
    """Where to run; raises UserError unless the device exists and the backend is installed, and for threads that it
    would not use."""
    if backend not in BACKENDS:
        raise UserError(f"backend: no {quoted(backend)}{suggestion(backend, list(BACKENDS))}")
    if find_spec(backend) is None:
        raise UserError(f"the backend {backend} is not installed: pip install {BACKENDS[backend]}")
    require_number(threads, "threads", 1, whole=True)
    if threads > 4 * cores():
        raise UserError(f"{threads} threads are more than this machine's {cores()} cores can be shared among")
    _check_device(device)
    target = Target(device, backend, threads)
    if target.threads != threads:
        raise UserError(f"{threads} threads are for the CPU; a GPU has its own")
    return target


def one_target(device: str, backend: str, threads: int) -> Target:
    """`target_of` for a verb with one backend."""
    if "," in backend:
        raise UserError(f"one backend is wanted here; got {quoted(backend)} (compare takes several)")
    return target_of(device, backend, threads)


def targets_of(device: str, backends: Sequence[str], threads: int) -> list[Target]:
    """A target for each of several backends."""
    if len(backends) == 1:
        return [one_target(device, backends[0], threads)]
    return [target_of(device, backend, threads) for backend in backends]


def workers_for(jobs: int | None, target: Target) -> int:
    """Runs at a time: as asked, or as many as the cores hold; one on a GPU."""
    if jobs is not None and not 1 <= jobs <= 8 * cores():
        raise UserError(f"{jobs} runs at a time are too many for this machine's {cores()} cores, or too few")
    return jobs or (max(1, cores() // target.threads) if target.device == "cpu" else 1)


def cores() -> int:
    """Cores of this machine that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_alone(scenario: Scenario, method: str, target: Target) -> int:
    """Threads for a run that has the machine for itself: all cores, but none for fewer than a thousand particles, and
    one where more would change the last bits, or cannot help."""
    if target.backend != DEFAULT_BACKEND or not can_share(get_method(method), target):
        return 1
    return min(cores(), max(1, capacity_of(scenario) // LEAST_SHARE))


def visible_gpus() -> tuple[str, ...]:
    """The GPUs that there are, in the words of CUDA_VISIBLE_DEVICES; raises UserError where there is none."""
    import warp as wp

    from ..native.device import start_warp

    start_warp()
    if not (found := len(wp.get_cuda_devices())):
        raise UserError("no GPU on this machine (`fluidbench doctor`)")
    given = os.environ.get("CUDA_VISIBLE_DEVICES", "")
    return tuple(given.split(","))[:found] if given else tuple(map(str, range(found)))


def _check_device(device: str) -> None:
    if device == "cpu":
        return
    import warp as wp

    from ..native.device import start_warp

    start_warp()
    known = ["cpu", *[d.alias for d in wp.get_cuda_devices()]]
    if device not in known:
        raise UserError(f"no device {quoted(device)} on this machine; it has {', '.join(known)} (`fluidbench doctor`)")
