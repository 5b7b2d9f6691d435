"""The path of the nozzle: a line, polyline, ring or wall, or the moves of a file of G-code."""

from typing import Annotated, Literal

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
        elif self.speed > 0 and self.length() == 0:
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
        """The points of one layer of a shape, (n, 2) [m]."""
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

    def length(self) -> float:
        """Length of one layer of a shape [m]."""
        return float(np.linalg.norm(np.diff(self.corners(), axis=0), axis=1).sum())


def _check_moves(moves: np.ndarray) -> None:
    """Rows of x, y, z, seconds, flow and layer, as `slicer.completed` makes them."""
    if moves.ndim != 2 or moves.shape[1] != 6 or len(moves) < 2:
        raise ValueError(f"moves: rows of x, y, z, seconds, flow and layer are wanted (got shape {moves.shape})")
    if (moves[1:, 3] <= 0).any() or (moves[:, 4] < 0).any() or (np.diff(moves[:, 5]) < 0).any():
        raise ValueError("moves: seconds are positive, flows are not negative, and layers do not fall")
    flat = np.linalg.norm(np.diff(moves[:, :2], axis=0), axis=1) > 0
    if not (flat & (moves[1:, 4] > 0) & (moves[1:, 5] == 0)).any():
        raise ValueError("moves: none of layer 0 lays anything")
