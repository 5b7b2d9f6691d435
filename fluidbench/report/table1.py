"""What `table1` shows: the paper's table, cell by cell, with the rules and the runs behind the verdicts."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from ..study.cells import Cell
from ..study.evidence import Evidence
from ..study.frameworks import IN_BOTH
from ..study.table1 import table1
from ..study.verdicts import OPEN, RULES
from .study import Report, Runs, anchor, record_link
from .tables import Link, Table
from .validation import work_precision

if TYPE_CHECKING:
    import pandas as pd


def report(e: Evidence, root: Path) -> Report:
    cells = table1(e)
    counts = Counter(c.verdict for c in cells if not c.row.startswith(IN_BOTH))
    findings = ["Verdicts: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()) + "."]
    findings += [f"{c.row}, {c.method}: '{c.paper}': {c.verdict}. {c.measured}." for c in cells if c.verdict != OPEN]
    by_case: dict[str, list] = {}
    for t in e.trials:
        by_case.setdefault(t.case.name, []).append(t)
    several = [ts for ts in by_case.values() if len({t.spacing for t in ts}) > 1]
    machine = next((r.record["machine"] for c in cells for r in c.runs if "machine" in r.record), {})
    return Report(
        "table1", f"fluidbench table1: {e.scenario.name}",
        "The paper's table, with what was measured and a verdict that a rule computes.", findings,
        [_cells(cells), _rules()], _data(cells, root), [work_precision(ts) for ts in several],
        _runs(cells, root), "; ".join(f"{k} {v}" for k, v in machine.items()),
    )  # fmt: skip


def _data(cells: list[Cell], root: Path) -> pd.DataFrame:
    """One row a cell; its runs as folders."""
    import pandas as pd

    rows = [{k: v for k, v in vars(c).items() if k != "runs"} for c in cells]
    folders = [" ".join(r.folder.relative_to(root).as_posix() for r in c.runs) for c in cells]
    return pd.DataFrame(rows).assign(runs=folders)


def _runs(cells: list[Cell], root: Path) -> Runs:
    """The records behind each cell; where one has no run of its own, nothing."""
    return {_name(c): [record_link(r, root) for r in c.runs] for c in cells if c.runs}


def _name(cell: Cell) -> str:
    return f"{cell.row}, {cell.method}: {cell.paper}"


def _cells(cells: list[Cell]) -> Table:
    table = Table("Table I, by measurement", ["row", "method", "paper", "measured", "experiment", "rule", "verdict"])
    for c in cells:
        experiment = Link(c.experiment, f"#{anchor(_name(c))}") if c.runs else c.experiment
        table.rows.append([c.row, c.method, c.paper, c.measured, experiment, c.rule, c.verdict])
    return table


def _rules() -> Table:
    table = Table("Rules", ["rule", "what it takes"])
    table.rows.extend([name, text] for name, text in RULES.items())
    return table
