"""The plots of a comparison: beads along and across the path, measures over time, cost."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ..measure.ledger import bead_of, deposit_of
from ..measure.reference import DoesNotApply, martin_moyce
from ..report.plot import Plot, Trace, colour
from ..report.table import in_millimetres
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.measured import Measured
from .compare_measured import points_along


def plots(results: Sequence[Run], measured: Sequence[Measured] = ()) -> list[Plot]:
    """Every plot that the scenario gives rise to: of completed runs, with what was `measured` along the path."""
    done = [r for r in results if r.ok and r.record.repeat == 0]
    if not done:
        return []
    scenario = done[0].scenario
    beads = _bead_plots(done, scenario, measured) if scenario.toolpath is not None else []
    return [p for p in [*beads, *_series_plots(done, scenario), *_cost_plots(results)] if p.traces]


def _bead_plots(done: Sequence[Run], scenario: Scenario, measured: Sequence[Measured]) -> list[Plot]:
    """Cross-sections over one another, width and height along the path."""
    section = Plot(
        "cross_section", "cross-section at the middle of the path", "across the path [mm]", "height [mm]", equal=True
    )
    width = Plot("width", "bead width along the path", "distance along the path [mm]", "width [mm]")
    height = Plot("height", "bead height along the path", "distance along the path [mm]", "height [mm]")
    for result in done:
        frame = result.frame()
        bead = bead_of(frame, deposit_of(frame, scenario), scenario)
        if bead is None:
            continue
        for i, outline in enumerate(outlines(bead.middle.across, bead.middle.up, bead.middle.fill)):
            label = result.label if i == 0 else ""
            xs, ys = (1e3 * outline).T.tolist()
            section.traces.append(Trace(label, xs, ys, colour=colour(result.label)))
        along = (1e3 * bead.station).tolist()
        width.traces.append(Trace(result.label, along, (1e3 * bead.width).tolist(), colour=colour(result.label)))
        height.traces.append(Trace(result.label, along, (1e3 * bead.height).tolist(), colour=colour(result.label)))
    for plot in (width, height):
        plot.traces.extend(points_along(plot.name, measured))
    return [section, width, height]


def outlines(across: np.ndarray, up: np.ndarray, fill: np.ndarray) -> list[np.ndarray]:
    """Contours of half filling, longest first, each (n, 2) [m]."""
    import contourpy

    lines = contourpy.contour_generator(across, up, fill.T).lines(0.5)
    return sorted((np.asarray(line) for line in lines if len(line) > 8), key=len, reverse=True)


def _series_plots(done: Sequence[Run], scenario: Scenario) -> list[Plot]:
    """Measures over time, with the published points where there are some."""
    wanted = {
        "front_x_m": ("front", "front position", "front [m]"),
        "slump": ("slump", "slump", "slump s' [-]"),
        "top_m": ("top", "highest point of the deposit", "height [m]"),
        "kinetic_energy_J": ("kinetic", "kinetic energy", "energy [J]"),
    }
    found = []
    for column, (name, title, axis) in wanted.items():
        own = {result.label: result.series for result in done if column in result.series}
        axis, factor = in_millimetres(axis, [float(np.abs(series[column]).max()) for series in own.values()])
        plot = Plot(name, title, "time [s]", axis)
        for label, series in own.items():
            ys = (factor * series[column]).tolist()
            plot.traces.append(Trace(label, series["time_s"].tolist(), ys, colour=colour(label)))
        if column == "front_x_m" and scenario.reference == "martin_moyce_front" and plot.traces:
            with suppress(DoesNotApply):  # said beside the table of references
                plot.traces.append(_martin_moyce(scenario, factor))
        found.append(plot)
    return found


def _martin_moyce(scenario: Scenario, factor: float) -> Trace:
    """The published points, in the plot's unit, `factor` times metres."""
    a, rate, data = martin_moyce(scenario)
    clock = (data["T"] / rate).tolist()
    return Trace("Martin & Moyce 1952 (gate clock)", clock, (factor * a * data["Z"]).tolist(), style="points")


def _cost_plots(results: Sequence[Run]) -> list[Plot]:
    """What each method cost; several repeats give several bars."""
    bars = (
        ("wall_per_simulated_s", "cost", "wall time per simulated second", "wall s / simulated s"),
        ("particle_substeps_per_s", "throughput", "particle-substeps per second", "1 / s"),
        ("mean_dt_s", "dt", "mean time step", "dt [s]"),
    )
    done = [r for r in results if r.ok]
    found = []
    for key, name, title, axis in bars:
        plot = Plot(name, title, "", axis)
        for result in done:
            tag = result.label + (f" #{result.record.repeat + 1}" if result.record.repeat else "")
            plot.traces.append(Trace(tag, [tag], [getattr(result.cost, key)], "bar", colour(result.label)))
        found.append(plot)
    return found
