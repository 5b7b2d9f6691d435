"""What `compare` and `run` show: tables in the terminal; figures, tables and one page in the folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..store import write_atomically, write_parquet
from ..study.compare import tidy
from ..study.execute import ADVICE, Finished
from .figures import draw, draw_views
from .html import write_page
from .tables import against_reference, backends, costs, failed_prints, fidelity, show, successes
from .traces import plots

if TYPE_CHECKING:
    from rich.console import Console


def publish(results: Sequence[Finished], root: Path, console: Console, label: str) -> Path:
    """Show results, and write LABEL.parquet, LABEL.csv, figures and the page. `compare` has the folder's report.html;
    a `run` in the same folder has files of its own, under its label."""
    table = tidy(results)
    write_parquet(root / f"{label}.parquet", table)
    write_atomically(root / f"{label}.csv", table.to_csv(index=False))
    made = (fidelity(results), successes(results), against_reference(results), costs(results), backends(results))
    tables = [table for table in made if table is not None]
    prefix = "" if label == "compare" else f"{label}-"
    views = draw_views(results, root, prefix)
    drawn = plots(results)
    for plot in drawn:
        draw(plot, root, prefix)
    page = write_page(results, tables, drawn, views, root / ("report.html" if not prefix else f"{label}.html"))
    for table in tables:
        show(console, table)
    for line in failed_prints(results):
        console.print(line, markup=False)
    for result in results:
        if not result.ok:
            advice = ADVICE.get(result.verdict, "")
            console.print(f"{result.label}: {result.verdict}: {result.reason}; {advice}", markup=False)
    console.print(f"report: {page}", markup=False, highlight=False, soft_wrap=True)
    return page
