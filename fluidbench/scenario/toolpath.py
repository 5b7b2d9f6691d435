"""Where the nozzle is and whether it extrudes, as a function of time: line, polyline, ring, wall."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Positive

Point = tuple[float, float]
USERS = {
    "start": ("line", "wall"),
    "end": ("line", "wall"),
    "points": ("polyline",),
    "center": ("ring",),
    "radius": ("ring",),
}
"""Keys that only some shapes use."""
RING_CHORDS = 180  # a ring is travelled as a polygon of this many chords; its radius errs by 1.5e-4


class Toolpath(Model):
    """The path of the nozzle axis in plan, repeated for every layer; an open path is travelled back and forth."""

    kind: Literal["line", "polyline", "ring", "wall"] = Field("line", description="shape of one layer")
    start: Point | None = Field(None, description="line, wall: first point (x, y) [m]")
    end: Point | None = Field(None, description="line, wall: last point (x, y) [m]")
    points: tuple[Point, ...] | None = Field(None, description="polyline: points (x, y) [m]")
    center: Point | None = Field(None, description="ring: centre (x, y) [m]")
    radius: Positive | None = Field(None, description="ring: radius [m]")
    speed: NonNegative = Field(description="tangential speed of the nozzle [m/s]; 0 for a fixed nozzle")
    dwell: Positive | None = Field(None, description="speed 0: how long the fixed nozzle extrudes [s]")
    layers: Annotated[int, Field(ge=1, le=10_000)] = Field(1, description="number of layers")
    layer_height: Positive | None = Field(None, description="rise of the nozzle after each layer [m]")
    pause: NonNegative = Field(
        0.0, description="pause after each layer, without flow; at least the rise at `speed` [s]"
    )

    @model_validator(mode="after")
    def _complete(self) -> "Toolpath":
        self.refuse_idle(self.kind, USERS)
        needs = {"line": ("start",), "wall": ("start", "end"), "polyline": ("points",), "ring": ("center", "radius")}
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
        if self.speed > 0 and self.length() == 0:
            raise ValueError("the path has no length; give end, or speed = 0 with dwell")
        return self

    def corners(self) -> np.ndarray:
        """The points of one layer, shape (n, 2) [m]."""
        if self.kind == "ring":
            assert self.center is not None and self.radius is not None
            angle = np.linspace(0.0, 2.0 * np.pi, RING_CHORDS + 1)
            return np.asarray(self.center) + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        if self.kind == "polyline":
            return np.asarray(self.points, dtype=float)
        return np.asarray([self.start, self.end if self.end is not None else self.start], dtype=float)

    def length(self) -> float:
        """Length of one layer [m]."""
        return float(np.linalg.norm(np.diff(self.corners(), axis=0), axis=1).sum())


@dataclass(frozen=True)
class Track:
    """A toolpath in time: knots between which position and extruded time are linear.

    time: (n,) [s]; position: (n, 3), the nozzle exit [m]; extruding: (n,), time spent extruding up to the knot [s];
    layer: (n - 1,), the layer of each interval.
    """

    time: np.ndarray
    position: np.ndarray
    extruding: np.ndarray
    layer: np.ndarray

    @classmethod
    def of(cls, path: Toolpath, floor: float, standoff: float) -> "Track":
        """Lay the path out in time, the nozzle exit `standoff` above the floor plus one `layer_height` a layer."""
        knots: list[tuple[float, float, float, float, float]] = []
        layers: list[int] = []
        time = extruding = 0.0
        for layer in range(path.layers):
            z = floor + standoff + layer * (path.layer_height or 0.0)
            corners = path.corners()
            if layer % 2 == 1 and path.kind != "ring":
                corners = corners[::-1]
            if path.speed == 0:
                assert path.dwell is not None
                corners, legs = corners[[0, 0]], np.array([path.dwell])
            else:
                legs = np.linalg.norm(np.diff(corners, axis=0), axis=1) / path.speed
            knots.append((time, *corners[0], z, extruding))
            for corner, leg in zip(corners[1:], legs, strict=True):
                time, extruding = time + leg, extruding + leg
                knots.append((time, *corner, z, extruding))
            layers += [layer] * (len(legs) + 1)
            if layer < path.layers - 1 and path.layer_height is not None:
                time += max(path.pause, path.layer_height / path.speed if path.speed else 0.0)
        table = np.array(knots)
        return cls(table[:, 0], table[:, 1:4], table[:, 4], np.array(layers[:-1]))

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
        """Time spent extruding up to `time` [s]."""
        return np.interp(time, self.time, self.extruding)

    def release_time(self, extruding) -> np.ndarray:
        """The first time at which this much time was spent extruding [s]: the inverse of `extruded`."""
        i = np.clip(np.searchsorted(self.extruding, extruding, side="left"), 1, len(self.time) - 1)
        return self.time[i] - (self.extruding[i] - extruding)

    def layer_at(self, time) -> np.ndarray:
        """Index of the layer being laid at `time`."""
        return self.layer[np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.layer) - 1)]
