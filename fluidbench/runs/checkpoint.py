"""Checkpoints of a run: everything that it needs to go on as if nothing had happened, bit for bit on the CPU.

One file, replaced as a whole at a chosen interval of wall time: the session's state, the loop's counts, and the rows
measured so far.
"""

from __future__ import annotations

import json
import time
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import remove_quietly, write_npz

if TYPE_CHECKING:
    from ..method.contract import Session
    from .drive import Outcome
    from .film import Film

CHECKPOINT = "checkpoint.npz"


class Checkpoints:
    """Writes a run's checkpoint every `every` wall seconds (0: never), and finds one to go on from.

    `identity` is what must be the same: a run goes on only with the same inputs and the same code. `rows` are the
    measures over time, shared with whoever fills them.
    """

    def __init__(
        self,
        folder: Path,
        every: float,
        identity: dict[str, Any],
        session: Session,
        rows: list[dict[str, float]],
        film: Film | None = None,
    ) -> None:
        self.path, self.every, self.identity = folder / CHECKPOINT, every, json.loads(json.dumps(identity))
        self.session, self.rows, self.film = session, rows, film
        self.last, self.resumed = time.monotonic(), 0

    def due(self) -> bool:
        return self.every > 0 and time.monotonic() - self.last >= self.every

    def write(self, outcome: Outcome) -> None:
        """Replace the checkpoint by the present state."""
        progress, arrays = self.session.state()
        state = {
            "identity": self.identity,
            "loop": progress,
            "outcome": asdict(outcome),
            "rows": self.rows,
            "film": None if self.film is None else [self.film.shots, self.film.next],
            "resumed": self.resumed,
        }
        write_npz(self.path, {"state": np.frombuffer(json.dumps(state).encode(), np.uint8), **arrays})
        self.last = time.monotonic()

    def restore(self, outcome: Outcome) -> bool:
        """Go on from a checkpoint of this very run, if there is a whole one; `outcome` takes over what it counts."""
        try:
            with np.load(self.path) as data:
                found = {name: data[name] for name in data.files}
            state = json.loads(found.pop("state").tobytes())
            if state["identity"] != self.identity:
                return False
        except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError):
            return False
        self.session.resume(state["loop"], found)
        for name, value in state["outcome"].items():
            setattr(outcome, name, type(outcome.verdict)(value) if name == "verdict" else value)
        self.rows[:] = state["rows"]
        if self.film is not None and state["film"] is not None:
            self.film.shots, self.film.next = state["film"]
        self.resumed = state["resumed"] + 1
        return True

    def discard(self) -> None:
        """The run has ended: its record takes the checkpoint's place."""
        remove_quietly(self.path)
