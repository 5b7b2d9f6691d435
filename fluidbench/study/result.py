"""What every verb returns: a table, figures, the runs behind them, and a way to keep or show them."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import Obstacle
from ..report.report import Report, tell, write
from ..runs.record import Run
from ..runs.store import Store

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console


@dataclass(repr=False)
class Result:
    """A study that has ended.

    `missing` names what it needed and has nothing of, one line each; `ok` is whether it says what it was asked for;
    `kept`: it was concluded from records that were kept, and the runs' own folders are elsewhere.
    """

    report: Report
    root: Path
    runs: list[Run] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    ok: bool = True
    keeper: Any = None  # keeps the folder of the runs as long as this is held
    kept: bool = field(default=False, kw_only=True)

    @property
    def table(self) -> pd.DataFrame:
        """One row a run, a trial, a point: whatever the verb counts; units in the columns' names."""
        return self.report.data

    @property
    def findings(self) -> list[str]:
        """What it comes to, in sentences."""
        return self.report.findings

    @property
    def figures(self) -> dict[str, Any]:
        """Plotly figures by name."""
        from ..report.page import interactive

        return {plot.name: interactive(plot) for plot in self.report.every_plot()}

    def save(self, folder: str | Path | None = None) -> Path:
        """Write what the command line writes (tables, pictures, page) beside the runs, which are copied where they lie
        elsewhere; returns the page's path."""
        target = self.root if folder is None else Store(Path(folder).expanduser().absolute()).root
        try:
            if not self.kept and target.resolve() != self.root.resolve():
                for run in self.runs:
                    shutil.copytree(run.folder, target / run.folder.relative_to(self.root), dirs_exist_ok=True)
        except (OSError, shutil.Error) as error:
            raise Obstacle(f"cannot copy the runs to {target}: {getattr(error, 'strerror', None) or error}") from None
        if not self.kept:
            self.keep(target)
        return write(self.report, target, pictures=not self.kept)

    def keep(self, folder: Path) -> None:
        """Write what is needed to conclude again without the particles, where the verb can."""

    def show(self, console: Console | None = None) -> None:
        """Print tables and findings."""
        from rich.console import Console

        tell(self.report, console or Console())

    def __repr__(self) -> str:
        import io

        from rich.console import Console

        text = io.StringIO()
        tell(self.report, Console(file=text, width=120))
        return f"{self.report.title}\n{text.getvalue()}"

    def _repr_html_(self) -> str:
        """For notebooks: tables and findings; figures are in `figures`."""
        from html import escape

        from ..report.page import table_html

        lines = [*self.report.alarms, *self.report.failures, *self.findings]
        tables = "".join(
            f"<h4>{escape(t.title)}</h4>{table_html(t)}<p>{escape(t.note)}</p>" for t in self.report.tables
        )
        listed = "".join(f"<li>{escape(line)}</li>" for line in lines)
        return f"<h3>{escape(self.report.title)}</h3>{tables}<ul>{listed}</ul>"
