"""The stream of a nozzle on the host: which particles leave it, when, where and how fast.

A column of discs one spacing apart; each disc carries exactly the nozzle's area times a spacing of material.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .scenario import Scenario

COLUMN = 4  # discs held inside the nozzle: more than any method's support radius


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


@dataclass(frozen=True)
class Stream:
    """Everything that a scenario's nozzle will ever emit, on the host in float64."""

    scenario: Scenario

    @cached_property
    def offsets(self) -> np.ndarray:
        """Points of one disc about the nozzle axis, shape (n, 2) [m]."""
        assert self.scenario.nozzle is not None
        return disc(self.scenario.nozzle.diameter / 2.0, self.scenario.spacing)

    @cached_property
    def extruding(self) -> np.ndarray:
        """Time that the nozzle's flow takes for each disc and all before it, shape (layers,) [s]; half a disc early, so
        the emitted mass is within half a disc of what is fed at any time."""
        assert self.scenario.nozzle is not None and self.scenario.track is not None
        period = self.scenario.spacing / self.scenario.nozzle.speed
        end = min(self.scenario.track.end, self.scenario.duration)
        total = float(self.scenario.track.extruded(end))
        return (np.arange(int(total / period + 0.5 + 1e-9)) + 0.5) * period

    @cached_property
    def release_time(self) -> np.ndarray:
        """When each disc leaves the nozzle, shape (layers,) [s]."""
        assert self.scenario.track is not None
        return self.scenario.track.release_time(self.extruding)

    @cached_property
    def velocity(self) -> np.ndarray:
        """Velocity of each disc at its release, shape (layers, 3) [m/s]: the nozzle's plus the exit speed downwards."""
        assert self.scenario.nozzle is not None and self.scenario.track is not None
        track = self.scenario.track
        i = track.interval(self.extruding)
        down = self.scenario.nozzle.speed * track.flow_in[i]
        return track.velocity_in[i] - down[:, None] * [0.0, 0.0, 1.0]

    @property
    def volume(self) -> float:
        """Rest volume of a particle [m^3]: a disc of exactly the nozzle's area shared among its points."""
        assert self.scenario.nozzle is not None
        return self.scenario.nozzle.area * self.scenario.spacing / len(self.offsets)

    @property
    def particles(self) -> int:
        return len(self.offsets) * len(self.extruding)

    def entered(self, time) -> Any:
        """How many discs are in the nozzle or beyond at `time` [s], a number or an array."""
        assert self.scenario.nozzle is not None and self.scenario.track is not None
        ahead = (COLUMN + 0.5) * self.scenario.spacing / self.scenario.nozzle.speed
        return np.searchsorted(self.extruding, self.scenario.track.extruded(time) + ahead)

    def released(self, time) -> Any:
        """How many discs have left the nozzle at `time` [s], a number or an array."""
        return np.searchsorted(self.release_time, time, side="right")

    def mass(self, time: float) -> float:
        """Mass released up to `time` [kg]."""
        return self.released(time) * len(self.offsets) * self.volume * self.scenario.material.density
