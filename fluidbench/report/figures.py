"""Plots as pictures, by matplotlib; needs no display, and leaves the user's own matplotlib alone."""

from __future__ import annotations

from typing import Any

from .plot import Plot


def figure_of(width: float, height: float) -> Any:
    """An empty figure of this size [inches]."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def draw(plot: Plot) -> bytes:
    """One plot as a PNG."""
    figure = figure_of(7.0, 4.0)
    axes = figure.subplots()
    for trace in plot.traces:
        places = [x.replace("<br>", "\n") if isinstance(x, str) else x for x in trace.x]  # a page breaks lines so
        if trace.style == "bar":
            axes.bar(places, trace.y, color=trace.colour)
        elif trace.style == "points":
            marks = {"fmt": "o", "mfc": "none", "capsize": 4, "color": trace.colour, "label": trace.label}
            axes.errorbar(places, trace.y, trace.spread, **marks)
        else:
            marker = "o" if trace.style == "line+points" else ""
            line = {"dashed": "--", "dotted": ":"}.get(trace.style, "-")
            axes.plot(places, trace.y, line, marker=marker, color=trace.colour, label=trace.label or None, lw=1.6)
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
    return png(figure)


def png(figure: Any) -> bytes:
    """A figure as a PNG."""
    import io

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130)
    return buffer.getvalue()
