"""What `table1` shows: the paper's table, cell by cell, with the rules and the runs behind the verdicts."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from ..report.page import anchor
from ..report.report import Report, Runs, machine_of, record_link
from ..report.table import Link, Table
from ..study.validate_report import work_precision
from . import PAPER
from .cells import Cell
from .evidence import Evidence
from .frameworks import IN_BOTH
from .judged import cells as judged
from .verdicts import OPEN, RULES

if TYPE_CHECKING:
    import pandas as pd


def report(e: Evidence, root: Path) -> Report:
    cells = judged(e)
    counts = Counter(c.verdict for c in cells if not c.row.startswith(IN_BOTH))
    findings = ["Verdicts: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()) + "."]
    findings += [f"{c.row}, {c.method}: '{c.paper}': {c.verdict}. {c.measured}." for c in cells if c.verdict != OPEN]
    by_case: dict[str, list] = {}
    for t in e.trials:
        by_case.setdefault(t.case.name, []).append(t)
    several = [ts for ts in by_case.values() if len({t.spacing for t in ts}) > 1]
    return Report(
        "table1",
        f"fluidbench table1: {e.scenario.name}",
        f'The table of "{PAPER}", with what was measured and a verdict that a rule computes.',
        findings,
        [_cells(cells), _rules()],
        _data(cells, root),
        [work_precision(ts) for ts in several],
        _runs(cells, root),
        machine_of(r for c in cells for r in c.runs),
    )


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
