"""Plots as files, by matplotlib; no display needed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..scenario import Scenario
from ..store import write_atomically
from ..study.execute import Finished
from .traces import Plot, load_frame


def _pyplot():
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def draw(plot: Plot, folder: Path, prefix: str = "") -> Path:
    """One plot as a PNG."""
    plt = _pyplot()
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for trace in plot.traces:
        if trace.style == "bar":
            axes.bar(trace.x, trace.y, color=trace.colour)
        elif trace.style == "points":
            axes.plot(trace.x, trace.y, "o", mfc="none", color=trace.colour, label=trace.label)
        else:
            marker = "o" if trace.style == "line+points" else ""
            line = {"dashed": "--", "dotted": ":"}.get(trace.style, "-")
            axes.plot(trace.x, trace.y, line, marker=marker, color=trace.colour, label=trace.label or None, lw=1.6)
    axes.set(title=plot.title, xlabel=plot.x, ylabel=plot.y)
    if plot.log:
        axes.set(xscale="log", yscale="log")
    if plot.equal:
        axes.set_aspect("equal")
        axes.set_ylim(bottom=0)
    if any(trace.style != "bar" for trace in plot.traces):
        axes.legend(frameon=False)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    return _save(figure, folder / f"{prefix}{plot.name}.png")


def _save(figure: Any, path: Path) -> Path:
    """A figure as a PNG, written atomically."""
    import io

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    _pyplot().close(figure)
    write_atomically(path, buffer.getvalue())
    return path


def draw_views(results: Sequence[Finished], folder: Path, prefix: str = "") -> Path | None:
    """Side and top view of every completed run, side by side, coloured by height or, from the side, by speed."""
    done = [r for r in results if r.ok and r.record["repeat"] == 0]
    if not done:
        return None
    plt = _pyplot()
    scenario = Scenario.model_validate(done[0].record["input"])
    frames = [load_frame(r) for r in done]
    low = np.min([f["position"].min(axis=0) for f in frames], axis=0) - 2 * scenario.spacing
    high = np.max([f["position"].max(axis=0) for f in frames], axis=0) + 2 * scenario.spacing
    low[2] = scenario.domain.lower[2]
    size = 1e3 * (high - low)
    shape = np.clip([size[2], size[1]], 0.12 * size[0], None)
    width = 9.0
    scale = (width - 1.4) / size[0]
    rows = len(done)
    figure, grid = plt.subplots(
        2 * rows, 1, figsize=(width, rows * (shape.sum() * scale + 0.75) + 0.5), layout="constrained",
        gridspec_kw={"height_ratios": list(np.tile(shape, rows))}, squeeze=False,
    )  # fmt: skip
    fastest = max(float(np.linalg.norm(f["velocity"], axis=1).max()) for f in frames)
    for i, (result, frame) in enumerate(zip(done, frames, strict=True)):
        for row, (axis, name) in enumerate(((2, "side"), (1, "top"))):
            axes = grid[2 * i + row, 0]
            _scatter(axes, frame, axis, scenario, scale, fastest, (low, high))
            axes.set_ylabel("z [mm]" if axis == 2 else "y [mm]")
            axes.set_title(f"{result.label}, {name}", loc="left", fontsize=9)
    grid[-1, 0].set_xlabel("x [mm]")
    return _save(figure, folder / f"{prefix}views.png")


def _scatter(axes, frame, axis: int, scenario: Scenario, scale: float, fastest: float, box) -> None:
    """Particles painted from back to front as discs of their spacing."""
    x = frame["position"]
    order = np.argsort(-x[:, 1] if axis == 2 else x[:, 2])
    if axis == 2:
        value, limits, label = np.linalg.norm(frame["velocity"], axis=1), (0.0, max(fastest, 1e-9)), "speed [m/s]"
    else:
        value, limits, label = 1e3 * x[:, 2], (0.0, 1e3 * box[1][2]), "height [mm]"
    points = (72.0 * scale * 1e3 * scenario.spacing) ** 2
    image = axes.scatter(
        1e3 * x[order, 0], 1e3 * x[order, axis], c=value[order], s=max(points, 0.5), vmin=limits[0], vmax=limits[1],
        cmap="viridis", linewidths=0, rasterized=True,
    )  # fmt: skip
    axes.set(xlim=(1e3 * box[0][0], 1e3 * box[1][0]), ylim=(1e3 * box[0][axis], 1e3 * box[1][axis]), aspect="equal")
    axes.figure.colorbar(image, ax=axes, label=label, fraction=0.03, pad=0.01)
