"""The nozzle's path before anything runs: what it lays, stroke by stroke, and a picture of it."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError
from ..files import write_atomically
from ..report.figures import figure_of, png
from ..report.plot import COLOURS
from ..report.table import Table, number
from ..scenario import Scenario, Track

MOST_ROWS = 24  # strokes that a table names
ROOM, NARROWEST = 0.06, 0.3  # about the plan, and its least width, over the path's longest edge


def _track(scenario: Scenario) -> Track:
    if scenario.track is None:
        raise UserError(f"{scenario.name} has no nozzle, and so no path")
    return scenario.track


def route(scenario: Scenario) -> tuple[list[Table], list[str]]:
    """(tables of the strokes and of the whole, remarks)."""
    track, nozzle, path = _track(scenario), scenario.nozzle, scenario.toolpath
    assert nozzle is not None and path is not None
    ways = track.speed_in * np.diff(track.time)
    laid = track.strokes
    head = ["stroke", "layer", "height [mm]", "length [mm]", "time [s]", "speed [mm/s]", "section [mm²]"]
    table = Table("What is laid", head)
    for i, (first, last) in enumerate((rows[0], rows[-1]) for rows in laid[:MOST_ROWS]):
        way, time = float(ways[first:last].sum()), float(track.time[last] - track.time[first])
        volume = nozzle.rate * float(track.extruding[last] - track.extruding[first])
        height = track.position[last, 2] - scenario.domain.lower[2]
        section = number(1e6 * volume / way) if way > 0 else "-"
        numbers = (1e3 * height, 1e3 * way, time, 1e3 * way / time)
        table.rows.append([str(i + 1), str(track.layer[first] + 1), *map(number, numbers), section])
    fed = track.flow_in > 0
    whole = Table("The whole path", ["", "value", "unit"])
    spans = (f"{number(1e3 * low)} .. {number(1e3 * high)}" for low, high in _spans(track))
    for name, value, unit in (
        ("strokes", str(len(laid)), ""),
        ("layers", str(path.layers), ""),
        *((axis, span, "mm") for axis, span in zip("xyz", spans, strict=True)),
        ("laid length", number(1e3 * float(ways[fed].sum())), "mm"),
        ("travelled without flow", number(1e3 * float(ways[~fed].sum())), "mm"),
        ("volume", number(1e6 * nozzle.rate * float(track.extruding[-1])), "ml"),
        ("mean exit speed", number(1e3 * nozzle.speed), "mm/s"),
        ("flow over the mean", f"{number(track.flow_in[fed].min())} .. {number(track.flow_in.max())}", ""),
        (
            "speed of the nozzle",
            f"{number(1e3 * track.speed_in[fed].min())} .. {number(1e3 * track.speed_in.max())}",
            "mm/s",
        ),
        ("time", number(track.end), "s"),
        ("run", number(scenario.duration), "s"),
    ):
        whole.rows.append([name, value, unit])
    remarks = [f"and {len(laid) - MOST_ROWS} more strokes"] if len(laid) > MOST_ROWS else []
    if path.moves is not None:
        remarks.append(f"read from {path.file}; every move at its own F: accelerations are none of G-code")
        remarks += [f"without effect: {line}" for line in path.ignored]
    return [table, whole], remarks


def _spans(track: Track) -> list[tuple[float, float]]:
    return list(zip(track.position.min(axis=0).tolist(), track.position.max(axis=0).tolist(), strict=True))


def draw(scenario: Scenario, folder: Path) -> Path:
    """`path.png` in a folder: plan, elevation along the longer way, and what the nozzle does over time."""
    write_atomically(folder / "path.png", png(picture(scenario)))
    return folder / "path.png"


def picture(scenario: Scenario) -> Any:
    """That as a figure of matplotlib's."""
    track = _track(scenario)
    figure = figure_of(11.0, 6.0)
    plan, side, clock = figure.subplot_mosaic("AB;AC", width_ratios=[1.2, 1.0]).values()
    extent = np.ptp(track.position, axis=0)
    along = 0 if extent[0] >= extent[1] else 1
    for axes, across, up in ((plan, 0, 1), (side, along, 2)):
        _lines(axes, track, across, up)
    plan.set(title="plan: a colour a layer", xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    _frame(plan, 1e3 * track.position[:, :2])
    side.set(title="elevation", xlabel=f"{'xy'[along]} [mm]", ylabel="z [mm]")
    side.set_ylim(bottom=1e3 * scenario.domain.lower[2])
    _speeds(clock, scenario)
    for axes in (plan, side, clock):
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.ticklabel_format(useOffset=False)
    handles = [*plan.get_legend_handles_labels()[0], *clock.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)  # over no path
    return figure


def _lines(axes: Any, track: Track, across: int, up: int) -> None:
    """The path in two of its coordinates: strokes in the colour of their layer, travel dotted, and both ends."""
    where = 1e3 * track.position[:, [across, up]]
    axes.plot(*where.T, ":", color="#888888", lw=0.9, label="travel")
    for rows in track.strokes:
        axes.plot(*where[rows].T, color=COLOURS[int(track.layer[rows[0]]) % len(COLOURS)], lw=2.2 if up == 1 else 1.6)
    for row, mark, label in ((0, "o", "start"), (-1, "x", "end")):
        axes.plot(*where[row], mark, color="black", mfc="none", label=label, zorder=3, clip_on=False, ls="none")


def _frame(axes: Any, where: np.ndarray) -> None:
    """Limits with room about the points (n, 2), and a frame that is NARROWEST or more of its length wide."""
    low, high = where.min(axis=0), where.max(axis=0)
    longest = float((high - low).max()) or 1.0
    room = np.maximum(ROOM * longest, 0.5 * (NARROWEST * longest - (high - low)))
    axes.set_xlim(low[0] - room[0], high[0] + room[0])
    axes.set_ylim(low[1] - room[1], high[1] + room[1])


def _speeds(axes: Any, scenario: Scenario) -> None:
    """Of the nozzle and of what leaves it over time, from none: else what is constant is shown by its rounding."""
    track, nozzle = _track(scenario), scenario.nozzle
    assert nozzle is not None
    steps = np.repeat(track.time, 2)[1:-1]
    speeds, exits = 1e3 * track.speed_in, 1e3 * nozzle.speed * track.flow_in
    axes.plot(steps, np.repeat(speeds, 2), color=COLOURS[0], label="speed of the nozzle")
    axes.plot(steps, np.repeat(exits, 2), "--", color=COLOURS[1], label="exit speed")
    axes.set(title="speeds", xlabel="time [s]", ylabel="speed [mm/s]")
    most = float(max(speeds.max(), exits.max()))
    axes.set_ylim(-0.04 * most, 1.1 * most)  # what stands still is not hidden by the frame
