"""Does the work of a study, each piece in a process of its own, and takes over what is finished already.

Where it happens is an executor's matter: threads of ours that wait for child processes, or any executor with the
interface of concurrent.futures that reaches the same folders (dask, submitit).
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from ..errors import Halted, Interrupted, Obstacle, UserError, of_system
from ..files import remove_quietly
from ..native.device import kernels
from .checkpoint import CHECKPOINT
from .interpreter import ALONE, Seat
from .process import launch, stop_children
from .record import Record, Run
from .store import Store, claimed
from .work import Report, Work, canonical

POLL = 0.1  # seconds between looks at futures that are not of the standard library
_told: set[str] = set()  # what is said once in a process, whichever thread comes first
_telling = threading.Lock()


def tell(text: str) -> None:
    """Say something beside the results."""
    print(f"fluidbench: {text}", file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Hooks:
    """What a display wants to hear of piece i: that it started (or is reused), its progress, its end (a Run, or an
    experiment's result); and anything else that the user should know. Work that is done elsewhere has no progress."""

    started: Callable[[int, Any, bool], None]
    progress: Callable[[int, dict[str, Any]], None]
    ended: Callable[[int, Any], None]
    note: Callable[[str], None] = tell


@dataclass(frozen=True)
class Obtained:
    """A result, whether it was there already, and why what was there did not serve."""

    result: Any
    reused: bool
    why: str = ""


def obtain(
    work: Work,
    folder: Path,
    reuse: bool,
    progress: Report | None = None,
    note: Callable[[str], None] = tell,
    begun: Callable[[bool], None] = lambda reused: None,
    seat: Seat = ALONE,
) -> Obtained:
    """The result of a piece of work: as it was stored, or made now. Its folder is claimed meanwhile."""
    with claimed(folder, note):
        result, why = work.recall(folder) if reuse else (None, "")
        if why:
            note(f"{folder.name} is run again: {why}")
        if result is None:
            _tell_of_kernels(note)
        begun(result is not None)
        if result is not None:
            return Obtained(result, True)
        if not reuse:
            remove_quietly(folder / CHECKPOINT)
        made = work.forestall(folder)
        return Obtained(launch(work, folder, progress, seat) if made is None else made, False, why)


def _tell_of_kernels(note: Callable[[str], None]) -> None:
    """Say where compiled kernels go where that is not the cache folder, once in a process; raises Obstacle where they
    cannot go anywhere."""
    with _telling:
        if (text := kernels().note) and text not in _told:
            _told.add(text)
            note(text)


def execute(
    planned: Sequence[Work],
    store: Store,
    hooks: Hooks,
    workers: int = 1,
    executor: Any = None,
    gpus: Sequence[str] = (),
) -> list[Any]:
    """Results in order, a Run for a Job; what is planned twice is done once. With one worker, the default, one piece
    at a time, so that timings mean something; with an executor as many as it likes. Where there are several `gpus` (in
    the words of CUDA_VISIBLE_DEVICES), each worker has one of its own.

    Raises Interrupted, which says how much is finished, when the user or the system wants it to stop, and Halted where
    something stops it when a run has begun or is finished already.
    """
    places: dict[bytes, list[int]] = {}
    for i, work in enumerate(planned):
        places.setdefault(canonical(asdict(work)), []).append(i)
    results: list[Any] = [None] * len(planned)
    done, under_way = 0, False

    def calls() -> Iterator[tuple[bytes, Callable[..., Obtained]]]:
        for place, (i, *_) in places.items():
            folder = store.folder(planned[i].name, planned[i].inputs())
            told = {"progress": partial(hooks.progress, i), "begun": partial(begun, i)}
            here = told | {"note": hooks.note}
            reuse = store.may_reuse(folder)
            yield place, partial(obtain, planned[i], folder, reuse, **({} if executor is not None else here))

    def begun(i: int, reused: bool) -> None:
        nonlocal under_way
        under_way = True
        hooks.started(i, planned[i], reused)

    def ended(place: bytes, got: Obtained) -> None:
        nonlocal done
        first = planned[places[place][0]]
        folder = store.folder(first.name, first.inputs())
        reused = got.reused and folder not in store.made
        if not got.reused:
            store.made.add(folder)
        if got.why and executor is not None:
            hooks.note(f"{folder.name} was run again: {got.why}")
        for k, i in enumerate(places[place]):
            if k or executor is not None:
                hooks.started(i, planned[i], got.reused or k > 0)
            results[i] = Run(got.result, folder, reused, store.keeper) if isinstance(got.result, Record) else got.result
            done += 1
            hooks.ended(i, results[i])

    try:
        if executor is None and workers == 1:
            for place, call in calls():
                ended(place, call())
        elif executor is None:
            free: SimpleQueue[Seat] = SimpleQueue()
            for gpu in gpus or [""] * workers:
                free.put(Seat(gpu, min(workers, len(places))))
            with ThreadPoolExecutor(workers) as pool:
                _gather(pool, ((place, _sharing(free, call)) for place, call in calls()), ended, stop_children)
        else:
            _gather(as_executor(executor), calls(), ended)
    except (KeyboardInterrupt, Interrupted):
        raise Interrupted(f"{done} of {len(planned)} runs are finished") from None
    except (Obstacle, OSError) as error:
        if isinstance(error, BrokenPipeError) or not (under_way or done or store.made):
            raise
        raise Halted(of_system(error) if isinstance(error, OSError) else str(error)) from None
    return results


def _sharing(free: SimpleQueue[Seat], call: Callable[..., Obtained]) -> Callable[[], Obtained]:
    """The call with a seat that no other call has meanwhile."""

    def shared() -> Obtained:
        seat = free.get()
        try:
            return call(seat=seat)
        finally:
            free.put(seat)

    return shared


def _gather(
    pool: Any,
    calls: Iterable[tuple[bytes, Callable[[], Obtained]]],
    ended: Callable[[bytes, Obtained], None],
    stop: Callable[[], None] = lambda: None,
) -> None:
    """Submit everything, and hand results on as they come; whatever goes wrong, nothing more is begun."""
    futures: dict[Any, bytes] = {}
    try:
        for place, call in calls:
            futures[pool.submit(call)] = place
        for future in _as_completed(list(futures)):
            ended(futures[future], future.result())
    except BaseException as error:
        for future in futures:
            future.cancel()
        stop()
        if isinstance(error, BrokenExecutor | CancelledError):
            raise Obstacle(f"the executor gave up: {type(error).__name__}: {error}") from None
        raise


def as_executor(given: Any) -> Any:
    """Something with `submit(function)`: an executor, or a dask Client. Raises UserError for anything else."""
    if hasattr(given, "get_executor"):  # a dask Client
        return given.get_executor(pure=False)
    if not hasattr(given, "submit"):
        raise UserError(f"an executor has the interface of concurrent.futures; got {type(given).__name__}")
    return given


def _as_completed(futures: list[Any]) -> Iterator[Any]:
    """Futures as they end, those of submitit included, which are none of the standard library's."""
    if all(isinstance(future, Future) for future in futures):
        yield from as_completed(futures)
        return
    waiting = list(futures)
    while waiting:
        ended = [future for future in waiting if future.done()]
        waiting = [future for future in waiting if not any(future is other for other in ended)]
        yield from ended
        if waiting and not ended:
            time.sleep(POLL)
