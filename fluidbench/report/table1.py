"""What `table1` shows: the paper's table, cell by cell, with the rules and the runs behind the verdicts."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path

from ..study.table1 import Cell, Evidence, table1
from ..study.verdicts import OPEN, RULES
from .study import Report
from .tables import Table
from .validation import work_precision


def report(e: Evidence, root: Path) -> Report:
    import pandas as pd

    cells = table1(e)
    counts = Counter(c.verdict for c in cells)
    findings = ["Verdicts: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()) + "."]
    findings += [f"{c.row}, {c.method}: '{c.paper}': {c.verdict}. {c.measured}." for c in cells if c.verdict != OPEN]
    by_case: dict[str, list] = {}
    for t in e.trials:
        by_case.setdefault(t.case.name, []).append(t)
    several = [ts for ts in by_case.values() if len({t.spacing for t in ts}) > 1]
    runs = [r for group in e.repeats.values() for r in group] + [*e.grids.values(), *e.iterations.values()]
    runs += [r for t in e.trials for r in t.runs.values()]
    links = [
        (f"{r.record['scenario']} {r.label}", f"{r.folder.relative_to(root).as_posix()}/record.json") for r in runs
    ]
    machine = next((r.record["machine"] for r in runs if "machine" in r.record), {})
    return Report(
        "table1", f"fluidbench table1: {e.scenario.name}",
        "The paper's table, with what was measured and a verdict that a rule computes.", findings,
        [_cells(cells), _rules()], pd.DataFrame([asdict(c) for c in cells]), [work_precision(ts) for ts in several],
        links, "; ".join(f"{k} {v}" for k, v in machine.items()),
    )  # fmt: skip


def _cells(cells: list[Cell]) -> Table:
    table = Table("Table I, by measurement", ["row", "method", "paper", "measured", "experiment", "rule", "verdict"])
    for c in cells:
        table.rows.append([c.row, c.method, c.paper, c.measured, c.experiment, c.rule, c.verdict])
    return table


def _rules() -> Table:
    table = Table("Rules", ["rule", "what it takes"])
    table.rows.extend([name, text] for name, text in RULES.items())
    return table
