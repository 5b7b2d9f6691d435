"""The judged table as text: Markdown for a page of its own, with the evidence below, and LaTeX for a paper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..report.report import Detail
from ..report.table import Table
from . import PAPER
from .definitions import CONFIRMED, OPEN, REFUTED
from .repeat import VALIDATE

DEPENDS, LOOSE = "depends on where", "not robust"
MARKS = {CONFIRMED: "✓", REFUTED: "✗", OPEN: "?", DEPENDS: "≠", LOOSE: "±"}
WORDS = {**{v: v for v in MARKS}, OPEN: "open", DEPENDS: "depends"}  # where signs cannot be set


def markdown(table: Table, findings: Sequence[str], details: Sequence[Detail], machines: Sequence[str]) -> str:
    """The table, what is open or depends on where, and what stands behind each cell."""
    import pandas as pd

    rows = [[row[0], *("<br>".join(cell) for cell in row[1:])] for row in table.rows]
    shown = pd.DataFrame(rows, columns=pd.Index(table.head)).map(lambda cell: cell.replace("|", "\\|"))
    lines = [
        "# Table I, by measurement",
        "",
        f'The table of "{PAPER}": in each cell the paper\'s words, a mark, and what was measured.',
        "",
        shown.to_markdown(index=False, disable_numparse=True),
        "",
        f"{findings[0]} {table.note}.",
        "",
        *(f"- {line}" for line in findings[1:]),
        "",
        *(f"- {machine}" for machine in machines),
        "",
        "## Evidence",
        "",
    ]
    for detail in details:
        lines += [f"### {detail.name}", "", *(f"- {line}" for line in detail.lines)]
        again = _together(dict.fromkeys(command for _, _, command in detail.runs if command))
        lines += ["", "```sh", *again, "```"] if again else []
        lines.append("")
    return "\n".join(lines)


def _together(commands: Iterable[str]) -> list[str]:
    """Commands, those for known answers that differ in the case alone as one."""
    cases: dict[str, list[str]] = {}
    found = []
    for command in commands:
        if not command.startswith(VALIDATE):
            found.append(command)
            continue
        case, _, options = command.removeprefix(VALIDATE).partition(" ")
        cases.setdefault(options, []).append(case)
    return [*(f"{VALIDATE}{' '.join(dict.fromkeys(names))} {options}" for options, names in cases.items()), *found]


def latex(table: Table) -> str:
    """The table for a paper, with booktabs; its signs as words."""
    lines = [r"\begin{tabular}{l" + (len(table.head) - 1) * r"p{0.28\linewidth}" + "}", r"\toprule"]
    lines += [" & ".join(h.upper() for h in table.head) + r" \\", r"\midrule"]
    for row in table.rows:
        texts = [row[0], *(r" \newline ".join(map(_escaped, cell)) for cell in row[1:])]
        lines.append(" & ".join(texts) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _escaped(text: str) -> str:
    """A line with its mark, if it begins with one, as a word."""
    text = text.strip()
    for verdict, mark in MARKS.items():
        text = f"[{WORDS[verdict]}] {text[2:]}" if text.startswith(f"{mark} ") else text
    for sign, word in {**{c: f"\\{c}" for c in "%_&#$"}, ">=": r"$\geq$"}.items():
        text = text.replace(sign, word)
    return text
