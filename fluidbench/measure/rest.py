"""Whether matter has come to rest: how far its lengths and its centre still go, and how fast."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scenario import Scenario
from .slump import height_before

if TYPE_CHECKING:
    import pandas as pd

LAST = 0.2  # share of the time over which matter is watched
STILL = 0.05  # of a spacing, which is what lengths are known to: as far as what rests may go in it
AXES = "xyz"


def creep(series: pd.DataFrame, scenario: Scenario) -> dict[str, float]:
    """How fast the fastest length changed over the last fifth of a run, or what of it the length is known for [m/s];
    nothing without lengths."""
    went = _lengths(_window(series), scenario).values()
    return {"creep_m_per_s": max(distance / time for distance, time in went)} if went else {}


def moving(series: pd.DataFrame, scenario: Scenario) -> tuple[str, ...]:
    """Lengths that over the last fifth of a run went by more than a twentieth of a spacing, by name."""
    window = _window(series)
    return tuple(key for key, (went, _) in _lengths(window, scenario).items() if went > STILL * scenario.spacing)


def at_rest(series: pd.DataFrame, scenario: Scenario) -> bool:
    """Whether nothing has happened over the last fifth of the time, nor over the last two outputs: nothing was added or
    grew, and no length nor the centre of mass went by more than a twentieth of a spacing, though there was time for a
    whole one (`patience`). The fifth makes it a question without a scale of time: what spreads as a power of it never
    rests."""
    window = _window(series, 3)
    if len(window) < 3:
        return False
    begins, ends = (float(window["time_s"].iloc[i]) for i in (0, -1))
    if begins < scenario.events_end * (1.0 - 1e-6):
        return False
    if ends - begins < patience(scenario, float(window["top_m"].iloc[-1])):
        return False
    went = [*(distance for distance, _ in _lengths(window, scenario).values()), *_center(window, scenario)]
    return all(distance <= STILL * scenario.spacing for distance in went)


def patience(scenario: Scenario, height: float) -> float:
    """Time in which fresh matter of this height [m] that nothing held would go by a spacing d [s]: by falling,
    sqrt(2 d / g), and by a column's viscous sinking at rho g H / (3 mu), 3 mu d / (rho g H^2); 0 without weight. (mu
    of a paste is that at a rate of shear of 1/s; cured matter may rest for good, however thick it is.)"""
    weight, d = scenario.peak_acceleration, scenario.spacing
    if weight == 0.0:
        return 0.0
    sinking = scenario.material.steady_viscosity / scenario.material.density
    return float(np.sqrt(2.0 * d / weight)) + 3.0 * sinking * d / (weight * max(height, d) ** 2)


def _window(series: pd.DataFrame, least: int = 2) -> pd.DataFrame:
    """The rows of the last fifth of the time, at least so many."""
    time = series["time_s"].to_numpy()
    if not len(time):
        return series
    begins = int(np.searchsorted(time, (1.0 - LAST) * time[-1] * (1.0 + 1e-9), side="right")) - 1
    return series.iloc[max(0, min(begins, len(time) - least)) :]


def _lengths(window: pd.DataFrame, scenario: Scenario) -> dict[str, tuple[float, float]]:
    """(how far each length went, between its extremes [m]; the time it is known for [s]): areas by their roots, a slump
    by the height it is of."""
    went = {}
    for key in window:
        name = str(key)
        known = window[["time_s", key]].dropna()
        time, values = known["time_s"].to_numpy(), known[key].to_numpy()
        if len(values) < 2 or name.startswith(("resolution", "center")):
            continue
        if name == "slump":
            values = height_before(scenario) * values
        elif name.endswith("_m2"):
            values = np.sqrt(values)
        elif not name.endswith("_m"):
            continue
        went[name] = float(np.ptp(values)), float(time[-1] - time[0])
    return went


def _center(window: pd.DataFrame, scenario: Scenario) -> list[float]:
    """How far the centre of mass went along each axis [m]: by its momentum, where positions wrap."""
    time, mass = window["time_s"].to_numpy(), window["mass_kg"].to_numpy()
    went = []
    for axis, periodic in zip(AXES, scenario.domain.walls.periodic(), strict=True):
        if periodic:
            speed = window[f"momentum_{axis}_kg_m_s"].to_numpy() / np.maximum(mass, np.finfo(float).tiny)
            went.append(float(abs(speed.mean()) * (time[-1] - time[0])))
        else:
            went.append(float(np.ptp(window[f"center_{axis}_m"].to_numpy())))
    return went
