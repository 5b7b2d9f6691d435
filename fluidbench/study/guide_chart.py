"""The chart of choices: a row for each job, a block of columns for each machine, a column for each tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..report.figures import figure_of, png
from ..report.plot import colour
from .choice import Choice, time_of

SURE = {"high": "●●●", "medium": "●●○", "low": "●○○"}
WIDTH, HEIGHT, NAMES = 1.45, 0.82, 1.4  # of a cell, and of the column of names [inches]
NOTHING = "#eeeeee"


def chart(found: Sequence[Choice]) -> bytes:
    """As PNG: in each cell the method, its spacing, its time, and how sure that is."""
    jobs, machines = (list(dict.fromkeys(getattr(c, name) for c in found)) for name in ("job", "machine"))
    tolerances = sorted({c.tolerance for c in found}, reverse=True)
    columns = [(machine, tolerance) for machine in machines for tolerance in tolerances]
    figure = figure_of(NAMES + WIDTH * len(columns), 1.25 + HEIGHT * len(jobs))
    axes = figure.subplots()
    for c in found:
        _draw(axes, c, columns.index((c.machine, c.tolerance)), jobs.index(c.job))
    for i, (_, tolerance) in enumerate(columns):
        axes.text(i + 0.5, -0.08, f"within {100 * tolerance:.3g} %", ha="center", va="bottom", fontsize=9)
    for i, machine in enumerate(machines):
        middle = (i + 0.5) * len(tolerances)
        axes.text(middle, -0.38, machine, ha="center", va="bottom", fontsize=11, weight="bold")
        if i:
            axes.axvline(i * len(tolerances), color="black", lw=1.2)
    axes.set(xlim=(0, len(columns)), ylim=(len(jobs) + 0.55, -0.7), xticks=[])
    axes.set_yticks([i + 0.5 for i in range(len(jobs))], jobs, fontsize=11)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    words = "   ".join(f"{sign} {word}" for word, sign in SURE.items())
    told = f"cheapest method within the tolerance, its spacing and time\nconfidence:  {words}"
    axes.text(0, len(jobs) + 0.1, told, fontsize=8, va="top")
    return png(figure)


def _draw(axes: Any, c: Choice, column: int, row: int) -> None:
    from matplotlib.patches import Rectangle

    place = (column + 0.02, row + 0.03)
    fill = colour(c.best.method) if c.best is not None and c.met else NOTHING
    axes.add_patch(Rectangle(place, 0.96, 0.94, facecolor=fill, alpha=0.35 if c.met else 1.0, edgecolor="none"))
    if c.best is None:
        lines = ["nothing judged"]
    elif c.met:
        lines = [f"{1e3 * c.best.spacing:.3g} mm, {time_of(c.best.seconds)}", SURE[c.confidence]]
    else:
        lines = [f"nearest: {c.best.method.upper()}", f"{c.best.error:.1%} off"]
    head = c.best.method.upper() if c.best is not None and c.met else "none"
    axes.text(column + 0.5, row + 0.30, head, ha="center", va="center", fontsize=12, weight="bold")
    for i, line in enumerate(lines):
        axes.text(column + 0.5, row + 0.57 + 0.23 * i, line, ha="center", va="center", fontsize=9)
