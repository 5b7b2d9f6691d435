"""What a nozzle still holds, and the pressure that feeds it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..method.frame import CARRIED, FREE, Frame
from ..scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

FITTED = (0.25, 0.9)  # share of the bore over which pressure is taken to be linear: away from its mouth and its feed


def from_exit(frame: Frame, scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Height above the nozzle's exit and distance from its axis of every particle, each of shape (n,) [m]."""
    assert scenario.track is not None
    away = frame["position"].astype(float) - scenario.track.at(float(frame["time"]))
    return away[:, 2], np.hypot(away[:, 0], away[:, 1])


def is_out(frame: Frame, scenario: Scenario) -> np.ndarray:
    """Which particles have left the nozzle, shape (n,): neither carried nor in the bore of a body."""
    out = frame["held"] != CARRIED
    if scenario.track is None or scenario.nozzle is None or scenario.nozzle.rise == 0.0:
        return out
    height, radius = from_exit(frame, scenario)
    return out & ~((height > 0.0) & (radius < scenario.nozzle.diameter / 2.0))


def feeding(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """`inlet_pressure_Pa` at the upper end of the bore: a line through the pressures of what is in the bore, by least
    squares. Nothing without a bore, of a method that has no pressure, or while nothing is fed."""
    nozzle, track = scenario.nozzle, scenario.track
    if nozzle is None or track is None or nozzle.rise == 0.0 or "pressure" not in frame:
        return {}
    before, now = track.extruded(np.array([-scenario.schedule[0], 0.0]) + float(frame["time"]))
    if now == before:
        return {}
    height, radius = from_exit(frame, scenario)
    within = (frame["held"] == FREE) & (radius < nozzle.diameter / 2.0)
    within &= (height > FITTED[0] * nozzle.rise) & (height < FITTED[1] * nozzle.rise)
    if within.sum() < 2:
        return {}
    line = np.polyfit(height[within], frame["pressure"][within].astype(float), 1)
    return {"inlet_pressure_Pa": float(np.polyval(line, nozzle.rise))}


def fed(series: pd.DataFrame) -> dict[str, float]:
    """The same of a whole run: the median over the later half of the time in which it is known."""
    if "inlet_pressure_Pa" not in series:
        return {}
    known = series["inlet_pressure_Pa"].dropna().to_numpy()
    return {"inlet_pressure_Pa": float(np.median(known[len(known) // 2 :]))} if len(known) else {}
