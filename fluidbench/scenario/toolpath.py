"""Where the nozzle is and how much it extrudes, as a function of time: line, polyline, ring, wall, or G-code."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Positive, Vector
from .packed import Packed

Point = tuple[float, float]
USERS = {
    "start": ("line", "wall"),
    "end": ("line", "wall"),
    "points": ("polyline",),
    "center": ("ring",),
    "radius": ("ring",),
    "speeds": ("polyline",),
    "flows": ("polyline",),
    "dwell": ("line", "polyline", "ring", "wall"),
    "pause": ("line", "polyline", "ring", "wall"),
    "file": ("gcode",),
    "extrusion": ("gcode",),
    "filament": ("gcode",),
    "offset": ("gcode",),
    "moves": ("gcode",),
    "ignored": ("gcode",),
}
"""Keys that only some shapes use."""
SAME = 1e-6  # places that are one [m]
RING_CHORDS = 180  # a ring is travelled as a polygon of this many chords; its radius errs by 1.5e-4


class Toolpath(Model):
    """The path of the nozzle axis in plan, repeated for every layer; an open path is travelled back and forth. Or the
    moves of a file of G-code, layer by layer (slicer.py)."""

    kind: Literal["line", "polyline", "ring", "wall", "gcode"] = Field("line", description="shape of one layer")
    start: Point | None = Field(None, description="line, wall: first point (x, y) [m]")
    end: Point | None = Field(None, description="line, wall: last point (x, y) [m]")
    points: tuple[Point, ...] | None = Field(None, description="polyline: points (x, y) [m]")
    center: Point | None = Field(None, description="ring: centre (x, y) [m]")
    radius: Positive | None = Field(None, description="ring: radius [m]")
    speeds: tuple[Positive, ...] | None = Field(None, description="polyline: speed on each leg, instead of speed [m/s]")
    flows: tuple[NonNegative, ...] | None = Field(
        None, description="polyline: flow on each leg over the nozzle's, 0 to travel [-]"
    )
    file: str | None = Field(None, description="gcode: a file of G-code, beside the scenario")
    extrusion: Literal["filament", "volume", "nozzle"] = Field(
        "filament",
        description="gcode: what E counts: mm of filament, mm^3, or nothing: then G1 extrudes at the nozzle's",
    )
    filament: Positive | None = Field(None, description="gcode: diameter of the filament [m]; default 1.75 mm")
    offset: Vector = Field((0.0, 0.0, 0.0), description="gcode: added to its coordinates [m]")
    moves: Packed | None = Field(
        None, description="gcode: what the file says, rows of x, y, z, seconds, flow and layer; the first is the start"
    )
    ignored: tuple[str, ...] = Field((), description="gcode: lines of the file that have no effect")
    speed: NonNegative = Field(
        description="tangential speed of the nozzle [m/s]; 0 for a fixed nozzle; of G-code, the mean where it extrudes"
    )
    dwell: Positive | None = Field(None, description="speed 0: how long the fixed nozzle extrudes [s]")
    layers: Annotated[int, Field(ge=1, le=10_000)] = Field(1, description="number of layers")
    layer_height: Positive | None = Field(None, description="rise of the nozzle after each layer [m]")
    pause: NonNegative = Field(
        0.0, description="pause after each layer, without flow; at least the rise at `speed` [s]"
    )

    @model_validator(mode="after")
    def _complete(self) -> "Toolpath":
        self.refuse_idle(self.kind, USERS)
        needs = {
            "line": ("start",),
            "wall": ("start", "end"),
            "polyline": ("points",),
            "ring": ("center", "radius"),
            "gcode": ("moves",),
        }
        missing = [key for key in needs[self.kind] if getattr(self, key) is None]
        if missing:
            raise ValueError(f"a {self.kind} needs {' and '.join(missing)}")
        if self.layers > 1 and self.layer_height is None:
            raise ValueError("more than one layer needs layer_height")
        if self.speed == 0 and self.dwell is None:
            raise ValueError("a fixed nozzle (speed = 0) needs dwell, the time it extrudes")
        if self.speed > 0 and self.dwell is not None:
            raise ValueError("dwell has no effect on a nozzle that moves (speed > 0); did you mean 'pause'?")
        if self.points is not None and len(self.points) < (2 if self.speed > 0 else 1):
            raise ValueError(f"a polyline needs at least two points, got {len(self.points)}")
        if self.moves is not None:
            _check_moves(self.moves.array)
        if self.speed > 0 and self.length() == 0:
            raise ValueError("the path has no length; give end, or speed = 0 with dwell")
        self._check_legs()
        return self

    def _check_legs(self) -> None:
        """What is said of each leg of a polyline."""
        legs = 0 if self.points is None else len(self.points) - 1
        for key in ("speeds", "flows"):
            given = getattr(self, key)
            if given is not None and len(given) != legs:
                raise ValueError(f"{key}: one for each of the {legs} legs is wanted, got {len(given)}")
            if given is not None and self.speed == 0:
                raise ValueError(f"{key} has no effect on a fixed nozzle (speed = 0)")
        if self.flows is not None and not any(self.flows):
            raise ValueError("flows: none of the legs extrudes")

    def corners(self) -> np.ndarray:
        """The points of one layer, shape (n, 2) [m]; of G-code, of the longest stroke of the first."""
        if self.moves is not None:
            points = self.moves.array[longest(self.moves.array), :2]
            return points[np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 0])]
        if self.kind == "ring":
            assert self.center is not None and self.radius is not None
            angle = np.linspace(0.0, 2.0 * np.pi, RING_CHORDS + 1)
            return np.asarray(self.center) + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        if self.kind == "polyline":
            return np.asarray(self.points, dtype=float)
        return np.asarray([self.start, self.end if self.end is not None else self.start], dtype=float)

    def layer(self, backwards: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(points (n, 2) [m], time (n - 1,) [s], flow over the nozzle's (n - 1,) [-]) of one layer of a shape; a fixed
        nozzle stays at its first point."""
        corners = self.corners()
        if self.speed == 0:
            assert self.dwell is not None
            return corners[[-1, -1] if backwards else [0, 0]], np.array([self.dwell]), np.ones(1)
        ways = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        speeds = self.speed if self.speeds is None else np.asarray(self.speeds)
        flows = np.ones(len(ways)) if self.flows is None else np.asarray(self.flows)
        order = slice(None, None, -1 if backwards else 1)
        return corners[order], (ways / speeds)[order], flows[order]

    @cached_property
    def repeats(self) -> bool:
        """Whether every layer goes over the first, there or back: one stroke each, at the same places in plan."""
        if self.moves is None:
            return True
        lines = [self.moves.array[rows, :2] for rows in strokes(self.moves.array)]
        return len(lines) == self.layers and all(_same(line, lines[0]) for line in lines)

    def length(self) -> float:
        """Length of one layer [m]."""
        return float(np.linalg.norm(np.diff(self.corners(), axis=0), axis=1).sum())


