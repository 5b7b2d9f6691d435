"""Stability bounds and the plan of substeps that keeps within the smallest of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

SPEED_MARGIN = 1.25  # the speed seen at the last look may grow by this much until the next


@dataclass(frozen=True)
class Bound:
    """One limit on the time step [s], with the formula and the source it comes from."""

    name: str
    dt: float
    formula: str
    source: str


@dataclass(frozen=True)
class Plan:
    """A tick cut into equal substeps."""

    dt: float
    substeps: int
    binding: Bound


def plan(bounds: Sequence[Bound], tick: float) -> Plan:
    """The fewest equal substeps of a tick [s] that respect every bound.

    Raises ValueError when no bound is finite and positive.
    """
    binding = min(bounds, key=lambda bound: bound.dt)
    if not (math.isfinite(tick) and binding.dt > 0):
        raise ValueError(f"bound '{binding.name}' is {binding.dt}, which allows no step")
    substeps = max(1, math.ceil(tick / binding.dt * (1.0 - 1e-9)))
    return Plan(tick / substeps, substeps, binding)


def lost_speed(dt: float, reach: float) -> float:
    """Motion slower than this [m/s] is lost in single precision: a position of size `reach` [m] does not change when
    v dt is below half a unit in its last place."""
    return 0.5 * float(np.spacing(np.float32(reach))) / dt


def damped_limit(acoustic: float, viscous: float) -> float:
    """Largest stable dt [s] of symplectic Euler when waves and explicit damping act together.

    An oscillator of angular frequency w with explicit damping rate g is stable for (w dt)^2 / 4 + g dt / 2 < 1; with
    the separate limits `acoustic` = 2/w and `viscous` = 2/g that is (dt/acoustic)^2 + dt/viscous < 1.
    """
    if math.isinf(viscous):
        return acoustic
    half = 0.5 * acoustic * acoustic / viscous
    return acoustic * acoustic / (half + math.sqrt(half * half + acoustic * acoustic))
