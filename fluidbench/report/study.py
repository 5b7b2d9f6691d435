"""One shape for what every study shows: findings in words, tables, plots; printed, and written as page and data."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..store import write_atomically, write_parquet
from ..study.execute import Finished
from .html import environment, plotly_html, script
from .tables import Table, show
from .traces import Plot

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console

PAGE = """{% extends "base" %}{% block body %}<p>{{ subtitle }}</p>
<h2>Findings</h2><ul>{% for line in findings %}<li>{{ line }}</li>{% endfor %}</ul>
{% for table in tables %}<h2 id="table-{{ loop.index }}">{{ table.title }}</h2>
{{ rows(table) }}
{% if table.note %}<p>{{ table.note }}</p>{% endif %}{% endfor %}
{% if plots %}<h2>Plots</h2>
<div class="grid">{% for plot in plots %}<div>{{ plot }}</div>{% endfor %}</div>{% endif %}
{% if runs %}<h2>Runs</h2>
{% for name, links in runs.items() %}<details{% if runs|length == 1 %} open{% endif %}><summary>{{ name }}</summary>
<ul id="{{ anchor(name) }}">
{% for label, path in links %}<li><a href="{{ path }}">{{ label }}</a></li>{% endfor %}</ul></details>
{% endfor %}{% endif %}
<p>{{ machine }}</p>{% endblock %}
"""


Runs = dict[str, list[tuple[str, str]]]


@dataclass
class Report:
    """What a study found; `data` holds one row an experiment, `runs` the records behind it by heading."""

    verb: str
    title: str
    subtitle: str
    findings: list[str]
    tables: list[Table]
    data: pd.DataFrame
    plots: list[Plot] = field(default_factory=list)
    runs: Runs = field(default_factory=dict)
    machine: str = ""


def anchor(name: str) -> str:
    """A heading as an address within the page."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def record_link(run: Finished, root: Path, label: str = "") -> tuple[str, str]:
    """(label, path) of a run's record."""
    record = run.record
    label = (
        label
        or f"{record['scenario']}, {run.label}, d = {1e3 * record.get('spacing_m', 0):.3g} mm: {record['verdict']}"
    )
    return label, f"{run.folder.relative_to(root).as_posix()}/record.json"


def publish(report: Report, root: Path, console: Console) -> Path:
    """Print the tables and findings; write VERB.parquet, VERB.json, a PNG for each plot and report.html."""
    from markupsafe import Markup

    from .figures import draw

    write_parquet(root / f"{report.verb}.parquet", report.data)
    rows = json.loads(str(report.data.to_json(orient="records")))
    write_atomically(root / f"{report.verb}.json", json.dumps({"findings": report.findings, "rows": rows}, indent=1))
    for plot in report.plots:
        draw(plot, root)
    page = environment({"page": PAGE}).get_template("page").render(
        title=report.title, subtitle=report.subtitle, findings=report.findings, tables=report.tables, script=script(),
        plots=[Markup(plotly_html(plot)) for plot in report.plots], runs=report.runs, anchor=anchor,
        machine=report.machine,
    )  # fmt: skip
    write_atomically(root / "report.html", page)
    for table in report.tables:
        show(console, table)
    for line in report.findings:
        console.print(f"- {line}", markup=False, highlight=False)
    console.print(f"report: {root / 'report.html'}", markup=False, highlight=False, soft_wrap=True)
    return root / "report.html"
