"""What `validate` shows: the table, each case's profiles against its reference, and the work-precision diagrams."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..report.plot import Plot, Trace, colour
from ..report.report import Report, Section, machine_of
from ..report.table import Table, number
from .case import METHOD_OF_LAW, Case, Curve
from .trials import Trial, orders, shown_error, tidy

if TYPE_CHECKING:
    import pandas as pd

ANSWERS = (
    "case",
    "physics",
    "method",
    "spacing_m",
    "particles",
    "error",
    "tolerance",
    "verdict",
    "wall_s",
    "wall_per_simulated_s",
)
"""Columns of known_answers.csv."""


def summary(trials: Sequence[Trial]) -> Table:
    """Case, method, spacing, error, tolerance, order, cost and verdict, one row a trial."""
    slopes = orders(trials)
    head = ["case", "method", "spacing [mm]", "particles", "error", "tolerance", "order", "wall s / sim. s", "verdict"]
    verdicts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(t.verdict for t in trials).items())
    note = "order: slope of log error over log spacing (number of spacings); exempt: run, but not expected to pass"
    table = Table("Known answers", head, note=f"{verdicts}; {note}")
    for t in trials:
        slope, spacings = slopes.get((t.case.name, t.method), (math.nan, 0))
        table.rows.append(
            [
                t.case.name,
                t.method,
                number(1e3 * t.spacing),
                f"{t.cost.get('particles', 0):.0f}",
                shown_error(t.error),
                number(t.tolerance),
                "-" if math.isnan(slope) else f"{slope:.2f} ({spacings})",
                shown_error(t.cost.get("wall_per_simulated_s", math.nan)),
                t.verdict,
            ]
        )
    return table


def report(trials: Sequence[Trial], root: Path) -> Report:
    """The table, a section for each case, and the files that docs and scenarios take over."""
    runs = [run for t in trials for run in t.runs.values()]
    return Report(
        "validate",
        "fluidbench validate",
        "Cases with known answers through every method.",
        [],
        [summary(trials)],
        data(trials, root),
        [],
        {},
        machine_of(runs),
        alarms=[f"{t.case.name} {t.method}: {t.verdict}: {t.note}" for t in trials if t.note],
        sections=[_section(case, [t for t in trials if t.case is case]) for case in {t.case: None for t in trials}],
        files={"validate.md": markdown(trials), "known_answers.csv": answers(trials)},
    )


def _section(case: Case, own: Sequence[Trial]) -> Section:
    return Section(
        case.name,
        f"{case.name}: {case.title}",
        f"Reference: {case.source}. Error: {case.measure}.",
        _numbers(own),
        [*profiles(own), *([] if case.drive else [work_precision(own)])],
        [f"{t.method}: {t.verdict}: {t.note}" for t in own if t.note],
    )


def data(trials: Sequence[Trial], root: Path) -> pd.DataFrame:
    """One row a trial, with its numbers beside their references and the folders of its runs."""
    table = tidy(trials)
    table["numbers"] = [json.dumps([vars(n) for n in t.finding.numbers] if t.finding else []) for t in trials]
    table["runs"] = [
        json.dumps({label: run.folder.relative_to(root).as_posix() for label, run in t.runs.items()}) for t in trials
    ]
    return table


def markdown(trials: Sequence[Trial]) -> str:
    """validate.md: the table with what it was measured on, for docs/validation.md."""
    import pandas as pd

    machine, shown = _machine(trials), summary(trials)
    table = pd.DataFrame(shown.rows, columns=pd.Index(shown.head))
    table.insert(1, "physics", [t.case.physics for t in trials])
    table["measure"], table["source"] = [t.case.measure for t in trials], [t.case.source for t in trials]
    table = table.map(lambda cell: cell.replace("|", "\\|"))
    notes = dict.fromkeys(f"- {t.case.name}, {t.method}: {t.verdict}: {t.note}" for t in trials if t.note)
    return "\n".join(
        [
            "# Known answers",
            "",
            "Made by `fluidbench validate --out OUT`, which writes this file as `OUT/validate.md`;",
            "`OUT/report.html` holds the profiles and the work-precision diagrams. A row alone:",
            "`fluidbench validate CASE --solvers METHOD`.",
            "",
            f"{machine.get('time', '')[:10]}, fluidbench {machine.get('fluidbench', '')}, "
            f"Warp {machine.get('warp', '')}, Python {machine.get('python', '')}, {machine.get('device', '')} "
            f"({machine.get('cores', '')} cores).",
            "",
            table.to_markdown(index=False, disable_numparse=True),
            "",
            shown.note + ".",
            "",
            *notes,
            "",
        ]
    )


def answers(trials: Sequence[Trial]) -> str:
    """known_answers.csv, for scenarios/reference: what `select` and `table1` know of each method."""
    import pandas as pd

    machine = _machine(trials)
    rows = [
        {
            "case": t.case.name,
            "physics": t.case.physics,
            "method": t.method,
            "spacing_m": f"{t.spacing:.6g}",
            "particles": f"{t.cost['particles']:.0f}",
            "error": f"{t.error:.5g}",
            "tolerance": f"{t.tolerance:g}",
            "verdict": t.verdict,
            **{key: f"{t.cost[key]:.4g}" for key in ("wall_s", "wall_per_simulated_s")},
        }
        for t in trials
        if t.finding is not None and t.method != METHOD_OF_LAW
    ]
    head = (
        f"# Made by `fluidbench validate --out OUT` as OUT/known_answers.csv; {machine.get('time', '')[:10]}, "
        f"fluidbench {machine.get('fluidbench', '')}, {machine.get('device', '')}.\n"
    )
    return head + pd.DataFrame(rows, columns=pd.Index(ANSWERS)).to_csv(index=False, lineterminator="\n")


def _machine(trials: Sequence[Trial]) -> dict[str, str]:
    """What the first run that says so was made on."""
    return next((r.record.machine for t in trials for r in t.runs.values() if r.record.machine), {})


def _numbers(trials: Sequence[Trial]) -> Table:
    table = Table("", ["quantity", "method", "spacing [mm]", "measured", "reference"])
    for t in trials:
        for n in t.finding.numbers if t.finding else ():
            table.rows.append([n.quantity, t.method, number(1e3 * t.spacing), number(n.measured), number(n.reference)])
    return table


def profiles(trials: Sequence[Trial]) -> list[Plot]:
    """Every curve of a case, all methods at their finest spacing over one reference."""
    finest: dict[str, Trial] = {}
    for t in sorted(trials, key=lambda t: -t.spacing):
        if t.finding is not None:
            finest[t.method] = t
    drawn: dict[str, Plot] = {}
    for method, t in finest.items():
        assert t.finding is not None
        for curve in t.finding.curves:
            plot = drawn.get(curve.name) or _empty(t.case, curve)
            drawn[curve.name] = plot
            tint = "#444444" if method == METHOD_OF_LAW else colour(method)
            plot.traces.append(Trace(method, curve.x.tolist(), curve.y.tolist(), colour=tint))
    return list(drawn.values())


def _empty(case: Case, curve: Curve) -> Plot:
    """A plot that holds the reference only."""
    plot = Plot(
        f"{case.name}-{curve.name.replace(' ', '_')}", f"{case.name}: {curve.name}", curve.x_label, curve.y_label
    )
    if len(curve.reference_x):
        plot.traces.append(Trace("reference", curve.reference_x.tolist(), curve.reference_y.tolist(), style="points"))
    return plot


def work_precision(trials: Sequence[Trial]) -> Plot:
    """Error against wall time, one line a method."""
    case = trials[0].case
    plot = Plot(f"{case.name}-work_precision", f"{case.name}: error against cost", "wall time [s]", "error", log=True)
    for method in dict.fromkeys(t.method for t in trials):
        done = sorted(
            (t for t in trials if t.method == method and t.finding is not None), key=lambda t: t.cost["wall_s"]
        )
        if done:
            wall, error = [t.cost["wall_s"] for t in done], [t.error for t in done]
            plot.traces.append(Trace(method, wall, error, "line+points", colour(method)))
    return plot
