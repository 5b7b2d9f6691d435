"""A drawing of what is simulated, to scale: nozzle, path, gap and what lies there at the start."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..report.figures import figure_of, png
from ..report.plot import COLOURS
from ..report.report import Image
from ..scenario import Scenario, Track
from ..scenario.layout import lay_out
from ..scenario.nozzle import Nozzle

WIDTH, LEAST, MOST = 9.0, 1.3, 4.5  # of the picture and of a view's height [inches]
MATTER, STEEL = "#9db7cf", "#555555"


def sketch(scenario: Scenario) -> Image:
    """Side view and plan, with the sizes that matter in millimetres."""
    words = f"Side view and plan of {scenario.name}: {', '.join(sizes(scenario)) or 'matter at the start'}"
    return Image("sketch", "What is simulated", words, lambda: draw(scenario), opens=True)


def sizes(scenario: Scenario) -> list[str]:
    """Nozzle, gap, speeds and resolution in words."""
    nozzle, path, track = scenario.nozzle, scenario.toolpath, scenario.track
    told = []
    if nozzle is not None:
        told += [f"bore {1e3 * nozzle.diameter:.4g} mm", f"gap {1e3 * nozzle.standoff:.4g} mm"]
        told.append(f"exit {1e3 * nozzle.speed:.4g} mm/s")
    if path is not None and track is not None:
        told.append(f"nozzle {1e3 * track.speed_in[track.flow_in > 0].max():.4g} mm/s")
        told += [f"{path.layers} layers"] if path.layers > 1 else []
    return [*told, f"spacing {1e3 * scenario.spacing:.4g} mm"]


def draw(scenario: Scenario) -> bytes:
    """As PNG."""
    points = [lay_out(body, scenario).position for body in scenario.bodies]
    matter = 1e3 * np.concatenate(points) if points else np.zeros((0, 3))
    low, high = _box(scenario, matter)
    size = high - low
    heights = [float(np.clip((WIDTH - 1.0) * size[up] / size[0], LEAST, MOST)) for up in (2, 1)]
    figure = figure_of(WIDTH, sum(heights) + 1.3)
    grid = figure.subplots(2, 1, gridspec_kw={"height_ratios": heights})
    for axes, up, name in ((grid[0], 2, "z"), (grid[1], 1, "y")):
        axes.scatter(matter[:, 0], matter[:, up], s=3.0, color=MATTER, linewidths=0)
        if scenario.track is not None and scenario.nozzle is not None:
            _path(axes, scenario.track, up)
            _nozzle(axes, scenario.nozzle, 1e3 * scenario.track.position[-1], up, float(high[2]))
        axes.set(xlim=(low[0], high[0]), ylim=(low[up], high[up]), aspect="equal", ylabel=f"{name} [mm]")
        axes.spines[["top", "right"]].set_visible(False)
    floor = 1e3 * scenario.domain.lower[2]
    grid[0].axhspan(low[2], floor, color="#dddddd")
    grid[0].set_title(", ".join(sizes(scenario)), loc="left", fontsize=9)
    grid[1].set_xlabel("x [mm]")
    return png(figure)


def _box(scenario: Scenario, matter: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(lowest, highest) corner of what is drawn [mm]: matter, path and nozzle with some room, within the domain."""
    found, room = [matter], 0.0
    if scenario.track is not None and scenario.nozzle is not None:
        face = 2e3 * scenario.nozzle.face
        where = 1e3 * scenario.track.position
        found += [where, where + np.array([0.0, 0.0, 0.7 * face])]
        room = face
    every = np.concatenate(found)
    room = room or 0.15 * float(np.ptp(every, axis=0).max())
    low, high = every.min(axis=0) - room, every.max(axis=0) + room
    low[2] = 1e3 * scenario.domain.lower[2] - 0.08 * (high[2] - 1e3 * scenario.domain.lower[2])
    return low, high


def _path(axes: Any, track: Track, up: int) -> None:
    """Strokes in the colour of their layer, the last of them as an arrow; travel dotted."""
    where = 1e3 * track.position
    axes.plot(where[:, 0], where[:, up], ":", color="#888888", lw=0.9)
    for rows in track.strokes:
        axes.plot(where[rows, 0], where[rows, up], color=COLOURS[int(track.layer[rows[0]]) % len(COLOURS)], lw=1.8)
    rows = track.strokes[-1]
    axes.annotate(
        "",
        where[rows[-1], [0, up]],
        where[rows[-2], [0, up]],
        arrowprops={"arrowstyle": "-|>", "color": COLOURS[int(track.layer[rows[0]]) % len(COLOURS)], "shrinkB": 0},
    )


def _nozzle(axes: Any, nozzle: Nozzle, exit_: np.ndarray, up: int, top: float) -> None:
    """Where it ends: in plan its circles, from the side its walls, or the stream where it has none."""
    from matplotlib.patches import Circle, Rectangle

    bore, solid = 1e3 * nozzle.diameter, nozzle.tip == "flat"
    outer = 2e3 * nozzle.face
    if up == 1:
        for d in {outer, bore}:
            axes.add_patch(Circle((exit_[0], exit_[1]), 0.5 * d, fill=False, color=STEEL, lw=1.4))
        return
    wall = 0.5 * (outer - bore)
    for side in (-1, 1):
        if solid:
            x = exit_[0] + side * 0.5 * bore - (wall if side < 0 else 0.0)
            axes.add_patch(Rectangle((x, exit_[2]), wall, top - exit_[2], color=STEEL, lw=0))
        else:
            axes.plot([exit_[0] + side * 0.5 * bore] * 2, [exit_[2], top], color=STEEL, lw=1.6)
    ends = {"arrowstyle": "<->", "color": "#222222", "lw": 0.8, "shrinkA": 0, "shrinkB": 0}
    x = exit_[0] + 0.5 * outer + 0.25 * bore
    axes.annotate("", (x, exit_[2]), (x, exit_[2] - 1e3 * nozzle.standoff), arrowprops=ends)
    axes.text(x, exit_[2] - 500 * nozzle.standoff, f" gap {1e3 * nozzle.standoff:.4g} mm", va="center", fontsize=8)
