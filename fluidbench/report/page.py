"""Pages: one self-contained file each, readable without a network; the templates lie beside this file."""

from __future__ import annotations

import re
from base64 import b64encode
from typing import TYPE_CHECKING, Any

from .plot import Plot
from .table import Table

if TYPE_CHECKING:
    from jinja2 import Environment

    from .report import Report


def environment() -> Environment:
    """The package's templates, with the macro `rows(table)` and `anchor(name)` at hand."""
    from jinja2 import Environment as Templates
    from jinja2 import PackageLoader

    made = Templates(autoescape=True, loader=PackageLoader("fluidbench.report"))
    made.globals["rows"] = vars(made.get_template("rows.html").module)["rows"]
    made.globals["anchor"] = anchor
    return made


def anchor(name: str) -> str:
    """A heading as an address within the page."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def page(report: Report, images: dict[str, bytes]) -> str:
    """A report as a page; `images` are its pictures by name, as PNG."""
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    def drawn(plots: list[Plot]) -> list[Markup]:
        shape = {"full_html": False, "include_plotlyjs": False, "default_width": "100%", "default_height": "100%"}
        config = {"displaylogo": False, "responsive": True}
        return [Markup(interactive(p).to_html(config=config, **shape)) for p in plots]

    lists = [
        ("Runs that are not results", report.failures, "bad"),
        ("What a method only approximates", report.notes, ""),
    ]
    return (
        environment()
        .get_template("page.html")
        .render(
            report=report,
            script=Markup(f"<script>{get_plotlyjs()}</script>"),
            lists=[item for item in lists if item[1]],
            images=[(image, b64encode(images[image.name]).decode()) for image in report.images],
            plots=drawn(report.plots),
            sections=[(section, drawn(section.plots)) for section in report.sections],
        )
    )


def table_html(table: Table) -> str:
    """A table as a piece of HTML."""
    return str(environment().globals["rows"](table))


def interactive(plot: Plot) -> Any:
    """A plot as a plotly figure."""
    import plotly.graph_objects as go

    figure = go.Figure()
    for trace in plot.traces:
        if trace.style == "bar":
            figure.add_bar(x=trace.x, y=trace.y, name=trace.label, marker_color=trace.colour, showlegend=False)
        else:
            mode = {"points": "markers", "line+points": "lines+markers"}.get(trace.style, "lines")
            dash = {"dashed": "dash", "dotted": "dot"}.get(trace.style, "solid")
            figure.add_scatter(
                x=trace.x,
                y=trace.y,
                mode=mode,
                name=trace.label,
                line={"color": trace.colour, "dash": dash},
                legendgroup=trace.colour,
                showlegend=bool(trace.label),
                error_y=None if trace.spread is None else {"array": trace.spread},
            )
    figure.update_layout(
        title=plot.title,
        xaxis_title=plot.x,
        yaxis_title=plot.y,
        template="plotly_white",
        autosize=True,
        margin={"l": 60, "r": 40, "t": 40, "b": 50},
        legend={"orientation": "h", "yanchor": "top", "y": -0.22},
        modebar={"orientation": "v"},  # beside the plot, not over its title
    )
    if plot.log:
        figure.update_xaxes(type="log")
        figure.update_yaxes(type="log")
    if plot.equal:
        figure.update_yaxes(scaleanchor="x", scaleratio=1)
    return figure
