"""What methods of any engine have in common: where they are found, and that they pick their own step."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

from ..method.contract import Method
from ..method.timestep import Bound
from ..scenario import Scenario
from .catalogue import ENGINES
from .environment import home, installed, missing, python_of

OWN_STEP = "its own CFL condition"


class Guest(Method):
    """A method of an engine: give it the attributes of a Method, `engine` (a name of the catalogue), and a session."""

    engine: ClassVar[str]
    rank = 200  # after ours
    devices = ("cpu",)

    @classmethod
    def missing(cls) -> str | None:
        reason = missing(ENGINES[cls.engine])
        return None if reason is None else f"{cls.name}: {reason}"

    @classmethod
    def interpreter(cls) -> Path:
        return python_of(home(ENGINES[cls.engine]))

    @classmethod
    def versions(cls) -> dict[str, str]:
        found = installed(ENGINES[cls.engine])
        return {} if found is None else {ENGINES[cls.engine].package: found.version}

    @classmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        return []


@contextmanager
def talking_aside() -> Iterator[None]:
    """Have what an engine prints go to standard error, which is the run's log; standard output is ours."""
    libc = ctypes.CDLL(None)
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        libc.fflush(None)  # what the engine's own buffers still hold belongs aside, too
        os.dup2(kept, 1)
        os.close(kept)
