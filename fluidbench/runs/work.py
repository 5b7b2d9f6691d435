"""Work that a process of its own does: what it is asked, whether what is stored stands for it, what became of it."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

WORK = "job.json"  # the wire format is a folder: this goes in, a record comes out
Report = Callable[[dict[str, Any]], None]


def canonical(table: Mapping[str, Any]) -> bytes:
    """A table as bytes that are the same wherever it is."""
    return json.dumps(table, sort_keys=True, default=str).encode()


def key_of(inputs: Mapping[str, Any]) -> str:
    """Ten characters that name work by its inputs."""
    return hashlib.sha256(canonical(inputs)).hexdigest()[:10]


@dataclass(frozen=True)
class Work(ABC):
    """One piece of work: a frozen dataclass of what JSON can hold."""

    leaves: ClassVar[tuple[str, ...]]  # files of an earlier attempt that must be gone before it starts

    @property
    @abstractmethod
    def limit(self) -> float | None:
        """Wall time that it may take [s]."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What its folder's name begins with."""

    @property
    def interpreter(self) -> Path | None:
        """The Python that it needs, where that is not ours."""
        return None

    @abstractmethod
    def inputs(self) -> dict[str, Any]:
        """What it is, as JSON can hold it: the same inputs, the same result."""

    @property
    def key(self) -> str:
        return key_of(self.inputs())

    @abstractmethod
    def recall(self, folder: Path) -> tuple[Any | None, str]:
        """(the result that a folder holds, ""), or (None, why what is there does not stand for this work)."""

    @abstractmethod
    def left(self, folder: Path) -> Any | None:
        """The result that a child which has just ended left in a folder, whether or not it stands for later calls."""

    def forestall(self, folder: Path) -> Any | None:
        """The result of what need not be started, such as a refusal."""
        return None

    @abstractmethod
    def perform(self, folder: Path, report: Report) -> None:
        """Do it, in this process, and leave the result in the folder."""

    @abstractmethod
    def refuse(self, folder: Path, reason: str) -> Any:
        """Leave, and return, the result of what is refused."""

    @abstractmethod
    def bury(self, folder: Path, timed_out: bool, reason: str) -> Any:
        """The result of what ended without one."""
