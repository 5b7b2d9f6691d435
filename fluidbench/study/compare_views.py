"""Side and top views of finished runs, and their particles to turn about."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..method.frame import Frame
from ..report.figures import figure_of, png
from ..report.plot import Cloud
from ..report.report import Image
from ..runs.record import Run
from ..scenario import Scenario

WIDTH = 9.0  # of the picture [inches]
STILL = 0.02  # share of the reference speed below which colours by speed would show next to nothing
MOST = 6000  # particles of a cloud: what a page holds and a browser turns


@dataclass(frozen=True)
class Scale:
    """What particles are coloured by: its name and unit, its limits, and its value of each."""

    label: str
    limits: tuple[float, float]
    value: Callable[[Frame], np.ndarray]


def views(results: Sequence[Run]) -> list[Image]:
    """Side and top view of every completed run, one over the other; nothing where none is."""
    done = [r for r in results if r.ok and r.record.repeat == 0]
    words = "side and top views of every method"
    return [Image("views", "Views at the end", words, lambda: draw_views(done))] if done else []


def draw_views(done: Sequence[Run]) -> bytes:
    """Runs from the side, coloured as `_scale` says, and from above, coloured by height; as PNG."""
    scenario, frames = done[0].scenario, [r.frame() for r in done]
    low = np.min([f["position"].min(axis=0) for f in frames], axis=0) - 2 * scenario.spacing
    high = np.max([f["position"].max(axis=0) for f in frames], axis=0) + 2 * scenario.spacing
    low[2] = scenario.domain.lower[2]
    size = 1e3 * (high - low)
    shape = np.clip([size[2], size[1]], 0.12 * size[0], None)
    scale, rows = (WIDTH - 1.4) / size[0], len(done)
    figure = figure_of(WIDTH, rows * (shape.sum() * scale + 0.75) + 0.5)
    grid = figure.subplots(2 * rows, 1, gridspec_kw={"height_ratios": list(np.tile(shape, rows))}, squeeze=False)
    colours = _scale(done, frames)
    for i, (run, frame) in enumerate(zip(done, frames, strict=True)):
        for row, (axis, name) in enumerate(((2, "side"), (1, "top"))):
            axes = grid[2 * i + row, 0]
            _scatter(axes, frame, axis, scenario, scale, colours, (low, high))
            axes.set_ylabel("z [mm]" if axis == 2 else "y [mm]")
            axes.set_title(f"{run.label}, {name}, t = {float(frame['time']):.4g} s", loc="left", fontsize=9)
    grid[-1, 0].set_xlabel("x [mm]")
    return png(figure)


def _scatter(axes: Any, frame: Frame, axis: int, scenario: Scenario, zoom: float, scale: Scale, box: Any) -> None:
    """Particles painted from back to front as discs of their spacing, on the floor."""
    x = frame["position"]
    order = np.argsort(-x[:, 1] if axis == 2 else x[:, 2])
    if axis == 2:
        value, limits, label = scale.value(frame), scale.limits, scale.label
        axes.axhline(1e3 * scenario.domain.lower[2], color="#777777", lw=2.0)
    else:
        value, limits, label = 1e3 * x[:, 2], (0.0, 1e3 * box[1][2]), "height [mm]"
    points = (72.0 * zoom * 1e3 * scenario.spacing) ** 2
    image = axes.scatter(
        1e3 * x[order, 0],
        1e3 * x[order, axis],
        c=value[order],
        s=max(points, 0.5),
        vmin=limits[0],
        vmax=limits[1],
        cmap="viridis",
        linewidths=0,
        rasterized=True,
    )
    axes.set(xlim=(1e3 * box[0][0], 1e3 * box[1][0]), ylim=(1e3 * box[0][axis], 1e3 * box[1][axis]), aspect="equal")
    axes.figure.colorbar(image, ax=axes, label=label, fraction=0.03, pad=0.01)


def _scale(done: Sequence[Run], frames: Sequence[Frame]) -> Scale:
    """What particles are coloured by, the same for all runs: their layer, where there are several; when they were laid,
    where there is a nozzle and next to nothing moves any more; else their speed."""
    scenario = done[0].scenario
    track = scenario.track
    speeds = np.concatenate([_speed(f) for f in frames])
    fast = float(np.quantile(speeds, 0.99)) if len(speeds) else 0.0
    if track is None or fast > STILL * scenario.reference_speed:
        return Scale("speed [m/s]", (0.0, max(fast, 1e-9)), _speed)
    if scenario.toolpath is not None and scenario.toolpath.layers > 1:
        last = float(scenario.toolpath.layers)
        return Scale("layer", (1.0, last), lambda f: track.layer_at(f["birth_time"] - 1e-9) + 1.0)
    return Scale("laid at [s]", (0.0, track.end), lambda f: f["birth_time"])


def _speed(frame: Frame) -> np.ndarray:
    return np.linalg.norm(frame["velocity"], axis=1)


def clouds(results: Sequence[Run]) -> list[Cloud]:
    """The particles of every completed run, evenly thinned to what a page can hold, coloured as from the side."""
    done = [r for r in results if r.ok and r.record.repeat == 0]
    frames = [r.frame() for r in done]
    found = []
    for run, frame in zip(done, frames, strict=True):
        scale, n = _scale(done, frames), len(frame["position"])
        kept = np.random.default_rng(0).permutation(n)[:MOST]
        thinned = f", {len(kept)} of {n} particles" if len(kept) < n else ""
        title = f"{run.label}, t = {float(frame['time']):.4g} s{thinned}"
        position, value = np.round(1e3 * frame["position"][kept], 2), np.round(scale.value(frame)[kept], 5)
        size = 1e3 * run.scenario.spacing
        found.append(Cloud(run.label, title, position, value, scale.label, scale.limits, size))
    return found
