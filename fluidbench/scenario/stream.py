"""The stream of a nozzle on the host: which particles leave it, when, where and how fast.

A column of discs one spacing apart; each disc carries exactly the nozzle's area times a spacing of material.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .bore import Bore
from .nozzle import COLUMN, Nozzle
from .scenario import Scenario
from .track import Track

GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # by which what follows turns: evenly all around


def disc(radius: float, spacing: float) -> np.ndarray:
    """Points of a square lattice inside a circle, shape (n, 2) [m]; of four offsets the one nearest to the area."""
    cells = np.arange(-int(radius / spacing) - 2, int(radius / spacing) + 3)
    best = None
    for offset in ((0.5, 0.5), (0.0, 0.0), (0.5, 0.0), (0.25, 0.25)):
        x, y = np.meshgrid((cells + offset[0]) * spacing, (cells + offset[1]) * spacing, indexing="ij")
        inside = np.hypot(x, y) <= radius * (1 + 1e-9)
        error = abs(inside.sum() * spacing**2 - np.pi * radius**2)
        if best is None or error < best[0] - 1e-12:
            best = (error, np.stack([x[inside], y[inside]], axis=1))
    assert best is not None
    points = best[1]
    # Stretched by a percent or so until each point owns its share of the area: what reads density from positions would
    # otherwise find the disc too full, and burst.
    return points * np.sqrt(np.pi * radius**2 / (len(points) * spacing**2))


def rings(radius: float, spacing: float) -> np.ndarray:
    """Points on rings about a spacing apart, shape (n, 2) [m], the last half of that in front of the radius: matter
    that fills a bore."""
    many = max(1, round(radius / spacing))
    points = []
    for k in range(many):
        n = round(np.pi * (2 * k + 1) * (radius / spacing / many) ** 2)
        angle = 2.0 * np.pi * (np.arange(n) + 0.5 * (k % 2)) / n
        r = (k + 0.5) * radius / many
        points.append(np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1))
    return np.concatenate(points)


@dataclass(frozen=True)
class Stream:
    """Everything that a scenario's nozzle will ever emit, on the host in float64: rows of particles that move as one,
    in the order in which they enter. As a plug, a row is a disc; where a profile develops, each particle is one."""

    scenario: Scenario

    @cached_property
    def offsets(self) -> np.ndarray:
        """Points of one disc about the nozzle axis, shape (n, 2) [m]."""
        fill = rings if self.nozzle.develops or self.nozzle.tip != "none" else disc
        return fill(self.nozzle.diameter / 2.0, self.scenario.spacing)

    @property
    def nozzle(self) -> Nozzle:
        assert self.scenario.nozzle is not None
        return self.scenario.nozzle

    @property
    def track(self) -> Track:
        assert self.scenario.track is not None
        return self.scenario.track

    @cached_property
    def points(self) -> int:
        """Particles of a row."""
        return 1 if self.nozzle.develops else len(self.offsets)

    @cached_property
    def paces(self) -> np.ndarray:
        """Speed over the mean, of each point of a disc where they differ; (1,) in a plug. Their mean is 1: the flow
        rate is exact."""
        return self.pace_at(np.linalg.norm(self.offsets, axis=1)) if self.nozzle.develops else np.ones(1)

    def pace_at(self, radius: np.ndarray) -> np.ndarray:
        """Speed over the mean at radii [m] from the axis."""
        if not self.nozzle.develops:
            return np.ones_like(radius)
        bore = Bore(self.scenario.material, self.nozzle.diameter, self.nozzle.speed)
        return bore.profile(radius) / bore.profile(np.linalg.norm(self.offsets, axis=1)).mean()

    @cached_property
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """(point of a disc, time at which it is let go as `extruding`) of each row, in the order in which they come."""
        period = self.scenario.spacing / self.nozzle.speed / self.paces
        end = min(self.track.end, self.scenario.duration)
        total = float(self.track.extruded(end))
        filling = self._filling
        left = COLUMN + 1 if filling else 0  # what a bore keeps above it
        many = [left + int(total / each + 0.5 + 1e-9) for each in period]
        point = np.concatenate([np.full(filling + n, k) for k, n in enumerate(many)])
        extruding = np.concatenate([(np.arange(-filling, n) + 0.5) * period[k] for k, n in enumerate(many)])
        order = np.argsort(extruding - self._ahead * period[point], kind="stable")
        return point[order], extruding[order]

    @property
    def _filling(self) -> int:
        """Discs that fill the bore from the start."""
        return round(self.nozzle.rise / self.scenario.spacing)

    @property
    def filled(self) -> float:
        """Volume that the bore holds from the start [m^3]."""
        return self._filling * self.scenario.spacing * self.nozzle.area

    @property
    def _ahead(self) -> float:
        """Spacings above the place where it is let go at which a row enters."""
        return COLUMN + 0.5

    @property
    def pace(self) -> np.ndarray:
        """Speed of each row over the mean, shape (rows,)."""
        return self.paces[self._rows[0]]

    @cached_property
    def offset(self) -> np.ndarray:
        """Of each particle about the nozzle axis, shape (particles, 2) [m]. Rows turn about the axis, each by a golden
        angle more than the one before: particles would follow each other in threads, with gaps between that no
        method's stress closes."""
        point, extruding = self._rows
        row = np.rint(extruding * self.nozzle.speed * self.pace / self.scenario.spacing - 0.5)
        cos, sin = np.cos(GOLDEN * row)[:, None], np.sin(GOLDEN * row)[:, None]
        x, y = np.moveaxis(self.offsets[point][:, None] if self.nozzle.develops else self.offsets[None], -1, 0)
        return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1).reshape(-1, 2)

    @property
    def extruding(self) -> np.ndarray:
        """Time that the nozzle's flow takes for each row and all before it, shape (rows,) [s]; half a disc early, so
        the emitted mass is within half a disc of what is fed at any time. Below zero for those that fill the bore from
        the start."""
        return self._rows[1]

    @cached_property
    def release_time(self) -> np.ndarray:
        """When each row is let go, shape (rows,) [s]; never, what is above the bore at the end."""
        total = float(self.track.extruding[-1])
        return np.where(self.extruding > total, np.inf, self._at(self.extruding))

    @cached_property
    def birth_time(self) -> np.ndarray:
        """When each row leaves the nozzle, shape (rows,) [s]: when it is let go or, in a bore, as much later as what is
        below it takes; of what is left in there, after the end."""
        return self._at(self.extruding + self.nozzle.rise / (self.nozzle.speed * self.pace))

    def _at(self, extruded: np.ndarray) -> np.ndarray:
        """When so much was extruded [s], as if it had gone on so before and after the track."""
        total = float(self.track.extruding[-1])
        found = self.track.release_time(np.clip(extruded, 0.0, total))
        return found + np.minimum(extruded, 0.0) + np.maximum(extruded - total, 0.0)

    @cached_property
    def release_point(self) -> np.ndarray:
        """Where each row is let go, shape (rows, 3) [m]: at the exit or, of a body, at the upper end of its bore."""
        early = np.minimum(self.release_time, 0.0)[:, None] * self.track.velocity_in[0]
        return self.outlet(np.minimum(self.release_time, self.track.end)) + early

    def outlet(self, time) -> np.ndarray:
        """Where matter is let go at `time`, shape (..., 3) [m]."""
        return self.track.at(time) + np.array([0.0, 0.0, self.nozzle.rise])

    @cached_property
    def velocity(self) -> np.ndarray:
        """Velocity of each row at its release, shape (rows, 3) [m/s]: the nozzle's plus the exit speed downwards."""
        i = self.track.interval(self.extruding)
        down = self.nozzle.speed * self.track.flow_in[i] * self.pace
        return self.track.velocity_in[i] - down[:, None] * [0.0, 0.0, 1.0]

    @property
    def volume(self) -> float:
        """Rest volume of a particle [m^3]: a disc of exactly the nozzle's area shared among its points."""
        return self.nozzle.area * self.scenario.spacing / len(self.offsets)

    @property
    def particles(self) -> int:
        return self.points * len(self.extruding)

    @cached_property
    def _entry(self) -> np.ndarray:
        return self.extruding - self._ahead * self.scenario.spacing / (self.nozzle.speed * self.pace)

    @cached_property
    def _released(self) -> np.ndarray:
        return np.sort(self.release_time)

    def entered(self, time) -> Any:
        """How many rows are in the nozzle or beyond at `time` [s], a number or an array."""
        return np.searchsorted(self._entry, self.track.extruded(time))

    def released(self, time) -> Any:
        """How many rows were let go at `time` [s], a number or an array."""
        return np.searchsorted(self._released, time, side="right")

    def mass(self, time: float) -> float:
        """Mass released up to `time` [kg]."""
        return self.released(time) * self.points * self.volume * self.scenario.material.density
