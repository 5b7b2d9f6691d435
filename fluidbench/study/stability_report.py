"""What `stability` shows: blocks against theory, every point of every axis, and a map of the limits an axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..report.plot import Plot, Trace, colour
from ..report.report import Report
from ..report.table import Table, number
from ..scenario import Scenario
from .points import Axis, findings
from .trials import Trial

Row = dict[str, Any]


def report(
    scenario: Scenario, axes: Mapping[str, Axis], points: Sequence[Row], blocks: Sequence[Row], own: Sequence[Trial]
) -> Report:
    import pandas as pd

    lines = findings(points, blocks)
    for trial in own:
        if trial.finding is None:
            lines.append(f"{trial.name}: {trial.verdict}: {trial.note}.")
        else:
            first = trial.finding.numbers[0]
            lines.append(
                f"{trial.method}, {trial.case.title}: {first.quantity}: {first.measured:.2f}, fitted once; "
                f"{trial.case.measure}: {trial.error:.0%}."
            )
    return Report(
        "stability",
        f"fluidbench stability: {scenario.name}",
        "The largest stable time step of blocks at rest, and of a lump of the material thrown at the floor.",
        lines,
        [*([_blocks(blocks)] if blocks else []), _points(points)],
        pd.DataFrame([*points, *blocks]),
        _maps(points, axes),
    )


def _seconds(row: Row, key: str) -> str:
    value = row.get(key)
    return "-" if value is None or not math.isfinite(value) else f"{value:.3g}"


def _blocks(blocks: Sequence[Row]) -> Table:
    table = Table(
        "Blocks at rest, stripped to what theory knows",
        ["block", "method", "measured dt [s]", "theory dt [s]", "measured / theory", "own bound / measured"],
        note="theory: Fourier analyses, references.md, H; stable: kinetic energy grows less than 100-fold in 500 steps",
    )
    for b in blocks:
        if "dt_limit_s" not in b:
            table.rows.append([b["kind"], b["method"], b["reason"], "-", "-", "-"])
            continue
        table.rows.append(
            [
                b["kind"],
                b["method"],
                _seconds(b, "dt_limit_s"),
                _seconds(b, "dt_theory_s"),
                number(b["dt_limit_s"] / b["dt_theory_s"]),
                number(b["dt_own_s"] / b["dt_limit_s"]),
            ]
        )
    return table


def _points(points: Sequence[Row]) -> Table:
    table = Table(
        "Every point of every axis",
        ["axis", "value", "method", "verdict", "own dt [s]", "bound", "lump dt [s]", "block dt [s]", "theory dt [s]"],
        note="own: the step the method takes by default; lump: the largest at which a thrown lump stays sound (>: none "
        "larger was tried); block: the same at rest, as shipped",
    )
    for p in points:
        beyond = "" if p.get("lump_limit_found", True) else "> "
        lump = _seconds(p, "dt_lump_s")
        table.rows.append(
            [
                p["axis"],
                f"{p['value']:g}",
                p["method"],
                p["verdict"],
                _seconds(p, "dt_own_s"),
                p.get("binding", "-"),
                "-" if lump == "-" else beyond + lump,
                _seconds(p, "dt_block_s"),
                _seconds(p, "dt_theory_s"),
            ]
        )
    return table


def _maps(points: Sequence[Row], axes: Mapping[str, Axis]) -> list[Plot]:
    """For each axis the limits of each method, theory dashed, its own bound dotted."""
    plots = []
    for axis in dict.fromkeys(p["axis"] for p in points):
        plot = Plot(
            f"limits-{axis}", f"time step limits over {axis}", f"{axis} [{axes[axis].unit}]", "dt [s]", log=True
        )
        for method in dict.fromkeys(p["method"] for p in points if p["axis"] == axis):
            own = [p for p in points if (p["axis"], p["method"]) == (axis, method) and p["value"] > 0]
            tint = colour(method)
            for key, label, style in (
                ("dt_lump_s", method, "line+points"),
                ("dt_theory_s", f"{method}, theory", "dashed"),
                ("dt_own_s", f"{method}, own bound", "dotted"),
            ):
                seen = [(p["value"], p[key]) for p in own if p.get(key)]
                if seen:
                    xs, ys = map(list, zip(*seen, strict=True))
                    plot.traces.append(Trace(label, xs, ys, style, tint))
        plots.append(plot)
    return plots
