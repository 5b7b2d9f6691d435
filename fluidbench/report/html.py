"""One self-contained page: tables, interactive plots, views; readable without a network."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..scenario import Scenario
from ..store import write_atomically
from ..study.execute import ADVICE, Finished
from .tables import Table, failed_prints
from .traces import Plot, run_files

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

BASE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 68rem; padding: 0 1rem; color: #1b1b1b; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
table { border-collapse: collapse; margin: .6rem 0; display: block; overflow-x: auto; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid #ddd; text-align: right; }
th:first-child, td:first-child { text-align: left; } thead th { border-bottom: 2px solid #888; }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(28rem, 1fr)); gap: 1rem; }
.bad { color: #a40000; } img { max-width: 100%; }
code { background: #f3f3f3; padding: 0 .25rem; } li { margin: .2rem 0; }
</style>{{ script }}</head><body>
<h1>{{ title }}</h1>
{% block body %}{% endblock %}
</body></html>
"""
ROWS = """{% macro rows(table) %}<table><thead><tr>
{%- for cell in table.head %}<th>{{ cell }}</th>{% endfor %}</tr></thead><tbody>
{% for row in table.rows %}<tr>{% for cell in row %}<td>{% if cell.href %}<a href="{{ cell.href }}">{{ cell }}</a>
{%- else %}{{ cell }}{% endif %}</td>
{%- endfor %}</tr>{% endfor %}</tbody></table>
{%- endmacro %}"""
COMPARE = """{% extends "base" %}{% block body %}<p>{{ subtitle }}</p>
{% for line in prints %}<p class="bad">{{ line }}</p>{% endfor %}
{% for table in tables %}<h2>{{ table.title }}</h2>
{{ rows(table) }}
{% if table.note %}<p>{{ table.note }}</p>{% endif %}{% endfor %}
{% if failures %}<h2>Runs that are not results</h2><ul>
{% for line in failures %}<li class="bad">{{ line }}</li>{% endfor %}</ul>{% endif %}
{% if notes %}<h2>What a method only approximates</h2><ul>
{% for line in notes %}<li>{{ line }}</li>{% endfor %}</ul>{% endif %}
{% if views %}<h2>Views at the end</h2>
<img alt="side and top views of every method" src="data:image/png;base64,{{ views }}">{% endif %}
<h2>Plots</h2><div class="grid">{% for plot in plots %}<div>{{ plot }}</div>{% endfor %}</div>
<h2>Records</h2><ul>{% for label, path in files %}<li><a href="{{ path }}">{{ label }}</a></li>{% endfor %}</ul>
<p>{{ machine }}</p>{% endblock %}
"""


def environment(pages: dict[str, str]) -> Environment:
    """Templates that may extend "base" and use the macro `rows(table)`."""
    from jinja2 import DictLoader
    from jinja2 import Environment as Templates

    made = Templates(autoescape=True, loader=DictLoader({"base": BASE, "rows": ROWS, **pages}))
    made.globals["rows"] = vars(made.get_template("rows").module)["rows"]
    return made


def script() -> Markup:
    """plotly.js, so that the page needs no network."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    return Markup(f"<script>{get_plotlyjs()}</script>")


def plotly_html(plot: Plot) -> str:
    """An interactive plot as a piece of HTML."""
    import plotly.graph_objects as go

    figure = go.Figure()
    for trace in plot.traces:
        if trace.style == "bar":
            figure.add_bar(x=trace.x, y=trace.y, name=trace.label, marker_color=trace.colour, showlegend=False)
        else:
            mode = {"points": "markers", "line+points": "lines+markers"}.get(trace.style, "lines")
            dash = {"dashed": "dash", "dotted": "dot"}.get(trace.style, "solid")
            figure.add_scatter(
                x=trace.x, y=trace.y, mode=mode, name=trace.label, line={"color": trace.colour, "dash": dash},
                legendgroup=trace.colour, showlegend=bool(trace.label),
            )  # fmt: skip
    figure.update_layout(
        title=plot.title, xaxis_title=plot.x, yaxis_title=plot.y, template="plotly_white", height=360,
        margin={"l": 60, "r": 20, "t": 50, "b": 50},
    )  # fmt: skip
    if plot.log:
        figure.update_xaxes(type="log")
        figure.update_yaxes(type="log")
    if plot.equal:
        figure.update_yaxes(scaleanchor="x", scaleratio=1)
    return figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False})


def write_page(
    results: Sequence[Finished], tables: Sequence[Table], drawn: Sequence[Plot], views: Path | None, path: Path
) -> Path:
    """Write the page of a comparison, beside what it links to."""
    from markupsafe import Markup

    first: dict[str, Any] = next((r.record for r in results if "input" in r.record), results[0].record)
    scenario = Scenario.model_validate(first["input"]) if "input" in first else None
    machine = first.get("machine", {})
    page = environment({"page": COMPARE}).get_template("page").render(
        title=f"fluidbench compare: {first['scenario']}",
        subtitle=scenario.title if scenario is not None else "",
        script=script(),
        tables=tables,
        failures=[
            f"{r.label}: {(v := r.record['verdict'])}: {r.record.get('reason', '')}; {ADVICE.get(v, '')}"
            for r in results if not r.ok
        ],
        prints=failed_prints(results),
        notes=[f"{r.label}: {line}" for r in results if r.record["repeat"] == 0
               for line in r.record.get("approximations", [])],
        views=base64.b64encode(views.read_bytes()).decode() if views is not None else "",
        plots=[Markup(plotly_html(plot)) for plot in drawn],
        files=run_files(results, path.parent),
        machine="; ".join(f"{key} {value}" for key, value in machine.items()),
    )  # fmt: skip
    write_atomically(path, page)
    return path
