"""Runs the jobs of a study, each in a process of its own, and takes over those that are finished already."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..checkpoint import CHECKPOINT
from ..errors import Interrupted
from ..job import Job
from ..needs import shortage
from ..provenance import HARDWARE, hardware
from ..run import launch, stop_children
from ..scenario import Scenario
from ..solver import configure, get_solver, refusal
from ..store import Store, claimed, remove_quietly, write_record
from ..target import Target
from ..verdict import FINAL, Evidence, evidence_of

ADVICE = {
    "diverged": "its results are left out of every comparison",
    "out_of_capacity": "see the reason for the setting to raise",
    "timeout": "raise --wall-limit, or use a larger --spacing",
    "error": "see log.txt in the run's folder",
    "refused": "change what it refuses, or leave the method out",
}


@dataclass(frozen=True)
class Finished:
    """A run's record and the folder that holds its files; `reused` when an earlier call had finished it."""

    record: dict[str, Any]
    folder: Path
    reused: bool

    @property
    def verdict(self) -> str:
        return self.record["verdict"]

    @property
    def reason(self) -> str:
        return self.record.get("reason", "")

    @property
    def name(self) -> str:
        """The run in words."""
        spacing = self.record.get("spacing_m")
        return f"{self.record['scenario']}, {self.label}" + (f", d = {1e3 * spacing:.3g} mm" if spacing else "")

    @property
    def ok(self) -> bool:
        """Whether it has a result."""
        return evidence_of(self.verdict) is Evidence.RESULT

    @property
    def target(self) -> Target:
        return Target(self.record["device"], self.record["backend"], self.record.get("threads", 1))

    @property
    def label(self) -> str:
        return f"{self.record['method']}{self.target.suffix}"


def tell(text: str) -> None:
    """Say something beside the results."""
    print(f"fluidbench: {text}", file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Hooks:
    """What a display wants to hear of job i: that it started (or is reused), its progress, its end; and anything else
    that the user should know."""

    started: Callable[[int, Job, bool], None]
    progress: Callable[[int, dict[str, Any]], None]
    ended: Callable[[int, Finished], None]
    note: Callable[[str], None] = tell


def execute(planned: Sequence[Job], store: Store, hooks: Hooks, workers: int = 1) -> list[Finished]:
    """Run what is not finished yet. With one worker, the default, one run at a time, so that timings mean something.

    Raises Interrupted, which says how much is finished, when the user or the system wants it to stop.
    """
    done: list[int] = []

    def one(i: int) -> Finished:
        result = _obtain(i, planned[i], store, hooks)
        done.append(i)
        hooks.ended(i, result)
        return result

    try:
        if workers == 1:
            return [one(i) for i in range(len(planned))]
        with ThreadPoolExecutor(workers) as pool:
            try:
                return list(pool.map(one, range(len(planned))))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                stop_children()
                raise
    except (KeyboardInterrupt, Interrupted):
        raise Interrupted(f"{len(done)} of {len(planned)} runs are finished") from None


def _obtain(i: int, job: Job, store: Store, hooks: Hooks) -> Finished:
    """The run that a job asks for: as it was stored, or made now. Its folder is claimed meanwhile."""
    folder = store.folder(f"{job.scenario['name']}-{job.method}", job.inputs())
    with claimed(folder, hooks.note):
        record, why = store.record(folder, lambda found: misfit(found, job))
        if why:
            hooks.note(f"{folder.name} is run again: {why}")
        hooks.started(i, job, record is not None)
        reused = record is not None and folder not in store.made
        if record is None:
            if store.fresh:
                remove_quietly(folder / CHECKPOINT)
            record = _refused(job, folder) or launch(job, folder, lambda state: hooks.progress(i, state))
            store.made.add(folder)
    return Finished(record, folder, reused)


def misfit(record: dict[str, Any], job: Job) -> str:
    """Why a stored run does not stand for a job; empty when it does: same inputs, same code, same machine, and with
    what is wanted beside its results."""
    if record.get("verdict") not in FINAL:
        return f"it ended as {record.get('verdict')}"
    if record.get("key") != job.key:
        return "it is of other inputs"
    if record.get("code") != job.heading()["code"]:
        return "the code, or Warp or Taichi, has changed since"
    if record["verdict"] == "refused":
        return ""
    here, there = hardware(job.target), record.get("machine", {})
    if any(there.get(key) != here[key] for key in HARDWARE):
        return f"its cost is that of another machine ({there.get('processor')}, {there.get('device')})"
    if record.get("film_every") != job.film_every:
        return "pictures are wanted" if job.film_every else "its cost includes pictures, which are not wanted"
    if job.keep_frames and not any(name.startswith("frame_") for name in record["files"]):
        return "its snapshots are wanted"
    return ""


def _refused(job: Job, folder: Path) -> dict[str, Any] | None:
    """The record of a method that will not run the scenario, or of a machine that cannot."""
    scenario = Scenario.model_validate(job.scenario)
    solver = get_solver(job.method)
    reason = refusal(solver, scenario, configure(solver, scenario)) or shortage(scenario, solver, job.target)
    if reason is None:
        return None
    return write_record(folder, job.heading() | {"verdict": "refused", "reason": reason})
