"""What a run is asked to be."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from ..method.suitability import refusal
from ..method.target import HERE, Target
from ..method.verdict import FINAL, Verdict
from ..registry import get_method
from ..scenario import Scenario
from ..scenario.numerics import configure
from .needs import shortage
from .provenance import HARDWARE, changed, code, hardware
from .record import FINAL_FRAME, SERIES, Record, keep, recall
from .store import RECORD
from .work import Report, Work

CHECKPOINTS = 300.0  # wall seconds between checkpoints


@dataclass(frozen=True)
class Job(Work):
    """One run: what it is (scenario, method, target, repeat, variant), and how it is watched."""

    leaves: ClassVar = (RECORD, SERIES, FINAL_FRAME, "log.txt")
    scenario: dict[str, Any]
    method: str
    target: Target = HERE
    repeat: int = 0
    variant: str = ""  # sets runs apart that differ in how they are watched, where that is measured
    wall_limit: float | None = None
    keep_frames: bool = False
    film_every: float | None = None
    checkpoint_every: float = field(default=CHECKPOINTS)  # wall seconds; 0 for none

    @property
    def limit(self) -> float | None:
        return self.wall_limit

    @property
    def name(self) -> str:
        return f"{self.scenario['name']}-{self.method}"

    @property
    def interpreter(self) -> Path | None:
        return get_method(self.method).interpreter()

    def inputs(self) -> dict[str, Any]:
        """What a run is; how long it may take, whether it is filmed, and what it will be compared with, is not."""
        return {
            "scenario": {key: value for key, value in self.scenario.items() if key != "measured"},
            "method": self.method,
            "target": asdict(self.target),
            "repeat": self.repeat,
            **({"variant": self.variant} if self.variant else {}),
        }

    def watched(self) -> dict[str, Any]:
        """What is to lie beside a run's results: a run that was watched otherwise has other files."""
        return {"film_every": self.film_every, "keep_frames": self.keep_frames}

    def heading(self) -> dict[str, Any]:
        """How every record of this job begins, whatever became of it: what was asked for, and by which code."""
        return {
            "scenario": self.scenario["name"],
            "method": self.method,
            **asdict(self.target),
            "repeat": self.repeat,
            "key": self.key,
            "seed": self.scenario["seed"],
            "spacing_m": self.scenario["spacing"],
            "code": code(self.method, self.target.backend),
        }

    def recall(self, folder: Path) -> tuple[Record | None, str]:
        record, why = recall(folder)
        if record is not None and (why := self.misfit(record)):
            return None, why
        return record, why

    def left(self, folder: Path) -> Record | None:
        return recall(folder)[0]

    def misfit(self, record: Record) -> str:
        """Why a stored run does not stand for this job; empty when it does: same inputs, same code, same machine, and
        with what is wanted beside its results."""
        if record.verdict not in FINAL:
            return f"it ended as {record.verdict}"
        if record.key != self.key:
            return "it is of other inputs"
        if record.code != self.heading()["code"]:
            return changed(self.method)
        if record.verdict is Verdict.REFUSED:
            return ""
        here, there = hardware(self.target), record.machine
        if any(there.get(key) != here[key] for key in HARDWARE):
            return f"its cost is that of another machine ({there.get('processor')}, {there.get('device')})"
        if record.film_every != self.film_every:
            return "pictures are wanted" if self.film_every else "its cost includes pictures, which are not wanted"
        if self.keep_frames and not any(name.startswith("frame_") for name in record.files):
            return "its snapshots are wanted"
        return ""

    def forestall(self, folder: Path) -> Record | None:
        """The record of a method that will not run the scenario, or of a machine that cannot."""
        scenario, method = Scenario.model_validate(self.scenario), get_method(self.method)
        reason = refusal(method, scenario, configure(method, scenario), self.target)
        reason = reason or shortage(scenario, method, self.target)
        return None if reason is None else self.refuse(folder, reason)

    def perform(self, folder: Path, report: Report) -> None:
        from .child import perform

        perform(self, folder, report)

    def refuse(self, folder: Path, reason: str) -> Record:
        return keep(folder, Record(**self.heading(), verdict=Verdict.REFUSED, reason=reason))

    def bury(self, folder: Path, timed_out: bool, reason: str) -> Record:
        verdict = Verdict.TIMEOUT if timed_out else Verdict.ERROR
        return keep(folder, Record(**self.heading(), verdict=verdict, reason=reason))
