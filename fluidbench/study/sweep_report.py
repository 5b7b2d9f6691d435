"""What `sweep` shows: a row a point, and small multiples of every length over the first key."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..measure.tower import Print
from ..report.plot import Plot, Trace, colour
from ..report.report import Report, machine_of, record_link
from ..report.table import Table, label, number, readable
from ..scenario import Scenario
from .lengths import lengths_in

if TYPE_CHECKING:
    from .sweep import Point

MOST_ROWS = 60  # that the terminal shows


def report(
    scenario: Scenario,
    keys: Sequence[str],
    points: Sequence[Point],
    machine: Mapping[str, str],
    apart: Sequence[str],
    root: Path,
) -> Report:
    """`machine`: what batches ran on; `apart`: which of them did not complete."""
    import pandas as pd

    names = list(dict.fromkeys(name for p in points for name in lengths_in(p.measures)))
    counts = Counter(p.verdict for p in points)
    grid = len(points) // max(len({p.method for p in points}), 1)
    findings = [
        f"{grid} points, {len(points)} runs: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()) + "."
    ]
    shared = sum(p.together > 1 for p in points)
    findings += [f"{shared} of them shared launches with others: their cost is that of the whole batch."] * (shared > 0)
    findings += [line for m in dict.fromkeys(p.method for p in points) for line in _ranges(m, points, names)]
    runs = [p.run for p in points if p.run is not None]
    return Report(
        "sweep",
        f"fluidbench sweep: {scenario.name}",
        f"{scenario.title or scenario.name}, over {' x '.join(keys)}.",
        findings,
        [_table(keys, points, names)],
        pd.DataFrame([_row(p) for p in points]),
        [plot for name in names for plot in _multiples(name, keys, points)],
        {"Points that ran alone": [record_link(run, root, p.name) for p in points if (run := p.run)]} if runs else {},
        machine_of(runs) or "; ".join(f"{key} {value}" for key, value in machine.items()),
        alarms=[f"{p.name}: the print: {p.print}" for p in points if p.print not in ("", Print.SOUND)],
        failures=[*apart, *(f"{p.name}: {p.verdict}: {p.reason}" for p in points if p.reason)],
        notes=[f"{p.name}: {line}" for p in points for line in p.warnings],
    )


def _row(point: Point) -> dict[str, Any]:
    settings = {key: _plain(value) for key, value in point.settings.items()}
    ended = {"method": point.method, "verdict": str(point.verdict), "reason": point.reason}
    ended |= {"print": str(point.print), "together": point.together}
    return settings | ended | point.measures | point.cost


def _plain(value: Any) -> Any:
    return value if isinstance(value, int | float | str | bool) else str(value)


def _ranges(method: str, points: Sequence[Point], names: Sequence[str]) -> list[str]:
    """From where to where each length goes."""
    found = []
    for name in names:
        own = [p.measures for p in points if p.method == method]
        values = [value for m in own if math.isfinite(value := m.get(name, math.nan))]
        if len(values) > 1:
            title, factor = readable(name, values)
            found.append(f"{method}: {title} from {number(factor * min(values))} to {number(factor * max(values))}.")
    return found


def _table(keys: Sequence[str], points: Sequence[Point], names: Sequence[str]) -> Table:
    scale = {name: readable(name, [p.measures[name] for p in points if name in p.measures]) for name in names}
    last = [key.rpartition(".")[2] for key in keys]
    called = [name if last.count(name) == 1 else key for key, name in zip(keys, last, strict=True)]
    head = ["method", *called, "verdict", *(title for title, _ in scale.values()), "wall [s]"]
    note = f"and {len(points) - MOST_ROWS} more, in sweep.parquet and sweep.csv" if len(points) > MOST_ROWS else ""
    if any(p.together > 1 for p in points):
        note = "wall [s]: of a batch / of so many points" + f"; {note}" * bool(note)
    table = Table("Points", head, note=note)
    for p in points[:MOST_ROWS]:
        lengths = [number(f * p.measures[n]) if n in p.measures else "-" for n, (_, f) in scale.items()]
        wall = number(p.cost["wall_s"]) if "wall_s" in p.cost else "-"
        beside = f" / {p.together}" if p.together > 1 else ""
        table.rows.append(
            [p.method, *(_shown(v) for v in p.settings.values()), str(p.verdict), *lengths, f"{wall}{beside}"]
        )
    return table


def _shown(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)


def _multiples(name: str, keys: Sequence[str], points: Sequence[Point]) -> list[Plot]:
    """A length over the first key; a panel for every combination of the others, a line for every method."""
    first, *others = keys
    title, factor = readable(name, [p.measures[name] for p in points if name in p.measures])
    plots = []
    for i, panel in enumerate(dict.fromkeys(tuple(p.settings[key] for key in others) for p in points)):
        held = ", ".join(f"{key.rpartition('.')[2]} = {_shown(v)}" for key, v in zip(others, panel, strict=True))
        plot = Plot(f"{name}-{i + 1}" if others else name, f"{title}{f', {held}' if held else ''}", label(first), title)
        for method in dict.fromkeys(p.method for p in points):
            own = [p for p in points if p.method == method and tuple(p.settings[key] for key in others) == panel]
            seen = [(p.settings[first], factor * p.measures[name]) for p in own if name in p.measures]
            if seen:
                xs, ys = map(list, zip(*seen, strict=True))
                plot.traces.append(Trace(method, xs, ys, "line+points", colour(method)))
        if plot.traces:
            plots.append(plot)
    return plots
