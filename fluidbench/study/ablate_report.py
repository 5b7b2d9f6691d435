"""What `ablate` shows: how far each change moved the lengths and what it saved, and the leanest mix."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..report.plot import Plot, Trace, colour
from ..report.report import Report, record_link
from ..report.table import Table
from ..scenario import Scenario
from .ablation import WORTH, Ablation, Effect, command


def verdict(seen: Effect, tolerance: float) -> str:
    """Needed: it moves a length beyond the tolerance; droppable: it saves time and moves nothing; idle: neither."""
    if not seen.ok:
        return str(seen.run.verdict)
    if not seen.moved <= tolerance:
        return "needed"
    return "droppable" if seen.saved > WORTH else "idle"


def report(scenario: Scenario, name: str, given: Sequence[str], done: Ablation, tolerance: float, root: Path) -> Report:
    import pandas as pd

    table = Table(
        "One change at a time",
        ["change", "method", "moved", "of", "time saved", "verdict"],
        note=f"needed: moves a length by more than {tolerance:.0%}; droppable: moves none so far and saves more than "
        f"{WORTH:.0%} of the time; idle: neither",
    )
    rows = []
    for seen in [*done.effects, *done.lean.values()]:
        word = verdict(seen, tolerance)
        rows.append(
            {
                "change": seen.change.name,
                "method": seen.method,
                "moved": seen.moved,
                "length": seen.length,
                "saved": seen.saved,
                "verdict": word,
                "settings": str(seen.change.settings),
                "reason": seen.run.reason,
            }
        )
        if seen in done.effects:
            table.rows.append(
                [seen.change.name, seen.method, _percent(seen.moved), seen.length, _percent(seen.saved), word]
            )
    findings = [f"{m}: the scenario itself ended as {r.verdict}." for m, r in done.base.items() if not r.ok]
    findings += done.impossible
    for method in (m for m, run in done.base.items() if run.ok):  # without it nothing was compared
        own = [e for e in done.effects if e.method == method]
        needed = [e.change.name for e in own if verdict(e, tolerance) == "needed"]
        spare = [e.change.name for e in own if verdict(e, tolerance) == "droppable"]
        findings.append(
            f"{method}: needed: {', '.join(needed) or 'nothing'}; droppable: {', '.join(spare) or 'nothing'}."
        )
        if method in done.lean:
            lean = done.lean[method]
            findings.append(
                f"{method}: leanest within {tolerance:.0%}: {lean.change.name}: saves {lean.saved:.0%} of the time, "
                f"moves {lean.length} by {lean.moved:.1%}. Alone: {command(name, given, lean)}"
            )
    plot = Plot("ablate", "what each change moves and saves", "time saved [%]", "length moved [%]")
    for method in done.base:
        seen = [e for e in done.effects if e.method == method and e.ok]
        if seen:
            xs, ys = [100 * e.saved for e in seen], [100 * e.moved for e in seen]
            plot.traces.append(Trace(method, xs, ys, "points", colour(method), names=[e.change.name for e in seen]))
    runs = {
        "every change": [
            record_link(e.run, root, f"{e.method}: {e.change.name}") for e in [*done.effects, *done.lean.values()]
        ]
    }
    return Report(
        "ablate",
        f"fluidbench ablate: {scenario.name}",
        "What it requires, and what it pays for without need.",
        findings,
        [table],
        pd.DataFrame(rows),
        [plot],
        runs,
    )


def _percent(value: float) -> str:
    return "-" if value != value else f"{100 * value:.1f} %"
