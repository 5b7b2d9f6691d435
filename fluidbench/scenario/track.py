"""Where the nozzle is and how much it has extruded, as a function of time; and what is laid in one go."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .toolpath import Toolpath

SAME = 1e-6  # places that are one [m]
HAIR = 1e-12  # of all that is extruded: a rounding
TINY = 1e-300  # to divide by, where nothing takes any time


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
    for what was extruded up to the knot [s]; layer: (n - 1,), the layer of each interval.
    """

    time: np.ndarray
    position: np.ndarray
    extruding: np.ndarray
    layer: np.ndarray

    @classmethod
    def of(cls, path: Toolpath, floor: float, standoff: float) -> "Track":
        """Lay the path out in time, the nozzle exit `standoff` above the floor plus one `layer_height` a layer."""
        if path.moves is not None:
            moves = path.moves.array
            time, extruding = np.cumsum(moves[:, 3]), np.cumsum(moves[:, 3] * moves[:, 4])
            return cls(time, moves[:, :3] + [0.0, 0.0, floor], extruding, moves[1:, 5].astype(int))
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
        return cls(table[:, 0], table[:, 1:4], table[:, 4], np.array(layers[:-1]))

    @cached_property
    def strokes(self) -> list[np.ndarray]:
        """Knots of what is laid without a stop in one layer, stroke by stroke."""
        laid = self.flow_in > 0
        breaks = np.flatnonzero(~laid[1:] | ~laid[:-1] | (np.diff(self.layer) > 0)) + 1
        parts = np.split(np.arange(len(laid)), breaks)
        return [np.arange(part[0], part[-1] + 2) for part in parts if laid[part[0]]]

    @cached_property
    def stroke(self) -> Stroke:
        """The longest of the first layer, which beads are measured along."""
        first = [rows for rows in self.strokes if self.layer[rows[0]] == 0]
        ways = [np.linalg.norm(np.diff(self.position[rows, :2], axis=0), axis=1) for rows in first]
        longest = max(range(len(first)), key=lambda i: float(ways[i].sum()))
        way = ways[longest]
        rows = first[longest][np.concatenate([[True], way > 0])]
        distance = np.concatenate([[0.0], np.cumsum(way[way > 0])])
        return Stroke(self.position[rows, :2], distance, self.time[rows], self.extruding[rows])

    @cached_property
    def repeats(self) -> bool:
        """Whether every layer goes over the first, there or back: one stroke each, at the same places in plan."""
        lines = [self.position[rows, :2] for rows in self.strokes]
        return len(lines) == self.layer[-1] + 1 and all(_same(line, lines[0]) for line in lines)

    @property
    def end(self) -> float:
        """Time at which extrusion ends [s]."""
        return float(self.time[-1])

    def at(self, time) -> np.ndarray:
        """Position of the nozzle exit, shape (..., 3) [m]; it rests at both ends of the track."""
        return np.stack([np.interp(time, self.time, self.position[:, axis]) for axis in range(3)], axis=-1)

    def extruded(self, time) -> np.ndarray:
        """Time that the nozzle's flow would have taken for what was extruded up to `time` [s]."""
        return np.interp(time, self.time, self.extruding)

    def interval(self, extruding) -> np.ndarray:
        """Index of the interval in which this much was extruded for the first time, give or take a rounding."""
        nearly = np.asarray(extruding) - HAIR * self.extruding[-1]
        return np.clip(np.searchsorted(self.extruding, nearly, side="left"), 1, len(self.time) - 1) - 1

    def release_time(self, extruding) -> np.ndarray:
        """The first time at which this much was extruded [s]: the inverse of `extruded`."""
        i = self.interval(extruding)
        return self.time[i + 1] - (self.extruding[i + 1] - extruding) / np.maximum(self.flow_in[i], TINY)

    @cached_property
    def flow_in(self) -> np.ndarray:
        """Flow in each interval over the nozzle's, shape (n - 1,) [-]."""
        return np.diff(self.extruding) / np.maximum(np.diff(self.time), TINY)

    @cached_property
    def velocity_in(self) -> np.ndarray:
        """Of the nozzle in each interval, shape (n - 1, 3) [m/s]."""
        return np.diff(self.position, axis=0) / np.maximum(np.diff(self.time), TINY)[:, None]

    @cached_property
    def speed_in(self) -> np.ndarray:
        """The same, shape (n - 1,) [m/s]."""
        return np.linalg.norm(self.velocity_in, axis=1)

    def layer_at(self, time) -> np.ndarray:
        """Index of the layer being laid at `time`."""
        return self.layer[np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.layer) - 1)]


def _same(line: np.ndarray, other: np.ndarray) -> bool:
    """Whether two lines go through the same points, there or back."""
    if len(line) != len(other):
        return False
    return any(bool((np.linalg.norm(way - other, axis=1) <= SAME).all()) for way in (line, line[::-1]))
