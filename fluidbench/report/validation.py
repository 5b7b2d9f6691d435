"""What `validate` shows: the table, each case's profiles against its reference, and the work-precision diagrams."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..store import write_atomically
from ..study.case import METHOD_OF_LAW, Case, Curve
from ..study.validate import PASS, Trial, orders, write_results
from .html import environment, plotly_html, script
from .tables import Table, number, show
from .traces import Plot, Trace, colour

if TYPE_CHECKING:
    from rich.console import Console

PAGE = """{% extends "base" %}{% block body %}
<p>{{ subtitle }}</p>
<h2>{{ table.title }}</h2>{{ rows(table) }}
<p>{{ table.note }}</p>
{% for case in cases %}<h2 id="{{ case.name }}">{{ case.name }}: {{ case.title }}</h2>
<p>Reference: {{ case.source }}. Error: {{ case.measure }}.</p>
{% for line in case.notes %}<p class="bad">{{ line }}</p>{% endfor %}
{{ rows(case.table) }}
<div class="grid">{% for plot in case.plots %}<div>{{ plot }}</div>{% endfor %}</div>{% endfor %}
<p>{{ machine }}</p>{% endblock %}
"""


def line(trial: Trial) -> str:
    """One trial in a line."""
    note = f"  ({trial.note})" if trial.note else ""
    return (
        f"{trial.case.name:<20} {trial.method:<4} d = {trial.spacing:<9.3g} error {_error(trial.error):>9} of "
        f"{trial.tolerance:<7.3g} {trial.verdict}{note}"
    )


def _error(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def summary(trials: Sequence[Trial]) -> Table:
    """Case, method, spacing, error, tolerance, order, cost and verdict, one row a trial."""
    slopes = orders(trials)
    head = ["case", "method", "spacing [m]", "particles", "error", "tolerance", "order", "wall s / sim. s", "verdict"]
    verdicts = ", ".join(f"{n} {verdict}" for verdict, n in Counter(t.verdict for t in trials).items())
    note = "order: slope of log error over log spacing (number of spacings); exempt: run, but not expected to pass"
    table = Table("Known answers", head, note=f"{verdicts}; {note}")
    for t in trials:
        slope, spacings = slopes.get((t.case.name, t.method), (math.nan, 0))
        table.rows.append([
            t.case.name, t.method, number(t.spacing), f"{t.cost.get('particles', 0):.0f}", _error(t.error),
            number(t.tolerance), "-" if math.isnan(slope) else f"{slope:.2f} ({spacings})",
            _error(t.cost.get("wall_per_simulated_s", math.nan)), t.verdict,
        ])  # fmt: skip
    return table


def present(trials: Sequence[Trial], root: Path, console: Console) -> bool:
    """Print and write everything; True when no trial missed its tolerance or failed."""
    write_results(trials, root)
    write_markdown(trials, root)
    write_answers(trials, root)
    page = write_page(trials, root)
    show(console, summary(trials))
    for trial in trials:
        if trial.note:
            console.print(f"{trial.case.name} {trial.method}: {trial.verdict}: {trial.note}", markup=False)
    console.print(f"report: {page}", markup=False, highlight=False, soft_wrap=True)
    return all(t.verdict in (PASS, "exempt", "skipped") for t in trials)


def write_markdown(trials: Sequence[Trial], root: Path) -> Path:
    """validate.md: the table with what it was measured on, for docs/validation.md."""
    machine = _machine(trials)
    table = summary(trials)
    head = ["case", "physics", *table.head[1:], "measure", "source"]
    lines = [
        "# Known answers", "",
        "Made by `fluidbench validate --out OUT`, which writes this file as `OUT/validate.md`; `OUT/report.html` holds",
        "the profiles and the work-precision diagrams. A row alone: `fluidbench validate CASE --solvers METHOD`.", "",
        f"{machine.get('time', '')[:10]}, fluidbench {machine.get('fluidbench', '')}, Warp {machine.get('warp', '')}, "
        f"Python {machine.get('python', '')}, {machine.get('device', '')} ({machine.get('cores', '')} cores).", "",
        f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}",
    ]  # fmt: skip
    for trial, row in zip(trials, table.rows, strict=True):
        cells = [row[0], trial.case.physics, *row[1:], trial.case.measure, trial.case.source]
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    notes = dict.fromkeys(f"- {t.case.name}, {t.method}: {t.verdict}: {t.note}" for t in trials if t.note)
    write_atomically(root / "validate.md", "\n".join([*lines, "", table.note + ".", "", *notes, ""]))
    return root / "validate.md"


def write_answers(trials: Sequence[Trial], root: Path) -> Path:
    """known_answers.csv, for scenarios/reference: what `select` and `table1` know of each method."""
    machine = _machine(trials)
    kept = [t for t in trials if t.finding is not None and t.method != METHOD_OF_LAW]
    lines = [
        f"# Made by `fluidbench validate --out OUT` as OUT/known_answers.csv; {machine.get('time', '')[:10]}, "
        f"fluidbench {machine.get('fluidbench', '')}, {machine.get('device', '')}.",
        "case,physics,method,spacing_m,particles,error,tolerance,verdict,wall_s,wall_per_simulated_s",
    ]
    for t in kept:
        cost = [t.cost[key] for key in ("wall_s", "wall_per_simulated_s")]
        lines.append(
            f"{t.case.name},{t.case.physics},{t.method},{t.spacing:.6g},{t.cost['particles']:.0f},{t.error:.5g},"
            f"{t.tolerance:g},{t.verdict},{cost[0]:.4g},{cost[1]:.4g}"
        )
    write_atomically(root / "known_answers.csv", "\n".join([*lines, ""]))
    return root / "known_answers.csv"


def _machine(trials: Sequence[Trial]) -> dict[str, str]:
    """What the first run that says so was made on."""
    return next((r.record["machine"] for t in trials for r in t.runs.values() if "machine" in r.record), {})


def write_page(trials: Sequence[Trial], root: Path) -> Path:
    """report.html: the table, and a section for each case."""
    from markupsafe import Markup

    from .figures import draw

    sections = []
    for case in dict.fromkeys(t.case for t in trials):
        own = [t for t in trials if t.case is case]
        drawn = [*profiles(own), *([] if case.drive else [work_precision(own)])]
        for plot in drawn:
            draw(plot, root)
        sections.append({
            "name": case.name, "title": case.title, "source": case.source, "measure": case.measure,
            "table": _numbers(own), "plots": [Markup(plotly_html(plot)) for plot in drawn],
            "notes": [f"{t.method}: {t.verdict}: {t.note}" for t in own if t.note],
        })  # fmt: skip
    text = environment({"page": PAGE}).get_template("page").render(
        title="fluidbench validate", subtitle="Cases with known answers through every method.", table=summary(trials),
        cases=sections, script=script(),
        machine="; ".join(f"{k} {v}" for k, v in _machine(trials).items()),
    )  # fmt: skip
    write_atomically(root / "report.html", text)
    return root / "report.html"


def _numbers(trials: Sequence[Trial]) -> Table:
    table = Table("", ["quantity", "method", "spacing [m]", "measured", "reference"])
    for t in trials:
        for n in t.finding.numbers if t.finding else ():
            table.rows.append([n.quantity, t.method, number(t.spacing), number(n.measured), number(n.reference)])
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
