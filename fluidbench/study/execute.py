"""Runs the jobs of a study, each in a process of its own, and takes over those that are finished already."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..run import Job, launch
from ..scenario import Scenario
from ..solver import configure, get_solver, refusal
from ..store import Store, write_atomically
from ..target import Target

ADVICE = {
    "diverged": "its results are left out of every comparison",
    "out_of_capacity": "see the reason for the setting to raise",
    "timeout": "raise --wall-limit, or use a larger --spacing",
    "error": "see log.txt in the run's folder",
}


@dataclass(frozen=True)
class Finished:
    """A run's record and the folder that holds its files; `reused` when an earlier call had finished it."""

    record: dict[str, Any]
    folder: Path
    reused: bool

    @property
    def ok(self) -> bool:
        return self.record["verdict"] == "completed"

    @property
    def target(self) -> Target:
        return Target(self.record["device"], self.record["backend"], self.record.get("threads", 1))

    @property
    def label(self) -> str:
        return f"{self.record['method']}{self.target.suffix}"


@dataclass(frozen=True)
class Hooks:
    """What a display wants to hear of job i: that it started (or is reused), its progress, its end."""

    started: Callable[[int, Job, bool], None]
    progress: Callable[[int, dict[str, Any]], None]
    ended: Callable[[int, Finished], None]


def execute(planned: Sequence[Job], store: Store, hooks: Hooks, workers: int = 1) -> list[Finished]:
    """Run what is not finished yet. With one worker, the default, one run at a time, so that timings mean something."""

    def one(i: int) -> Finished:
        job = planned[i]
        folder = store.folder(f"{job.scenario['name']}-{job.method}", job.inputs())
        record = store.record(folder)
        reused = record is not None
        hooks.started(i, job, reused)
        if record is None:
            record = _refused(job, folder) or launch(job, folder, lambda state: hooks.progress(i, state))
        result = Finished(record, folder, reused)
        hooks.ended(i, result)
        return result

    if workers == 1:
        return [one(i) for i in range(len(planned))]
    with ThreadPoolExecutor(workers) as pool:
        try:
            return list(pool.map(one, range(len(planned))))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _refused(job: Job, folder: Path) -> dict[str, Any] | None:
    """The record of a method that will not run the scenario."""
    scenario = Scenario.model_validate(job.scenario)
    solver = get_solver(job.method)
    reason = refusal(solver, scenario, configure(solver, scenario))
    if reason is None:
        return None
    record = {
        "scenario": scenario.name, "method": job.method, **asdict(job.target),
        "repeat": job.repeat, "verdict": "refused", "reason": reason,
    }  # fmt: skip
    write_atomically(folder / "record.json", json.dumps(record, indent=1))
    return record
