"""Plug flow of a Bingham paste between plates (exact)."""

import numpy as np

from fluidbench.measure.profiles import relative_l2
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HALF, DRIVE, MU = 0.01, 1e4, 2.0  # half width [m], force per volume [N/m^3], plastic viscosity [Pa s]
YIELD = 0.4 * DRIVE * HALF
PLUG = (DRIVE * HALF - YIELD) ** 2 / (2 * MU * DRIVE)


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 8 * spacing
    walls = {f"{axis}_{end}": "periodic" for axis in "xz" for end in ("lower", "upper")}
    channel = define(
        "bingham_channel",
        domain={
            "lower": [0, 0, 0],
            "upper": [side, HALF, side],
            "walls": {**walls, "y_lower": "stick", "y_upper": "slip"},
        },
        material={
            "density": 1000.0,
            "sound_speed": 5.0,
            "youngs_modulus": 120 * YIELD,
            "poisson_ratio": 0.45,
            "yield_stress": YIELD,
            "plastic_viscosity": MU,
        },
        bodies=[{"kind": "box", "center": [side / 2, HALF / 2, side / 2], "size": [side, HALF, side]}],
        gravity=[0.0, 0.0, 0.0],
        body_force=[DRIVE / 1000.0, 0.0, 0.0],
        duration=0.4,
        spacing=spacing,
    )
    return {"channel": channel}


def exact(y: np.ndarray) -> np.ndarray:
    """u = [G (b y - y^2/2) - tau_y y] / mu up to the plug at b - tau_y / G, then constant [m/s]."""
    y = np.minimum(y, HALF - YIELD / DRIVE)
    return (DRIVE * (HALF * y - y * y / 2) - YIELD * y) / MU


def evaluate(runs: dict[str, Run]) -> Finding:
    """E2 of the steady velocity over all particles; shear rate left in the plug."""
    run = runs["channel"]
    frames = run.frames[-4:]
    y = np.concatenate([frame["position"][:, 1] for frame in frames]).astype(float)
    u = np.concatenate([frame["velocity"][:, 0] for frame in frames]).astype(float)
    plug = y > HALF - 0.75 * YIELD / DRIVE
    creep = abs(np.polyfit(y[plug], u[plug], 1)[0]) / ((DRIVE * HALF - YIELD) / MU)
    numbers = (
        Number("plug velocity [m/s]", float(u[plug].mean()), PLUG),
        Number("plug's shear rate over the wall's", float(creep), 0.0),
    )
    order, across = np.argsort(y), np.linspace(0.0, HALF, 61)
    curve = Curve("velocity", "y [m]", "u [m/s]", y[order], u[order], across, exact(across))
    return Finding(relative_l2(u, exact(y)), numbers, (curve,))


CASE = Case(
    "bingham_channel",
    "plug flow of a Bingham paste between plates",
    "yield stress",
    "exact; references.md, D",
    "E2 of velocity",
    spacing=HALF / 16,
    tolerance=0.05,
    fine_tolerance=0.03,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=HALF / 16,
)
