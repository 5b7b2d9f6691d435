"""A scenario's table completed by the file of G-code that its toolpath names.

From then on it holds the moves themselves: a run needs no file, and its record says what was printed.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from . import gcode
from .track import SAME
from .units import amount

FILAMENT = 1.75e-3  # usual diameter [m]
NAMED, LONGEST = 12, 60  # line numbers of a code that are named, characters of it that are shown
MARGIN = 4.0  # nozzle diameters beside the path, and above it, where the scenario gives no domain
EXTRA = 0.1  # of the path's time that a run goes on after it, where the scenario gives no duration
FOUND = {"speed", "layers", "layer_height", "moves", "ignored"}
"""Keys of a toolpath that its file says."""


def completed(table: Any) -> Any:
    """The table with moves, layers and speeds of its toolpath's file, the nozzle's speed and height above the bed, and
    domain and duration where it has none; any other table as it is.

    Raises ValueError for a file that cannot be read, prints nothing, or contradicts the table.
    """
    path = _keys(table.get("toolpath")) if isinstance(table, dict) else {}
    if path.get("kind") != "gcode" or path.get("moves") is not None:
        return table
    nozzle = _keys(table.get("nozzle"))
    _check(path, nozzle)
    program = gcode.read(Path(str(path["file"])))
    offset = np.array([_number(value, "toolpath.offset") for value in path.get("offset", (0.0, 0.0, 0.0))])
    fed = _volumes(program, path, nozzle)
    first, last = _printed(program, fed)
    corners = program.points[first : last + 2] + offset
    seconds, fed = program.seconds[first : last + 1], fed[first : last + 1]
    gaps = corners[:, 2]  # above the bed
    laid = np.flatnonzero(_moves_flat(corners) & (fed > 0))
    if gaps[laid + 1].min() <= 0:
        raise ValueError(f"toolpath.file: it extrudes at z = {gaps[laid + 1].min():g} m, at or below the bed")
    flow = fed  # over that of the nozzle
    if path.get("extrusion") != "nozzle":
        mean = fed.sum() / seconds[fed > 0].sum()
        nozzle["exit_speed"] = float(mean / (math.pi * _number(nozzle["diameter"], "nozzle.diameter") ** 2 / 4.0))
        flow = fed / seconds / mean
    nozzle["standoff"] = float(gaps[laid[0] + 1])
    layer = _layers(gaps[1:], laid, nozzle["standoff"])
    way = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    rows = np.column_stack([corners[1:], seconds, flow, layer])
    start = [[*corners[0], 0.0, 0.0, 0.0]]
    path = path | {
        "file": Path(str(path["file"])).name,
        "moves": np.concatenate([start, rows]),
        "speed": float(way[laid].sum() / seconds[laid].sum()),
        "layers": int(layer[-1]) + 1,
        "ignored": _ignored(program, first, last),
    }
    if layer[-1]:
        heights = [gaps[1:][laid][layer[laid] == k].mean() for k in (0, layer[-1])]
        path["layer_height"] = float((heights[1] - heights[0]) / layer[-1])
    return _room(table | {"toolpath": path, "nozzle": nozzle}, corners, float(seconds.sum()))


def _keys(part: Any) -> dict[str, Any]:
    """What is given in a part of a scenario: a table, or a model made from one."""
    if isinstance(part, BaseModel):
        return part.model_dump(exclude_unset=True)
    return dict(part) if isinstance(part, dict) else {}


def _check(path: dict[str, Any], nozzle: dict[str, Any]) -> None:
    """What must be there, and what the file says itself."""
    if not path.get("file"):
        raise ValueError("toolpath.file: the name of a file of G-code is wanted")
    if given := sorted(FOUND & set(path)):
        raise ValueError(f"toolpath.{given[0]}: the file of G-code says it; take the key out")
    if "diameter" not in nozzle:
        raise ValueError("nozzle.diameter is missing")
    if "standoff" in nozzle:
        raise ValueError("nozzle.standoff: the file of G-code says it; move the whole path by toolpath.offset")
    told = [key for key in ("exit_speed", "flow_rate") if key in nozzle]
    if path.get("extrusion") == "nozzle" and not told:
        raise ValueError('nozzle.exit_speed is missing: with toolpath.extrusion = "nozzle" the file says nothing of it')
    if path.get("extrusion") != "nozzle" and told:
        raise ValueError(
            f"nozzle.{told[0]}: the E words of the file say how much is extruded; take the key out, or set "
            'toolpath.extrusion = "nozzle"'
        )
    if "filament" in path and path.get("extrusion", "filament") != "filament":
        raise ValueError('toolpath.filament has no effect unless toolpath.extrusion = "filament"')


def _number(value: Any, key: str) -> float:
    """A length as a table holds it before it is validated [m]."""
    try:
        return amount(value, "m")
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None


def _volumes(program: gcode.Program, path: dict[str, Any], nozzle: dict[str, Any]) -> np.ndarray:
    """What each move extrudes, shape (n,) [m^3]; where the nozzle alone says it, 1 for each move that prints."""
    kind = path.get("extrusion", "filament")
    if kind == "nozzle":
        return (program.prints & _moves_flat(program.points)).astype(float)
    if not program.fed.any():
        raise ValueError('toolpath.file: it has no E words; set toolpath.extrusion = "nozzle" and nozzle.exit_speed')
    if kind == "volume":
        return program.fed * program.unit**3
    diameter = _number(path.get("filament", FILAMENT), "toolpath.filament")
    return program.fed * program.unit * math.pi * diameter**2 / 4.0


def _moves_flat(points: np.ndarray) -> np.ndarray:
    """Which moves go anywhere in plan, shape (n,)."""
    return np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) > SAME


def _printed(program: gcode.Program, fed: np.ndarray) -> tuple[int, int]:
    """The first and the last move that lay anything; what is before and after is no print."""
    laying = np.flatnonzero((fed > 0) & _moves_flat(program.points))
    if not len(laying):
        raise ValueError("toolpath.file: no move of it extrudes")
    return int(laying[0]), int(laying[-1])


def _ignored(program: gcode.Program, first: int, last: int) -> tuple[str, ...]:
    """What of a file has no effect, a line for each kind."""
    found = []
    for code, lines in program.ignored.items():
        named = ", ".join(map(str, lines[:NAMED])) + (f" and {len(lines) - NAMED} more" if len(lines) > NAMED else "")
        found.append(f"{code[:LONGEST]} (line {named})")
    for many, where in ((first, "before the first"), (len(program.seconds) - 1 - last, "after the last")):
        if many:
            found.append(f"{many} move{'s' * (many > 1)} {where} that lays anything")
    return tuple(found)


def _layers(height: np.ndarray, laid: np.ndarray, gap: float) -> np.ndarray:
    """The layer of each move, shape (n,): one begins where matter is laid higher than where the present one began, by
    more than half the gap below the first."""
    layer, base, k = np.zeros(len(height), int), height[laid[0]], 0
    for i in laid:
        if height[i] > base + 0.5 * gap:
            k, base = k + 1, height[i]
        layer[i] = k
    fed = np.zeros(len(height), bool)
    fed[laid] = True
    return np.maximum.accumulate(np.where(fed, layer, 0))


def _room(table: dict[str, Any], corners: np.ndarray, seconds: float) -> dict[str, Any]:
    """Domain and duration where the table has none."""
    size = _number(table["nozzle"]["diameter"], "nozzle.diameter")
    low, high = corners.min(axis=0) - MARGIN * size, corners.max(axis=0) + MARGIN * size
    if table["nozzle"].get("tip", "none") != "none":
        high[2] += _number(table["nozzle"].get("bore", size), "nozzle.bore")
    found = dict(table)
    domain = found.get("domain")
    if domain is None or (isinstance(domain, dict) and not {"lower", "upper"} & set(domain)):
        found["domain"] = {**(domain or {}), "lower": [*low[:2].tolist(), 0.0], "upper": high.tolist()}
    return found if "duration" in found else found | {"duration": (1.0 + EXTRA) * seconds}
