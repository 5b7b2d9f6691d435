"""A small experiment in a process of its own: a function of a task, with its result on disk. A crash is a result too,
but not one that is kept."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from ..method.target import HERE, Target
from ..registry import get_method
from .provenance import changed, code
from .store import read_record, write_record
from .work import Report, Work

RESULT, CRASH = "result.json", "crash"
ROOMS = ("study",)  # of the toolkit, whose code it enters beside that of runs


@dataclass(frozen=True)
class Experiment(Work):
    """`function` ("module:name") takes and returns what JSON can hold; a failure yields {"crash": reason}."""

    leaves: ClassVar = (RESULT, "log.txt")
    function: str
    label: str
    method: str
    task: dict[str, Any]
    target: Target = HERE
    wall_limit: float | None = None  # [s]

    @property
    def limit(self) -> float | None:
        return self.wall_limit

    @property
    def name(self) -> str:
        return self.label

    @property
    def interpreter(self) -> Path | None:
        return get_method(self.method).interpreter()

    def inputs(self) -> dict[str, Any]:
        return self.task

    def _identity(self) -> dict[str, Any]:
        return {"key": self.key, "code": code(self.method, self.target.backend, ROOMS)}

    def recall(self, folder: Path) -> tuple[dict[str, Any] | None, str]:
        found, why = read_record(folder, RESULT)
        if found is None:
            return None, why
        if any(found.get(key) != value for key, value in self._identity().items()):
            return None, changed(self.method)
        if CRASH in found["result"]:
            return None, "it crashed"
        return found["result"], ""

    def left(self, folder: Path) -> dict[str, Any] | None:
        found, _ = read_record(folder, RESULT)
        return None if found is None else found["result"]

    def perform(self, folder: Path, report: Report) -> None:
        module, _, function = self.function.partition(":")
        result = getattr(import_module(module), function)(self.task)
        self._keep(folder, result)

    def _keep(self, folder: Path, result: dict[str, Any]) -> dict[str, Any]:
        return write_record(folder, self._identity() | {"result": result}, name=RESULT)["result"]

    def refuse(self, folder: Path, reason: str) -> dict[str, Any]:
        return self._keep(folder, {CRASH: reason})

    def bury(self, folder: Path, timed_out: bool, reason: str) -> dict[str, Any]:
        return {CRASH: reason}
