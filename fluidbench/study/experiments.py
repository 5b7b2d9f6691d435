"""Small experiments, each in a process of its own pool, each with its result on disk: a crash is a result too, but not
one that is kept."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from ..device import quiet_warp
from ..errors import Interrupted
from ..offspring import NOISE, environment, search_path
from ..provenance import code
from ..store import Store, key_of, write_record

Task = dict[str, Any]
RESULT, CRASH = "result.json", "crash"


def run_tasks(
    tasks: Sequence[tuple[str, Task]], function: Callable[[Task], dict[str, Any]], store: Store, workers: int,
    done: Callable[[int, dict[str, Any]], None],
) -> list[dict[str, Any]]:  # fmt: skip
    """Results of function(task) for every (label, task), in order; those found on disk, whole and of the same code, are
    not run again.

    `function` is importable and takes and returns what JSON can hold; a task names its `method` and `target`. A task
    that fails or kills its process yields {"crash": reason}, which is not kept.
    """
    results: list[dict[str, Any] | None] = []
    folders = [store.folder(label, task) for label, task in tasks]
    made_by = [code(task["method"], task["target"]["backend"]) for _, task in tasks]
    for i, (_, task) in enumerate(tasks):
        wanted = {"code": made_by[i], "key": key_of(task)}
        found, _ = store.record(folders[i], lambda r, wanted=wanted: _misfit(r, wanted), RESULT)
        results.append(None if found is None else found["result"])
        if found is not None:
            done(i, found["result"])
    waiting = [i for i, result in enumerate(results) if result is None]
    try:
        for k, result in _all([tasks[i][1] for i in waiting], function, workers):
            i = waiting[k]
            results[i] = result
            if CRASH not in result:
                kept = {"result": result, "code": made_by[i], "key": key_of(tasks[i][1])}
                write_record(folders[i], kept, name=RESULT)
                store.made.add(folders[i])
            done(i, result)
    except (KeyboardInterrupt, Interrupted):
        finished = sum(result is not None for result in results)
        raise Interrupted(f"{finished} of {len(tasks)} experiments are finished") from None
    return [result or {CRASH: "it was not run"} for result in results]


def _misfit(record: dict[str, Any], wanted: dict[str, Any]) -> str:
    return "" if all(record.get(key) == value for key, value in wanted.items()) else "the code has changed since"


def _all(
    tasks: Sequence[Task], function: Callable[[Task], dict[str, Any]], workers: int
) -> Iterator[tuple[int, dict[str, Any]]]:
    """(index, result) as tasks end. A process that dies takes others' tasks with it: those that it may have been are
    then run one by one, so that the one to blame is found, and the rest in a pool again."""
    waiting = list(range(len(tasks)))
    while waiting:
        suspects = []
        for i, result in _round({i: tasks[i] for i in waiting}, function, workers):
            if result is None:
                suspects.append(i)
            else:
                yield i, result
        for i in suspects[: workers + 1]:
            alone = dict(_round({i: tasks[i]}, function, 1))
            yield i, alone[i] or {CRASH: "its process died without a word"}
        waiting = suspects[workers + 1 :]


def _round(
    tasks: dict[int, Task], function: Callable[[Task], dict[str, Any]], workers: int
) -> Iterator[tuple[int, dict[str, Any] | None]]:
    """(index, result) as tasks end; None for those whose process died, by their own doing or another's."""
    context = multiprocessing.get_context("spawn")
    with _clean_environment(), ProcessPoolExecutor(workers, mp_context=context, initializer=_begin,
                                                   initargs=(search_path(),)) as pool:  # fmt: skip
        futures = {pool.submit(function, task): i for i, task in tasks.items()}
        try:
            for future in as_completed(futures):
                try:
                    yield futures[future], future.result()
                except BrokenProcessPool:
                    yield futures[future], None
                except Exception as error:  # whatever happened in there is reported as a crash, with its name
                    yield futures[future], {CRASH: f"{type(error).__name__}: {error}"}
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.kill()
            raise


def _begin(path: list[str]) -> None:
    """A worker looks for modules where our children do."""
    import sys

    sys.path[:] = path
    quiet_warp()


@contextmanager
def _clean_environment() -> Iterator[None]:
    """What children of the pool inherit: see offspring.environment."""
    kept = {name: os.environ.get(name) for name in (*NOISE, "PYTHONSAFEPATH")}
    clean = environment()
    for name in kept:
        os.environ.pop(name, None)
    os.environ["PYTHONSAFEPATH"] = clean["PYTHONSAFEPATH"]
    try:
        yield
    finally:
        for name, value in kept.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
