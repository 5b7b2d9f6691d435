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


Values = dict[str, list[float]]  # of each run by its label, in the order of what was measured


def values_of(results: Sequence[Run], measured: Sequence[Measured]) -> Values:
    """What every completed run has of what was measured."""
    return {run.label: computed(run, measured) for run in results if run.ok and run.record.repeat == 0 and measured}


def against_measured(values: Values, measured: Sequence[Measured]) -> Table | None:
    """Each measured number, and of each method its value with the error in per cent and over the uncertainty."""
    if not values:
        return None
    table = Table("Against measurements", ["", "measured", *values])
    missing: list[str] = []
    for i, one in enumerate(measured):
        scale, unit = SCALES[unit_of(one.key)]
        given = number(scale * one.value)
        given += f" ± {number(scale * one.uncertainty)}" if one.uncertainty is not None else ""
        cells = [_cell(own[i], one, scale) for own in values.values()]
        table.rows.append([f"{one.words} [{unit}]" if unit else one.words, given, *cells])
        missing += [f"{label} has no {one.words}" for label, own in values.items() if math.isnan(own[i])]
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


def measured_plot(values: Values, measured: Sequence[Measured]) -> list[Plot]:
    """Computed over measured, a point a method, with the uncertainty about 1."""
    told = [i for i, one in enumerate(measured) if one.value]
    if not values or not told:
        return []
    plot = Plot("measured", "computed over measured", "", "computed / measured")
    names = {i: measured[i].words.replace(" at ", "<br>at ") for i in told}
    spread = [abs((measured[i].uncertainty or 0.0) / measured[i].value) for i in told]
    plot.traces.append(Trace("measured", list(names.values()), [1.0] * len(told), "points", "#000000", spread))
    for label, own in values.items():
        there = [i for i in told if not math.isnan(own[i])]
        ratios = [own[i] / measured[i].value for i in there]
        if there:
            plot.traces.append(Trace(label, [names[i] for i in there], ratios, "points", colour(label)))
    return [plot]


def points_along(plot: str, measured: Sequence[Measured]) -> list[Trace]:
    """What was measured along the path, for the plot of that name."""
    own = [one for one in measured if one.place is not None and ALONG[one.key] == plot]
    if not own:
        return []
    places, values = [1e3 * (one.place or 0.0) for one in own], [1e3 * one.value for one in own]
    return [Trace("measured", places, values, "points", "#000000", [1e3 * (one.uncertainty or 0.0) for one in own])]
