"""Pictures taken while a run goes on: the solver hands over a copy of the particles, another process draws it.

The run only writes arrays to disk; drawing takes as long as it takes, beside it. `python -m fluidbench.report.film
FOLDER` is the other process: it draws what it finds until it finds the word that the run has ended.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ENDED = "ended"
PATIENCE = 600.0  # longest wait for the last pictures after a run has ended [s]


class Film:
    """Takes a frame every `every` simulated seconds; `close` waits for the drawing process."""

    def __init__(self, folder: Path, scenario: dict[str, Any], every: float) -> None:
        self.folder, self.every, self.next, self.shots = folder, every, 0.0, 0
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ENDED).unlink(missing_ok=True)
        (folder / "scenario.json").write_text(json.dumps(scenario))
        with (folder / "log.txt").open("w") as log:
            self.drawer = subprocess.Popen([sys.executable, "-m", __name__, str(folder)], stdout=log, stderr=log)

    def due(self, time: float) -> bool:
        return time >= self.next - 1e-9

    def shoot(self, sim: Any) -> None:
        """Copy positions and births to disk; drawing happens elsewhere."""
        pool = sim.pool
        n = pool.counts[0]
        part = self.folder / f"frame_{self.shots:05d}.part"
        with part.open("wb") as file:
            np.savez(
                file, time=sim.now, position=pool.position[:n].numpy(), birth_time=pool.birth_time[:n].numpy(),
                phase=pool.phase[:n].numpy(),
            )  # fmt: skip
        part.rename(part.with_suffix(".npz"))
        self.shots += 1
        self.next += self.every

    def close(self) -> None:
        (self.folder / ENDED).touch()
        self.drawer.wait(timeout=PATIENCE)


def draw_all(folder: Path) -> None:
    """Draw every frame as it appears, in order, as frame_00000.png."""
    from fluidbench.scenario import Scenario

    scenario = Scenario.model_validate(json.loads((folder / "scenario.json").read_text()))
    canvas, drawn = _Canvas(scenario), 0
    while True:
        path = folder / f"frame_{drawn:05d}.npz"
        if path.exists():
            with np.load(path) as data:
                canvas.draw({key: data[key] for key in data.files}, path.with_suffix(".png"))
            path.unlink()
            drawn += 1
        elif (folder / ENDED).exists():
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
        imsave(path, np.clip(image, 0.0, 1.0))


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]))
