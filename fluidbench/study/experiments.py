"""Small experiments, each in a process of its own pool, each with its result on disk: a crash is a result too."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from ..device import quiet_warp
from ..store import Store, write_atomically

Task = dict[str, Any]
RESULT = "result.json"


def run_tasks(
    tasks: Sequence[tuple[str, Task]], function: Callable[[Task], dict[str, Any]], store: Store, workers: int,
    done: Callable[[int, dict[str, Any]], None],
) -> list[dict[str, Any]]:  # fmt: skip
    """Results of function(task) for every (label, task), in order; those found on disk are not run again.

    `function` is importable and takes and returns what JSON can hold. A task that kills its process yields
    {"crash": reason}.
    """
    folders = [store.folder(label, task) for label, task in tasks]
    results: list[dict[str, Any] | None] = []
    for i, folder in enumerate(folders):
        path = folder / RESULT
        results.append(json.loads(path.read_text()) if path.is_file() else None)
        if results[i] is not None:
            done(i, results[i] or {})
    while waiting := [i for i, result in enumerate(results) if result is None]:
        for i, result in _round([tasks[i][1] for i in waiting], function, workers):
            index = waiting[i]
            results[index] = result
            write_atomically(folders[index] / RESULT, json.dumps(result, indent=1))
            done(index, result)
    return [result or {} for result in results]


def _round(tasks: Sequence[Task], function: Callable[[Task], dict[str, Any]], workers: int):
    """(index, result) as tasks end. When a process dies, the tasks that it may have been are run one by one."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=quiet_warp) as pool:
        futures = {pool.submit(function, task): i for i, task in enumerate(tasks)}
        suspects: list[int] = []
        try:
            for future in as_completed(futures):
                try:
                    yield futures[future], future.result()
                except BrokenProcessPool:
                    suspects.append(futures[future])
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    for i in sorted(suspects)[: workers + 1]:
        with ProcessPoolExecutor(1, mp_context=context, initializer=quiet_warp) as alone:
            try:
                yield i, alone.submit(function, tasks[i]).result()
            except BrokenProcessPool:
                yield i, {"crash": "the process ended without a word"}
