"""Pictures taken while a run goes on: the solver hands over a copy of the particles, other processes draw it.

The run only writes arrays to disk; drawing takes as long as it takes, beside it.
"""

from __future__ import annotations

import functools
import io
import json
import multiprocessing
import os
import threading
from concurrent.futures import Future, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np

from ..files import remove_quietly, write_atomically, write_npz
from ..method.contract import Session
from ..method.frame import Frame
from ..scenario import Scenario

PATIENCE = 600.0  # longest wait for the last pictures after a run has ended [s]
DRAWERS = max(1, min(4, (os.cpu_count() or 1) - 1))  # one core is the run's


class Film:
    """Takes a picture every `every` simulated seconds; `close` waits for the processes that draw, which end with this
    one, however it ends."""

    def __init__(self, folder: Path, scenario: dict[str, Any], every: float) -> None:
        self.folder, self.every, self.next, self.shots = folder, every, 0.0, 0
        self.scenario = json.dumps(scenario)
        self.pool: ProcessPoolExecutor | None = None
        self.drawn: list[Future[None]] = []

    def _begin(self) -> ProcessPoolExecutor:
        """Start at the first picture or, where a run goes on, at its next one: what was taken and not drawn is drawn
        now, what came after the checkpoint is forgotten."""
        self.folder.mkdir(parents=True, exist_ok=True)
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(DRAWERS, mp_context=context, initializer=_end_with_run)
        for old in sorted(self.folder.glob("frame_*.*")):
            if int(old.stem.partition("_")[2]) >= self.shots:
                remove_quietly(old)
            elif old.suffix == ".npz":
                self.drawn.append(pool.submit(draw, self.scenario, old))
        return pool

    def shoot(self, session: Session) -> None:
        """Copy positions and births to disk; drawing happens elsewhere."""
        if self.pool is None:
            self.pool = self._begin()
        path = self.folder / f"frame_{self.shots:05d}.npz"
        write_npz(path, session.glimpse())
        self.drawn.append(self.pool.submit(draw, self.scenario, path))
        self.shots += 1
        self.next += self.every

    def close(self) -> str:
        """Wait for the last pictures; says which are missing, if any, and why."""
        waiting = wait(self.drawn, timeout=PATIENCE).not_done
        reasons = [str(f.exception()) for f in self.drawn if f.done() and f.exception() is not None]
        if self.pool is not None:
            for stuck in multiprocessing.active_children() if waiting else ():
                stuck.kill()  # this process could not end before them
            self.pool.shutdown(wait=not waiting, cancel_futures=True)
        missing = sum(not (self.folder / f"frame_{i:05d}.png").is_file() for i in range(self.shots))
        why = reasons[0] if reasons else "drawing took too long"
        return f"{missing} of {self.shots} pictures were not drawn: {why}" if missing else ""


def _end_with_run() -> None:
    """A process that draws leaves as soon as the run's is gone."""
    run = multiprocessing.parent_process()
    assert run is not None

    def leave() -> None:
        run.join()
        os._exit(3)

    threading.Thread(target=leave, daemon=True).start()


def draw(scenario: str, path: Path) -> None:
    """Draw a snapshot as a PNG of its name, and remove it."""
    with np.load(path) as data:
        canvas_of(scenario).draw({key: data[key] for key in data.files}, path.with_suffix(".png"))
    path.unlink()


@functools.cache
def canvas_of(scenario: str) -> Canvas:
    return Canvas(Scenario.model_validate_json(scenario))


class Canvas:
    """A side view, layers in alternating colours, painted from back to front: fast enough to keep up with a GPU."""

    EDGE = 640  # pixels of the longer side

    def __init__(self, scenario: Scenario) -> None:
        low, high = np.asarray(scenario.domain.lower), np.asarray(scenario.domain.upper)
        self.scenario, self.low, self.depth = scenario, low, float(high[1] - low[1])
        self.scale = self.EDGE / float(max(high[0] - low[0], high[2] - low[2]))
        self.shape = tuple(int(n) for n in np.ceil((high - low)[[2, 0]] * self.scale))
        self.brush = max(1, round(0.5 * scenario.spacing * self.scale))

    def draw(self, frame: Frame, path: Path) -> None:
        from matplotlib.image import imsave

        order = np.argsort(-frame["position"][:, 1])
        x, births = frame["position"][order], frame["birth_time"][order]
        track = self.scenario.track
        layer = track.layer_at(births - 1e-9) if track is not None else np.zeros(len(x), int)
        light = 0.55 + 0.45 * (1.0 - (x[:, 1] - self.low[1]) / self.depth)
        colours = np.array([[0.20, 0.45, 0.75], [0.95, 0.62, 0.25]])[layer % 2] * light[:, None]
        image = np.ones((*self.shape, 3))
        column = ((x[:, 0] - self.low[0]) * self.scale).astype(int)
        row = self.shape[0] - 1 - ((x[:, 2] - self.low[2]) * self.scale).astype(int)
        reach = range(-self.brush, self.brush + 1)
        for down, across in ((a, b) for a in reach for b in reach if a * a + b * b <= self.brush**2):
            inside = np.clip(row + down, 0, self.shape[0] - 1), np.clip(column + across, 0, self.shape[1] - 1)
            image[inside] = colours
        buffer = io.BytesIO()
        imsave(buffer, np.clip(image, 0.0, 1.0), format="png")
        write_atomically(path, buffer.getvalue())
