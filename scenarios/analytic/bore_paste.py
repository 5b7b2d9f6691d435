"""Pressure that drives a Bingham paste through a nozzle's bore, in creeping flow (exact)."""

from dataclasses import replace

import numpy as np

from fluidbench.scenario import Scenario

from .bore_flow import CASE as LIQUID
from .bore_flow import DENSITY, DIAMETER, SPEED, VISCOSITY, flow

BINGHAM = 4.0  # tau_y D / (k U): a plug half as wide as the bore


def scenarios(spacing: float) -> dict[str, Scenario]:
    threshold = BINGHAM * VISCOSITY * SPEED / DIAMETER
    paste = {
        "youngs_modulus": 120.0 * threshold,
        "poisson_ratio": 0.45,
        "yield_stress": threshold,
        "plastic_viscosity": VISCOSITY,
        "sound_speed": 25.0 * float(np.sqrt(threshold / DENSITY)),
    }
    return {"paste": flow(paste, spacing)}


CASE = replace(
    LIQUID,
    name="bore_paste",
    title="pressure that drives a Bingham paste through a bore",
    source="exact: Buckingham-Reiner",
    spacing=DIAMETER / 12,
    scenarios=scenarios,
)
