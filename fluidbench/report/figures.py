"""Plots as pictures, by matplotlib; needs no display, and leaves the user's own matplotlib alone."""

from __future__ import annotations

import logging
import math
from typing import Any

from .plot import FADED, Plot

MARK = 6.0  # size of a point's mark [points of print]
NEAR = (8.0, 15.0, 22.0, 29.0)  # how far from its point a number may stand [points of print]
AROUND = (0.0, 0.8, -0.8, 2.4, -2.4, 1.57, -1.57, 3.14)  # and where about it [rad]


def figure_of(width: float, height: float) -> Any:
    """An empty figure of this size [inches]."""
    log = logging.getLogger("matplotlib")
    before = log.level
    log.setLevel(logging.ERROR)  # that it keeps its list of fonts in a temporary folder changes no picture
    try:
        from matplotlib.figure import Figure
    finally:
        log.setLevel(before)

    return Figure(figsize=(width, height), layout="constrained")


def draw(plot: Plot) -> bytes:
    """One plot as a PNG."""
    figure = figure_of(10.5 if plot.key else 7.0, 4.0)
    axes = figure.subplots()
    for trace in plot.traces:
        alpha = FADED if trace.faded else 1.0
        places = [x.replace("<br>", "\n") if isinstance(x, str) else x for x in trace.x]  # a page breaks lines so
        if trace.style == "bar":
            axes.bar(places, trace.y, color=trace.colour, alpha=alpha)
        elif trace.style == "points":
            fill = trace.colour if trace.faded else "none"  # as the points of the line that it is faded beside
            marks = {"fmt": "o", "mfc": fill, "capsize": 4, "color": trace.colour, "label": trace.label or None}
            axes.errorbar(places, trace.y, trace.spread, alpha=alpha, **marks)
        else:
            marker = "o" if trace.style == "line+points" else ""
            line = {"dashed": "--", "dotted": ":"}.get(trace.style, "-")
            more = {"label": trace.label or None, "lw": 1.6, "alpha": alpha}
            axes.plot(places, trace.y, line, marker=marker, color=trace.colour, **more)
    axes.set(title=plot.title, xlabel=plot.x, ylabel=plot.y)
    if plot.log:
        axes.set(xscale="log", yscale="log")
    if plot.equal:
        figure.set_layout_engine("compressed")  # the other leaves titles no room where a scale is fixed
        axes.set_aspect("equal")
        axes.set_ylim(bottom=0)
    if any(trace.style != "bar" for trace in plot.traces):
        axes.legend(frameon=False)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    if plot.key:
        lines = "\n".join(f"{i}  {name}" for name, i in plot.key.items())
        axes.annotate(lines, (1.02, 0.98), xycoords="axes fraction", va="top", fontsize=9, linespacing=1.6)
        figure.draw_without_rendering()  # so that it is known where points and labels come to lie
        number_points(axes, plot)
    return png(figure)


def number_points(axes: Any, plot: Plot) -> list[Any]:
    """Beside each named point its number of the plot's key, with a line to it where it is not near. Returns them, as
    matplotlib's annotations."""
    named = [(x, y, name, t.colour) for t in plot.traces for x, y, name in zip(t.x, t.y, t.names or [], strict=False)]
    pixels = 72.0 / axes.figure.dpi
    points = [pixels * axes.transData.transform((x, y)) for x, y, *_ in named]
    taken = [_box(x, y, MARK, MARK) for x, y in points]
    made = []
    for point, (x, y, name, hue) in zip(points, named, strict=True):
        text = str(plot.key[name])
        away, box = _free(point, 5.5 * len(text), taken)
        taken.append(box)
        line = {"arrowstyle": "-", "lw": 0.7, "color": hue, "shrinkA": 0.0, "shrinkB": 0.5 * MARK}
        how = {"color": hue, "fontsize": 8, "ha": "center", "va": "center"}
        how |= {"arrowprops": line} if math.hypot(*away) > 1.1 * NEAR[0] else {}
        made.append(axes.annotate(text, (x, y), away, textcoords="offset points", **how))
    return made


def _free(point: Any, width: float, taken: list[Any]) -> tuple[tuple[float, float], Any]:
    """(offset, box) of a number so wide beside a point, where it covers nothing that is taken; or else beside it. In
    points of print."""
    places = [(r * math.cos(angle), r * math.sin(angle)) for r in NEAR for angle in AROUND]
    boxes = [_box(point[0] + dx, point[1] + dy, width, 8.0) for dx, dy in places]
    free = (i for i, box in enumerate(boxes) if not any(box.overlaps(other) for other in taken))
    i = next(free, 0)
    return places[i], boxes[i]


def _box(x: float, y: float, width: float, height: float) -> Any:
    """A box about a centre."""
    from matplotlib.transforms import Bbox

    return Bbox.from_bounds(x - 0.5 * width, y - 0.5 * height, width, height)


def png(figure: Any) -> bytes:
    """A figure as a PNG."""
    import io

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
