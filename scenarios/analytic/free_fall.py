"""A liquid sphere thrown upwards: time integration, no spurious self-force (references.md, A, exact)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

RADIUS, START, G = 0.05, np.array([1.0, 0.0, 2.0]), np.array([0.0, 0.0, -9.81])


def scenarios(spacing: float) -> dict[str, Scenario]:
    body = {"kind": "sphere", "center": [0.3, 0.3, 0.3], "radius": RADIUS, "velocity": START.tolist()}
    flight = define(
        "free_fall",
        domain={"lower": [0, 0, 0], "upper": [0.8, 0.6, 0.8]},
        material={"density": 1000.0},
        gravity=G.tolist(),
        bodies=[body],
        duration=0.3,
        output_interval=0.1,
        spacing=spacing,
    )
    return {"flight": flight}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Position against symplectic Euler's own x0 + v0 t + g t (t + dt) / 2, and the change of shape."""
    run = runs["flight"]
    first, last = run.frames[0]["position"].astype(float), run.frames[-1]["position"].astype(float)
    t = float(run.frames[-1]["time"])
    exact = START * t + G * t * t / 2
    moved = last.mean(axis=0) - first.mean(axis=0)
    fall = 9.81 * t * t / 2
    off = float(np.linalg.norm(moved - exact - G * t * run.dt / 2)) / fall
    shape = float(np.abs((last - last.mean(axis=0)) - (first - first.mean(axis=0))).max()) / RADIUS
    numbers = (
        Number("distance fallen [m]", float(2.0 * t - moved[2]), fall),
        Number("offset of the integrator over dt / t", float(np.linalg.norm(moved - exact)) / fall, run.dt / t),
        Number("change of shape over R", shape, 0.0),
    )
    return Finding(max(off, shape), numbers)


CASE = Case(
    "free_fall",
    "a liquid sphere in free flight",
    "kinematics",
    "exact; references.md, A",
    "largest of |x - x_symplectic| / (g t^2 / 2) and change of shape / R",
    spacing=RADIUS / 8,
    tolerance=5e-4,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=RADIUS / 8,
)
