"""Side and top views of finished runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..method.frame import Frame
from ..report.figures import figure_of, png
from ..report.report import Image
from ..runs.record import Run
from ..scenario import Scenario

WIDTH = 9.0  # of the picture [inches]


def views(results: Sequence[Run]) -> list[Image]:
    """Side and top view of every completed run, one over the other; nothing where none is."""
    done = [r for r in results if r.ok and r.record.repeat == 0]
    words = "side and top views of every method"
    return [Image("views", "Views at the end", words, lambda: draw_views(done))] if done else []


def draw_views(done: Sequence[Run]) -> bytes:
    """Runs coloured by speed, from the side, and by height, from above; as PNG."""
    scenario, frames = done[0].scenario, [r.frame() for r in done]
    low = np.min([f["position"].min(axis=0) for f in frames], axis=0) - 2 * scenario.spacing
    high = np.max([f["position"].max(axis=0) for f in frames], axis=0) + 2 * scenario.spacing
    low[2] = scenario.domain.lower[2]
    size = 1e3 * (high - low)
    shape = np.clip([size[2], size[1]], 0.12 * size[0], None)
    scale, rows = (WIDTH - 1.4) / size[0], len(done)
    figure = figure_of(WIDTH, rows * (shape.sum() * scale + 0.75) + 0.5)
    grid = figure.subplots(2 * rows, 1, gridspec_kw={"height_ratios": list(np.tile(shape, rows))}, squeeze=False)
    fastest = max(float(np.linalg.norm(f["velocity"], axis=1).max()) for f in frames)
    for i, (run, frame) in enumerate(zip(done, frames, strict=True)):
        for row, (axis, name) in enumerate(((2, "side"), (1, "top"))):
            axes = grid[2 * i + row, 0]
            _scatter(axes, frame, axis, scenario, scale, fastest, (low, high))
            axes.set_ylabel("z [mm]" if axis == 2 else "y [mm]")
            axes.set_title(f"{run.label}, {name}", loc="left", fontsize=9)
    grid[-1, 0].set_xlabel("x [mm]")
    return png(figure)


def _scatter(axes: Any, frame: Frame, axis: int, scenario: Scenario, scale: float, fastest: float, box: Any) -> None:
    """Particles painted from back to front as discs of their spacing."""
    x = frame["position"]
    order = np.argsort(-x[:, 1] if axis == 2 else x[:, 2])
    if axis == 2:
        value, limits, label = np.linalg.norm(frame["velocity"], axis=1), (0.0, max(fastest, 1e-9)), "speed [m/s]"
    else:
        value, limits, label = 1e3 * x[:, 2], (0.0, 1e3 * box[1][2]), "height [mm]"
    points = (72.0 * scale * 1e3 * scenario.spacing) ** 2
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
