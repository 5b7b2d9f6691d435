"""Pages: one self-contained file each, readable without a network; the templates lie beside this file."""

from __future__ import annotations

import re
from base64 import b64encode
from typing import TYPE_CHECKING, Any

import numpy as np

from .plot import FADED, Cloud, Plot, Trace
from .table import Table

if TYPE_CHECKING:
    from jinja2 import Environment

    from .report import Report


PIXELS = 260.0  # that the longest edge of a cloud takes


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

    def drawn(figures: list[Any]) -> list[Markup]:
        shape = {"full_html": False, "include_plotlyjs": False, "default_width": "100%", "default_height": "100%"}
        config = {"displaylogo": False, "responsive": True}
        return [Markup(figure.to_html(config=config, **shape)) for figure in figures]

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
            plots=drawn([interactive(plot) for plot in report.plots]),
            clouds=drawn([turning(cloud) for cloud in report.clouds]),
            sections=[(section, drawn([interactive(plot) for plot in section.plots])) for section in report.sections],
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
                name=trace.label,
                line={"color": trace.colour, "dash": dash},
                legendgroup=trace.colour,
                showlegend=bool(trace.label),
                error_y=None if trace.spread is None else {"array": trace.spread},
                opacity=FADED if trace.faded else 1.0,
                **({"mode": mode} | _named(plot, trace)),
            )
    for name, i in plot.key.items():  # an entry of the legend that has no points
        figure.add_scatter(x=[None], y=[None], mode="markers", name=f"{i} {name}", marker={"opacity": 0})
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


def _named(plot: Plot, trace: Trace) -> dict[str, Any]:
    """Of points with names: their numbers beside them, and the names for whoever points at them."""
    if trace.names is None:
        return {}
    numbers = [str(plot.key[name]) for name in trace.names]
    beside = {"text": numbers, "textposition": "top right", "textfont": {"color": trace.colour, "size": 10}}
    return {"mode": "markers+text", "hovertext": trace.names, **beside}


def turning(cloud: Cloud) -> Any:
    """A cloud as a plotly figure that can be turned and zoomed, to scale."""
    import plotly.graph_objects as go

    x, y, z = cloud.position.T
    edges = [max(float(np.ptp(axis)), cloud.size) for axis in (x, y, z)]
    longest = max(edges)
    low, high = cloud.limits
    marker = {
        "size": float(np.clip(PIXELS * cloud.size / longest, 2.0, 14.0)),
        "color": cloud.value.tolist(),
        "colorscale": "Viridis",
        "cmin": low,
        "cmax": high,
        "colorbar": {"title": {"text": cloud.legend}, "thickness": 10, "len": 0.6, "orientation": "h", "y": -0.1},
    }
    figure = go.Figure(
        go.Scatter3d(x=x.tolist(), y=y.tolist(), z=z.tolist(), mode="markers", marker=marker, hoverinfo="skip")
    )
    away = 0.8 * longest / float(np.prod(edges)) ** (1 / 3)  # plotly scales the box to a volume of one
    titles: dict[str, Any] = {f"{name}axis": {"title": f"{name} [mm]", "showbackground": name == "z"} for name in "xyz"}
    camera = {"eye": {"x": 0.35 * away, "y": -1.5 * away, "z": 0.7 * away}}
    figure.update_layout(
        title={"text": cloud.title, "font": {"size": 13}},
        scene={"aspectmode": "data", "camera": camera, **titles},
        margin={"l": 0, "r": 0, "t": 40, "b": 0},
        modebar={"orientation": "v"},
    )
    return figure
