"""Runs beside what somebody measured: a table, a plot, and points among those along the path."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..measure.beside import computed
from ..report.plot import Plot, Trace, colour
from ..report.table import Table, number
from ..runs.record import Run
from ..scenario.measured import ALONG, Measured, unit_of

SCALES = {"m": (1e3, "mm"), "m^2": (1e6, "mm²"), "": (1.0, "")}


def against_measured(results: Sequence[Run], measured: Sequence[Measured]) -> Table | None:
    """Each measured number, and of each method its value with the error in per cent and over the uncertainty."""
    done = [run for run in results if run.ok and run.record.repeat == 0]
    if not measured or not done:
        return None
    table = Table("Against measurements", ["", "measured", *[run.label for run in done]])
    missing: list[str] = []
    for one in measured:
        scale, unit = SCALES[unit_of(one.key)]
        given = number(scale * one.value)
        given += f" ± {number(scale * one.uncertainty)}" if one.uncertainty is not None else ""
        row = [f"{one.words} [{unit}]" if unit else one.words, given]
        for run in done:
            value = computed(run, one)
            row.append(_cell(value, one, scale))
            if math.isnan(value):
                missing.append(f"{run.label} has no {one.words}")
        table.rows.append(row)
    words = "error in per cent, and over the uncertainty (u) where one is given"
    sources = dict.fromkeys(one.source for one in measured if one.source)
    note = [words, *(f"measured: {line}" for line in sources), *(f"not compared: {line}" for line in missing)]
    return Table(table.title, table.head, table.rows, "\n".join(note))


def _cell(value: float, one: Measured, scale: float) -> str:
    if math.isnan(value):
        return "-"
    parts = [f"{100 * (value / one.value - 1.0):+.1f} %"] if one.value else []
    parts += [f"{(value - one.value) / one.uncertainty:+.1f} u"] if one.uncertainty is not None else []
    return f"{number(scale * value)} ({', '.join(parts)})" if parts else number(scale * value)


def measured_plot(results: Sequence[Run], measured: Sequence[Measured]) -> list[Plot]:
    """Computed over measured, a point a method, with the uncertainty about 1."""
    done = [run for run in results if run.ok and run.record.repeat == 0]
    told = [one for one in measured if one.value]
    if not done or not told:
        return []
    plot = Plot("measured", "computed over measured", "", "computed / measured")
    names = [one.words.replace(" at ", "<br>at ") for one in told]
    spread = [abs((one.uncertainty or 0.0) / one.value) for one in told]
    plot.traces.append(Trace("measured", names, [1.0] * len(told), "points", "#000000", spread))
    for run in done:
        ratio = [computed(run, one) / one.value for one in told]
        found = [(name, value) for name, value in zip(names, ratio, strict=True) if not math.isnan(value)]
        if found:
            xs, ys = zip(*found, strict=True)
            plot.traces.append(Trace(run.label, list(xs), list(ys), "points", colour(run.label)))
    return [plot]


def points_along(plot: str, measured: Sequence[Measured]) -> list[Trace]:
    """What was measured along the path, for the plot of that name."""
    own = [one for one in measured if one.place is not None and ALONG[one.key] == plot]
    if not own:
        return []
    places, values = [1e3 * (one.place or 0.0) for one in own], [1e3 * one.value for one in own]
    return [Trace("measured", places, values, "points", "#000000", [1e3 * (one.uncertainty or 0.0) for one in own])]
