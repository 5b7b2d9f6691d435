"""What `table1` shows: the paper's table, methods as columns, and under it the evidence of every cell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..report.page import anchor
from ..report.report import Detail, Report, machine_of
from ..report.table import Link, Table
from ..runs.archive import of_other_code
from ..study.validate_report import work_precision
from . import PAPER
from .cells import Cell
from .definitions import CONFIRMED, METHODS, OPEN, REFUTED, RULES
from .evidence import Evidence
from .judged import cells as judged
from .repeat import commands
from .table1_text import DEPENDS, LOOSE, MARKS, WORDS, latex, markdown

if TYPE_CHECKING:
    import pandas as pd

    from ..study.trials import Trial

NOTE = (
    f"✓ {CONFIRMED}; ✗ {REFUTED}; ? open; ≠ the rule decides otherwise elsewhere; ± it did when the study was made "
    "again; see the evidence"
)

Studies = Mapping[str, Evidence]


class Entry(NamedTuple):
    """A cell as one study has it, and what that was run on."""

    study: str
    machine: str
    cell: Cell


Place = list[Entry]  # a cell in every study that has it


def report(studies: Studies, root: Path) -> Report:
    """`studies` by what sets them apart: one, or several that are put side by side."""
    found = gathered(studies)
    counts = Counter(verdict(place) for place in found)
    findings = [f"Of {len(found)} statements " + ", ".join(f"{n} {WORDS[v]}" for v, n in counts.items()) + "."]
    findings += [f"{line}." for line in of_other_code({label: e.sweeps() for label, e in studies.items()})]
    findings += repeated(found)
    findings += [sentence(place) for place in found if verdict(place) in (OPEN, DEPENDS, LOOSE)]
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
            found.setdefault(cell.place, []).append(Entry(label, e.machine, cell))
    return list(found.values())


def verdict(place: Place) -> str:
    """What all studies and conditions say; open where one study is, not robust where one that was made again on the
    same kind of machine says otherwise."""
    if any(entry.cell.verdict == OPEN for entry in place):
        return OPEN
    if any(changed(place, machine) for machine in {entry.machine for entry in place}):
        return LOOSE
    same = len({entry.cell.verdict for entry in place}) == 1 and not any(entry.cell.differs for entry in place)
    return place[0].cell.verdict if same else DEPENDS


def changed(place: Place, machine: str) -> bool:
    """Whether studies of one kind of machine disagree."""
    return len({entry.cell.verdict for entry in place if entry.machine == machine}) > 1


def repeated(found: Sequence[Place]) -> list[str]:
    """For each kind of machine that was studied more than once, what came out otherwise."""
    lines = []
    studies = dict.fromkeys((entry.machine, entry.study) for place in found for entry in place)
    for machine, times in Counter(machine for machine, _ in studies).items():
        if times > 1:
            loose = [place[0].cell.name for place in found if changed(place, machine)]
            names = f": {'; '.join(loose)}" if loose else ""
            lines.append(f"{machine}, studied {times} times: {len(loose)} of {len(found)} verdicts changed{names}.")
    return lines


def sentence(place: Place) -> str:
    """A cell as a finding."""
    first = place[0].cell
    told = [f"{f'{label}: ' if len(place) > 1 else ''}{c.verdict}. {c.measured}" for label, _, c in place]
    differs = [f" But {v}: {_in(label, place)}{where}." for label, _, c in place for where, v in c.differs.items()]
    return f"{first.name}: {'; '.join(told)}.{''.join(differs)}"


def _in(label: str, place: Place) -> str:
    """The study's name, where there are several."""
    return f"{label}, " if len(place) > 1 else ""


def matrix(found: Sequence[Place], several: bool) -> Table:
    """The paper's rows, methods as columns; in a cell each statement with its mark, and under it what was measured."""
    table = Table("Table I, by measurement", ["", *METHODS], note=NOTE, text=True)
    for row in dict.fromkeys(place[0].cell.row for place in found):
        columns = []
        for method in METHODS:
            own = [place for place in found if (place[0].cell.row, place[0].cell.method) == (row, method)]
            columns.append([line for place in own for line in _statement(place, several)])
        table.rows.append([row, *columns])
    return table


def _statement(place: Place, several: bool) -> list[str]:
    cell = place[0].cell
    head = Link(f"{MARKS[verdict(place)]} {cell.statement}", f"#{anchor(cell.name)}")
    if not several:
        return [head, f"  {cell.brief}"]
    return [head, *(f"  {MARKS[c.verdict]} {label}: {c.brief}" for label, _, c in place)]


def _detail(place: Place, again: Mapping[str, Mapping[str, str]], root: Path) -> Detail:
    """What stands behind a cell: per study what was measured, what the verdict hangs on, and the runs."""
    first = place[0].cell
    made = Detail(f"{MARKS[verdict(place)]} {first.name}", anchor(first.name))
    for label, _, cell in place:
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
    for label, _, cell in chain.from_iterable(found):
        row = {k: v for k, v in vars(cell).items() if k not in ("runs", "elsewhere")}
        elsewhere = "; ".join(f"{where}: {v}" for where, v in cell.elsewhere.items())
        folders = " ".join(run.folder.name for run in cell.runs)
        rows.append({"study": label, **row, "elsewhere": elsewhere, "runs": folders})
    return pd.DataFrame(rows)
