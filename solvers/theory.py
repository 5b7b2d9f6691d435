"""Largest stable steps in bulk by Fourier analysis, from the tables in scenarios/reference (*_stability_limits.csv)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fluidbench.measure.reference import table
from fluidbench.method.timestep import damped_limit

if TYPE_CHECKING:
    from fluidbench.method.contract import Method
    from fluidbench.scenario import Scenario


def stable_dt(method: type[Method], scenario: Scenario, config: Any, acoustic: float, viscous: float) -> float:
    """Wave and viscous limits combined as for a damped oscillator [s]; `acoustic` and `viscous` are the limits over the
    method's own bounds, which carry the wave speed and the viscosity (artificial included)."""
    own = {b.name: b.dt for b in method.bounds(scenario, config, 0.0)}
    return damped_limit(own["acoustic"] * acoustic, own.get("viscous", math.inf) * viscous)


def mpm_numbers(safety: float) -> tuple[float, float]:
    """(acoustic, viscous) limits in bulk over the method's own, which are those of an isolated particle."""
    rows = table("mpm_stability_limits").set_index(["material", "arrangement", "gradient"])
    bulk, alone = "3d bulk 8 per cell regular", "3d isolated particle"

    def limit(material: str, arrangement: str) -> float:
        row = rows.loc[(material, arrangement, "mls")]
        return float(row["min"] + row["max"]) / 2

    acoustic, viscous = (limit(m, bulk) / (safety * limit(m, alone)) for m in ("fluid", "viscous"))
    return acoustic, viscous


def sph_waves(ratio: float) -> float:
    """The largest dt c / h of SPH with a smoothing length of `ratio` spacings."""
    rows = table("sph_stability_limits")
    rows = rows[rows["kernel"] == "wendland_c2"]
    return float(np.interp(ratio, rows["h_over_dx"], rows["C_h"]))
