"""Tables for people: the same rows in the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean, stdev
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


PAGE = 100  # columns of a table to be read


class Link(str):
    """A cell that leads somewhere on the page."""

    def __new__(cls, text: str, href: str) -> Link:
        made = super().__new__(cls, text)
        made.href = href
        return made

    href: str


@dataclass(frozen=True)
class Table:
    """Rows of formatted cells under a head; the first column names the row. A cell is a text, or several lines of it;
    with `text` it is there to be read rather than compared, and never wider than a page."""

    title: str
    head: list[str]
    rows: list[Sequence[str | list[str]]] = field(default_factory=list)
    note: str = ""
    text: bool = False


def show(console: Console, table: Table) -> None:
    """Print a table to the terminal."""
    from rich.markup import escape
    from rich.table import Table as RichTable

    wide = console.width >= 100  # on a narrow screen even names must fold
    style: Any = {"show_lines": True, "width": min(console.width, PAGE)} if table.text else {}
    shown = RichTable(title=table.title, title_justify="left", title_style="bold", **style)
    for i, head in enumerate(table.head):
        side = "left" if i == 0 or table.text else "right"
        shown.add_column(escape(head), justify=side, overflow="fold", no_wrap=i == 0 and wide and not table.text)
    for row in table.rows:
        shown.add_row(*(escape(cell if isinstance(cell, str) else "\n".join(cell)) for cell in row))
    console.print(shown)
    if table.note:
        console.print(table.note, markup=False, highlight=False)


def number(value: float) -> str:
    """Four significant digits."""
    return f"{value:.4g}"


def spread(values: Sequence[float]) -> str:
    """A mean, with its standard deviation when there are several values."""
    return number(mean(values)) if len(values) < 2 else f"{number(mean(values))} ± {stdev(values):.1g}"


UNITS = {"m": "m", "m2": "m²", "kg": "kg", "J": "J", "s": "s", "Pa": "Pa", "MiB": "MiB"}


def readable(key: str, values: Sequence[float]) -> tuple[str, float]:
    """(label, factor) under which the values of a measure read best: lengths below a metre in millimetres."""
    return in_millimetres(label(key), values)


def in_millimetres(title: str, values: Sequence[float]) -> tuple[str, float]:
    """(title, factor) under which values of a quantity read best: "x [m]" below a metre in millimetres, "x [m^2]" in
    their squares."""
    text, bracket, unit = title.partition(" [")
    factor, better = {"m]": (1e3, "mm]"), "m^2]": (1e6, "mm²]"), "m²]": (1e6, "mm²]")}.get(unit, (1.0, unit))
    finite = [abs(value) for value in values if math.isfinite(value)]
    if not finite or max(finite) >= 1.0:
        return title, 1.0
    return f"{text}{bracket}{better}", factor


def label(key: str) -> str:
    """'bead_width_m' -> 'bead width [m]'."""
    words = key.split("_")
    if words[-3:] == ["m", "per", "s"]:
        return f"{' '.join(words[:-3])} [m/s]"
    if words[-2:] == ["per", "s"] or words[-3:] == ["per", "cpu", "s"] or words[-3:] == ["per", "simulated", "s"]:
        return " ".join(words)
    if words[-1] in UNITS and len(words) > 1:
        return f"{' '.join(words[:-1])} [{UNITS[words[-1]]}]"
    return " ".join(words)
