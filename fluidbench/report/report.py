"""One shape for what every study shows, and the one path that publishes it: terminal, page, parquet, CSV, JSON, PNG."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import write_atomically, write_parquet
from ..runs.record import Run
from ..runs.store import RECORD
from .plot import Cloud, Plot
from .table import Table, show

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console

Runs = dict[str, list[tuple[str, str]]]  # links to records by heading


@dataclass(frozen=True)
class Image:
    """A picture that no plot is; `draw` makes it, as PNG. One that `opens` the page stands before its tables."""

    name: str
    title: str
    alt: str
    draw: Callable[[], bytes]
    opens: bool = False


@dataclass
class Detail:
    """A part of a page that unfolds: lines of text, and runs with what links to their records, where those are there,
    and the commands that make them again."""

    name: str
    anchor: str
    lines: list[str] = field(default_factory=list)
    runs: list[tuple[str, str, str]] = field(default_factory=list)  # label, path or "", command or ""

    def add_run(self, run: Run, root: Path, command: str = "") -> None:
        """A run, with the command that makes it again."""
        label, path = record_link(run, root)
        self.runs.append((label, path if (root / path).exists() else "", command))


@dataclass
class Section:
    """A part of a page with a table and plots of its own."""

    name: str
    title: str
    text: str
    table: Table
    plots: list[Plot] = field(default_factory=list)
    alarms: list[str] = field(default_factory=list)


@dataclass
class Report:
    """What a study found. `data` holds one row an experiment; `files` is more text to write beside, by name."""

    verb: str
    title: str
    subtitle: str
    findings: list[str]
    tables: list[Table]
    data: pd.DataFrame
    plots: list[Plot] = field(default_factory=list)
    runs: Runs = field(default_factory=dict)
    machine: str = ""
    alarms: list[str] = field(default_factory=list)  # what must not be overlooked
    failures: list[str] = field(default_factory=list)  # runs that are not results, with advice
    notes: list[str] = field(default_factory=list)
    images: list[Image] = field(default_factory=list)
    clouds: list[Cloud] = field(default_factory=list)  # on the page alone
    sections: list[Section] = field(default_factory=list)
    details: list[Detail] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    prefix: str = ""  # of the names of page and pictures, where the folder belongs to another study

    @property
    def page(self) -> str:
        """The name of the page."""
        return f"{self.prefix.rstrip('-')}.html" if self.prefix else "report.html"

    def every_plot(self) -> list[Plot]:
        return [*self.plots, *(plot for section in self.sections for plot in section.plots)]


def record_link(run: Run, root: Path, label: str = "") -> tuple[str, str]:
    """(label, path) of a run's record."""
    folder = run.folder.relative_to(root) if run.folder.is_relative_to(root) else run.folder
    return label or f"{run.name}: {run.verdict}", f"{folder.as_posix()}/{RECORD}"


def machine_of(runs: Iterable[Run]) -> str:
    """What the first run that says so was made on, in words."""
    first = next((run.record.machine for run in runs if run.record.machine), {})
    return "; ".join(f"{key} {value}" for key, value in first.items())


def write(report: Report, root: Path, pictures: bool = True) -> Path:
    """Write VERB.parquet, VERB.csv, VERB.json, a PNG for each image and, where `pictures` are wanted, each plot, and
    the page; returns the page."""
    from .figures import draw
    from .page import page

    write_parquet(root / f"{report.verb}.parquet", report.data)
    write_atomically(root / f"{report.verb}.csv", report.data.to_csv(index=False))
    rows = json.loads(str(report.data.to_json(orient="records")))
    write_atomically(root / f"{report.verb}.json", json.dumps({"findings": report.findings, "rows": rows}, indent=1))
    for name, text in report.files.items():
        write_atomically(root / name, text)
    for plot in report.every_plot() if pictures else []:
        write_atomically(root / f"{report.prefix}{plot.name}.png", draw(plot))
    images = {image.name: image.draw() for image in report.images}
    for name, data in images.items():
        write_atomically(root / f"{report.prefix}{name}.png", data)
    write_atomically(root / report.page, page(report, images))
    return root / report.page


def tell(report: Report, console: Console) -> None:
    """Print what people read: tables, alarms, failures, findings."""
    for table in report.tables:
        show(console, table)
    for line in [*report.alarms, *report.failures]:
        console.print(line, markup=False)
    for line in report.findings:
        console.print(f"- {line}", markup=False, highlight=False)