def _same(line: np.ndarray, other: np.ndarray) -> bool:
    """Whether two lines go through the same points, there or back."""
    if len(line) != len(other):
        return False
    return any(bool((np.linalg.norm(way - other, axis=1) <= SAME).all()) for way in (line, line[::-1]))


def _check_moves(moves: np.ndarray) -> None:
    """Rows of x, y, z, seconds, flow and layer, as `slicer.completed` makes them."""
    if moves.ndim != 2 or moves.shape[1] != 6 or len(moves) < 2:
        raise ValueError(f"moves: rows of x, y, z, seconds, flow and layer are wanted (got shape {moves.shape})")
    if (moves[1:, 3] <= 0).any() or (moves[:, 4] < 0).any() or (np.diff(moves[:, 5]) < 0).any():
        raise ValueError("moves: seconds are positive, flows are not negative, and layers do not fall")


def strokes(moves: np.ndarray) -> list[np.ndarray]:
    """What is laid without a stop in one layer: the indices of the rows of each stroke, its start included."""
    laid = moves[1:, 4] > 0
    breaks = np.flatnonzero(~laid[1:] | ~laid[:-1] | (np.diff(moves[1:, 5]) > 0)) + 1
    parts = np.split(np.arange(len(laid)), breaks)
    return [np.arange(part[0], part[-1] + 2) for part in parts if laid[part[0]]]


def longest(moves: np.ndarray) -> np.ndarray:
    """Rows of the longest stroke of the first layer."""
    first = [rows for rows in strokes(moves) if moves[rows[-1], 5] == 0]
    return max(first, key=lambda rows: float(np.linalg.norm(np.diff(moves[rows, :2], axis=0), axis=1).sum()))


class Stroke(NamedTuple):
    """A line laid in one go, corner by corner: places in plan (n, 2) [m], distance along it (n,) [m], time (n,) [s] and
    what was extruded till then (n,), as in Track [s]."""

    points: np.ndarray
    distance: np.ndarray
    time: np.ndarray
    extruding: np.ndarray

    @property
    def fed(self) -> np.ndarray:
        """Per length of each leg, shape (n - 1,) [s/m]: times the nozzle's rate, the section that is laid."""
        return np.diff(self.extruding) / np.diff(self.distance)


