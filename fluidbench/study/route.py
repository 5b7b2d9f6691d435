"""The nozzle's path before anything runs: what it lays, stroke by stroke, and a picture of it."""

from pathlib import Path

import numpy as np

from ..errors import UserError
from ..files import write_atomically
from ..report.figures import figure_of, png
from ..report.plot import COLOURS
from ..report.table import Table, number
from ..scenario import Scenario, Track

MOST_ROWS = 24  # strokes that a table names


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
    """`path.png` in a folder: plan, elevation, and what the nozzle does over time."""
    track, nozzle = _track(scenario), scenario.nozzle
    assert nozzle is not None
    figure = figure_of(11.0, 6.0)
    plan, side, clock = figure.subplot_mosaic("AB;AC", width_ratios=[1.2, 1.0]).values()
    where, times = 1e3 * track.position, track.time
    for axes, up in ((plan, 1), (side, 2)):
        axes.plot(where[:, 0], where[:, up], ":", color="#888888", lw=0.9, label="travel")
        for rows in track.strokes:
            layer = int(track.layer[rows[0]])
            axes.plot(where[rows, 0], where[rows, up], color=COLOURS[layer % len(COLOURS)], lw=2.2 if up == 1 else 1.6)
    plan.plot(*where[0, :2], "o", color="black", mfc="none", label="start")
    plan.plot(*where[-1, :2], "x", color="black", label="end")
    plan.set(title="plan: a colour a layer", xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    plan.legend(frameon=False, loc="best")
    side.set(title="elevation", xlabel="x [mm]", ylabel="z [mm]")
    side.set_ylim(bottom=1e3 * scenario.domain.lower[2])
    steps = np.repeat(times, 2)[1:-1]
    clock.plot(steps, np.repeat(1e3 * track.speed_in, 2), color=COLOURS[0], label="nozzle")
    clock.plot(steps, np.repeat(1e3 * nozzle.speed * track.flow_in, 2), color=COLOURS[1], label="exit")
    clock.set(title="speeds", xlabel="time [s]", ylabel="speed [mm/s]")
    clock.legend(frameon=False)
    for axes in (plan, side, clock):
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    write_atomically(folder / "path.png", png(figure))
    return folder / "path.png"
