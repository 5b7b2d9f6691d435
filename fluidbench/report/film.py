"""Pictures taken while a run goes on: the solver hands over a copy of the particles, other processes draw it.

The run only writes arrays to disk; drawing takes as long as it takes, beside it. `python -m fluidbench.report.film
FOLDER FIRST EVERY` is such a process: it draws frames FIRST, FIRST + EVERY, ... until the run has ended.
"""

import io
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from ..offspring import command, end_with_parent, environment
from ..store import write_atomically

ENDED = "ended"
PATIENCE = 600.0  # longest wait for the last pictures after a run has ended [s]
DRAWERS = max(1, min(4, (os.cpu_count() or 1) - 1))  # one core is the run's


class Film:
    """Takes a frame every `every` simulated seconds; `close` waits for the drawing processes, which end with this one,
    however it ends."""

    def __init__(self, folder: Path, scenario: dict[str, Any], every: float) -> None:
        self.folder, self.scenario, self.every, self.next, self.shots = folder, scenario, every, 0.0, 0
        self.drawers: list[subprocess.Popen] = []

    def _begin(self) -> None:
        """Start the drawing processes, at the first frame or, where a run goes on, at its next one."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in [self.folder / ENDED, *self.folder.glob("frame_*.*")]:
            if old.name == ENDED or int(old.stem.partition("_")[2]) >= self.shots:
                old.unlink(missing_ok=True)
        write_atomically(self.folder / "scenario.json", json.dumps(self.scenario))
        with (self.folder / "log.txt").open("w") as log:
            self.drawers = [
                subprocess.Popen(
                    command(__name__, str(self.folder), str(i), str(DRAWERS), str(self.shots)), env=environment(),
                    stdin=subprocess.PIPE, stdout=log, stderr=log,
                )
                for i in range(DRAWERS)
            ]  # fmt: skip

    def due(self, time: float) -> bool:
        return time >= self.next - 1e-9

    def shoot(self, sim: Any) -> None:
        """Copy positions and births to disk; drawing happens elsewhere."""
        if not self.drawers:
            self._begin()
        pool = sim.pool
        n = pool.counts[0]
        buffer = io.BytesIO()
        np.savez(
            buffer, time=sim.now, position=pool.position[:n].numpy(), birth_time=pool.birth_time[:n].numpy(),
            phase=pool.phase[:n].numpy(),
        )  # fmt: skip
        write_atomically(self.folder / f"frame_{self.shots:05d}.npz", buffer.getvalue())
        self.shots += 1
        self.next += self.every

    def close(self) -> str:
        """Wait for the last pictures; says which are missing, if any."""
        if self.drawers:
            (self.folder / ENDED).touch()
        deadline = time.monotonic() + PATIENCE
        for drawer in self.drawers:
            try:
                drawer.wait(timeout=max(deadline - time.monotonic(), 0.1))
            except subprocess.TimeoutExpired:
                drawer.kill()
                drawer.wait()
        missing = sum(not (self.folder / f"frame_{i:05d}.png").is_file() for i in range(self.shots))
        return f"{missing} of {self.shots} pictures were not drawn: see film/log.txt" if missing else ""


def draw_all(folder: Path, first: int, every: int, known: int) -> None:
    """Draw each `every`-th frame from the `first` on as it appears, as frame_00000.png and so on; of the `known` ones
    that a run that goes on has taken before, those that are still there."""
    from fluidbench.scenario import Scenario

    scenario = Scenario.model_validate(json.loads((folder / "scenario.json").read_text()))
    canvas, shot = _Canvas(scenario), first
    while True:
        ended = (folder / ENDED).exists()  # asked first: what is not there by then will not come
        path = folder / f"frame_{shot:05d}.npz"
        if path.exists():
            with np.load(path) as data:
                canvas.draw({key: data[key] for key in data.files}, path.with_suffix(".png"))
            path.unlink()
            shot += every
        elif shot < known:
            shot += every
        elif ended:
            return
        else:
            time.sleep(0.02)


class _Canvas:
    """A side view, layers in alternating colours, painted from back to front: fast enough to keep up with a GPU."""

    EDGE = 640  # pixels of the longer side

    def __init__(self, scenario: Any) -> None:
        low, high = np.asarray(scenario.domain.lower), np.asarray(scenario.domain.upper)
        self.scenario, self.low, self.depth = scenario, low, float(high[1] - low[1])
        self.scale = self.EDGE / float(max(high[0] - low[0], high[2] - low[2]))
        self.shape = tuple(int(n) for n in np.ceil((high - low)[[2, 0]] * self.scale))
        self.brush = max(1, round(0.5 * scenario.spacing * self.scale))

    def draw(self, frame: dict[str, np.ndarray], path: Path) -> None:
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


if __name__ == "__main__":
    end_with_parent()
    draw_all(Path(sys.argv[1]), *map(int, sys.argv[2:5]))