@dataclass(frozen=True)
class Track:
    """A toolpath in time: knots between which position and extruded time are linear.

    time: (n,) [s]; position: (n, 3), the nozzle exit [m]; extruding: (n,), time that the nozzle's flow would have taken
    for what was extruded up to the knot [s]; layer: (n - 1,), the layer of each interval; measured: the knots of what
    beads are measured along, which is the first layer, or of G-code its longest stroke.
    """

    time: np.ndarray
    position: np.ndarray
    extruding: np.ndarray
    layer: np.ndarray
    measured: np.ndarray

    @classmethod
    def of(cls, path: Toolpath, floor: float, standoff: float) -> "Track":
        """Lay the path out in time, the nozzle exit `standoff` above the floor plus one `layer_height` a layer."""
        if path.moves is not None:
            moves = path.moves.array
            time, extruding = np.cumsum(moves[:, 3]), np.cumsum(moves[:, 3] * moves[:, 4])
            return cls(time, moves[:, :3] + [0.0, 0.0, floor], extruding, moves[1:, 5].astype(int), longest(moves))
        knots: list[tuple[float, float, float, float, float]] = []
        layers: list[int] = []
        time = extruding = 0.0
        for layer in range(path.layers):
            z = floor + standoff + layer * (path.layer_height or 0.0)
            corners, legs, flows = path.layer(backwards=layer % 2 == 1 and path.kind != "ring")
            knots.append((time, *corners[0], z, extruding))
            for corner, leg, flow in zip(corners[1:], legs, flows, strict=True):
                time, extruding = time + leg, extruding + flow * leg
                knots.append((time, *corner, z, extruding))
            layers += [layer] * (len(legs) + 1)
            if layer < path.layers - 1 and path.layer_height is not None:
                time += max(path.pause, path.layer_height / path.speed if path.speed else 0.0)
        table = np.array(knots)
        measured = np.arange(len(path.layer(backwards=False)[0]))
        return cls(table[:, 0], table[:, 1:4], table[:, 4], np.array(layers[:-1]), measured)

    @cached_property
    def stroke(self) -> "Stroke":
        """What beads are measured along."""
        rows = self.measured
        ways = np.linalg.norm(np.diff(self.position[rows, :2], axis=0), axis=1)
        rows = rows[np.concatenate([[True], ways > 0])]
        distance = np.concatenate([[0.0], np.cumsum(ways[ways > 0])])
        return Stroke(self.position[rows, :2], distance, self.time[rows], self.extruding[rows])

    @property
    def end(self) -> float:
        """Time at which extrusion ends [s]."""
        return float(self.time[-1])

    def at(self, time) -> np.ndarray:
        """Position of the nozzle exit, shape (..., 3) [m]; it rests at both ends of the track."""
        return np.stack([np.interp(time, self.time, self.position[:, axis]) for axis in range(3)], axis=-1)

    def velocity(self, time) -> np.ndarray:
        """Velocity of the nozzle while it extrudes, shape (..., 3) [m/s]; 0 during pauses and at the ends."""
        i = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        step = np.maximum(np.diff(self.time), 1e-300)[i][..., None]
        moving = (np.diff(self.extruding)[i] > 0)[..., None] & (np.asarray(time) < self.end)[..., None]
        return np.where(moving, np.diff(self.position, axis=0)[i] / step, 0.0)

    def extruded(self, time) -> np.ndarray:
        """Time that the nozzle's flow would have taken for what was extruded up to `time` [s]."""
        return np.interp(time, self.time, self.extruding)

    def release_time(self, extruding) -> np.ndarray:
        """The first time at which this much was extruded [s]: the inverse of `extruded`."""
        i = np.clip(np.searchsorted(self.extruding, extruding, side="left"), 1, len(self.time) - 1)
        return self.time[i] - (self.extruding[i] - extruding) / np.maximum(self.flow_in[i - 1], 1e-300)

    @cached_property
    def flow_in(self) -> np.ndarray:
        """Flow in each interval over the nozzle's, shape (n - 1,) [-]."""
        return np.diff(self.extruding) / np.maximum(np.diff(self.time), 1e-300)

    @cached_property
    def speed_in(self) -> np.ndarray:
        """Of the nozzle in each interval, shape (n - 1,) [m/s]."""
        return np.linalg.norm(np.diff(self.position, axis=0), axis=1) / np.maximum(np.diff(self.time), 1e-300)

    def flow(self, time) -> np.ndarray:
        """Flow over the nozzle's at `time` [-]; 0 before and after."""
        i = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        return np.where((np.asarray(time) < self.end) & (np.asarray(time) >= 0.0), self.flow_in[i], 0.0)

    def layer_at(self, time) -> np.ndarray:
        """Index of the layer being laid at `time`."""
        return self.layer[np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.layer) - 1)]
