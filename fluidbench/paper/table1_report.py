"""What `table1` shows: the paper's table, methods as columns, and under it the evidence of every cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from ..report.page import anchor
from ..report.report import Detail, Report, machine_of
from ..report.table import Link, Table
from ..study.validate_report import work_precision
from . import PAPER
from .cells import Cell
from .definitions import CONFIRMED, METHODS, OPEN, REFUTED, RULES
from .evidence import Evidence
from .judged import cells as judged
from .repeat import commands
from .table1_text import DEPENDS, MARKS, WORDS, latex, markdown

if TYPE_CHECKING:
    import pandas as pd

    from ..study.trials import Trial

NOTE = f"✓ {CONFIRMED}; ✗ {REFUTED}; ? open; ≠ the rule decides otherwise elsewhere, see the evidence"

Studies = Mapping[str, Evidence]
Place = list[tuple[str, Cell]]  # a cell in every study that has it


def report(studies: Studies, root: Path) -> Report:
    """`studies` by what sets them apart: one, or several that are put side by side."""
    found = gathered(studies)
    counts = Counter(verdict(place) for place in found)
    findings = [f"Of {len(found)} statements " + ", ".join(f"{n} {WORDS[v]}" for v, n in counts.items()) + "."]
    findings += [sentence(place) for place in found if verdict(place) in (OPEN, DEPENDS)]
    scenario = next(iter(studies.values())).scenario.name
    shown = matrix(found, len(studies) > 1)
    again = {label: commands(e) for label, e in studies.items()}
    details = [*(_detail(place, again, root) for place in found), _rules()]
    made = [f"{label}: {machine_of(e.sweeps())}" for label, e in studies.items()]
    return Report(
        "table1",
        f"fluidbench table1: {scenario}",
        f'The table of "{PAPER}", with what was measured and a verdict that a rule computes: {", ".join(studies)}.',
        findings,
        [shown],
        _data(found),
        _work_precision(next(iter(studies.values())).trials),
        details=details,
        machine="; ".join(made),
        files={"table1.md": markdown(shown, findings, details, made), "table1.tex": latex(shown)},
    )


def gathered(studies: Studies) -> list[Place]:
    """The cells of all studies, those of one place together."""
    found: dict[tuple[str, str, str], Place] = {}
    for label, e in studies.items():
        for cell in judged(e):
            found.setdefault(cell.place, []).append((label, cell))
    return list(found.values())


def verdict(place: Place) -> str:
    """What all studies and conditions say; open where one study is."""
    if any(cell.verdict == OPEN for _, cell in place):
        return OPEN
    same = len({cell.verdict for _, cell in place}) == 1 and not any(cell.differs for _, cell in place)
    return place[0][1].verdict if same else DEPENDS


def sentence(place: Place) -> str:
    """A cell as a finding."""
    first = place[0][1]
    told = [f"{f'{label}: ' if len(place) > 1 else ''}{c.verdict}. {c.measured}" for label, c in place]
    differs = [f" But {v}: {_in(label, place)}{where}." for label, c in place for where, v in c.differs.items()]
    return f"{first.name}: {'; '.join(told)}.{''.join(differs)}"


def _in(label: str, place: Place) -> str:
    """The study's name, where there are several."""
    return f"{label}, " if len(place) > 1 else ""


def matrix(found: Sequence[Place], several: bool) -> Table:
    """The paper's rows, methods as columns; in a cell each statement with its mark, and under it what was measured."""
    table = Table("Table I, by measurement", ["", *METHODS], note=NOTE, text=True)
    for row in dict.fromkeys(place[0][1].row for place in found):
        columns = []
        for method in METHODS:
            own = [place for place in found if (place[0][1].row, place[0][1].method) == (row, method)]
            columns.append([line for place in own for line in _statement(place, several)])
        table.rows.append([row, *columns])
    return table


def _statement(place: Place, several: bool) -> list[str]:
    cell = place[0][1]
    head = Link(f"{MARKS[verdict(place)]} {cell.statement}", f"#{anchor(cell.name)}")
    if not several:
        return [head, f"  {cell.brief}"]
    return [head, *(f"  {MARKS[c.verdict]} {label}: {c.brief}" for label, c in place)]


def _detail(place: Place, again: Mapping[str, Mapping[str, str]], root: Path) -> Detail:
    """What stands behind a cell: per study what was measured, what the verdict hangs on, and the runs."""
    first = place[0][1]
    made = Detail(f"{MARKS[verdict(place)]} {first.name}", anchor(first.name))
    for label, cell in place:
        made.lines.append(f"{label}: {cell.verdict}. {cell.measured}.")
        if cell.sensitivity:
            made.lines.append(f"What it hangs on: {cell.sensitivity}.")
        made.lines += [f"Elsewhere: {where}: {v}." for where, v in cell.elsewhere.items()]
        for run in {r.folder: r for r in cell.runs}.values():
            made.add_run(run, root, again[label].get(run.folder.name, ""))
    made.lines.append(f"Rule: {RULES[first.rule]}. Experiment: {first.experiment}.")
    return made


def _rules() -> Detail:
    return Detail("The rules", "rules", [f"{name}: {text}." for name, text in RULES.items()])


def _work_precision(trials: Sequence[Trial]) -> list:
    by_case: dict[str, list[Trial]] = {}
    for t in trials:
        by_case.setdefault(t.case.name, []).append(t)
    return [work_precision(ts) for ts in by_case.values() if len({t.spacing for t in ts}) > 1]


def _data(found: Sequence[Place]) -> pd.DataFrame:
    """One row a cell and study; its runs as names of folders."""
    import pandas as pd

    rows = []
    for label, cell in chain.from_iterable(found):
        row = {k: v for k, v in vars(cell).items() if k not in ("runs", "elsewhere")}
        elsewhere = "; ".join(f"{where}: {v}" for where, v in cell.elsewhere.items())
        folders = " ".join(run.folder.name for run in cell.runs)
        rows.append({"study": label, **row, "elsewhere": elsewhere, "runs": folders})
    return pd.DataFrame(rows)
