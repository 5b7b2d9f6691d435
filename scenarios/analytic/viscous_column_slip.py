"""A slender viscous column sinks on a slip floor: Trouton's ratio in compression (slender theory)."""

import numpy as np

from fluidbench.measure.ledger import deposit_of
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, RADIUS, G = 0.1, 0.02, 9.81
NU = np.sqrt(G * HEIGHT**3)  # g H^3 / nu^2 = 1
LAG = 5 / 108  # inertia delays the curve by this much in tau (references.md, C)
END = 0.8


def scenarios(spacing: float) -> dict[str, Scenario]:
    duration = END * 3 * NU / (G * HEIGHT)
    column = define(
        "viscous_column_slip",
        domain={"lower": [0, 0, 0], "upper": [0.04, 0.04, 0.12], "walls": {"z_lower": "slip"}},
        material={"density": 1000.0, "viscosity": 1000.0 * NU, "sound_speed": 10.0},
        bodies=[{"kind": "cylinder", "center": [0, 0, HEIGHT / 2], "radius": RADIUS, "height": HEIGHT}],
        duration=duration,
        output_interval=duration / 16,
        spacing=spacing,
    )
    return {"column": column}


def exact(tau: np.ndarray) -> np.ndarray:
    """h / H of slices that each obey A = A0 (1 + tau Z_above / H), delayed by inertia."""
    tau = np.maximum(tau - LAG, 1e-9)
    return np.log1p(tau) / tau


def evaluate(runs: dict[str, Run]) -> Finding:
    """Largest |h - h_ref| / h_ref for tau in [0.2, 0.8]; the theory itself is good to (R/H)^2/2 = 2 %."""
    run = runs["column"]
    tau = G * HEIGHT * run.times / (3 * NU)
    half = RADIUS / 2
    height = np.array([deposit_of(frame, run.scenario).top(0.0, 0.0, within=half) for frame in run.frames])
    height /= height[0]
    late = tau >= 0.2
    error = float(np.abs(height / exact(tau) - 1.0)[late].max())
    numbers = (Number("h / H at tau = 0.8", height[-1], float(exact(tau)[-1])),)
    curve = Curve("height", "tau = g H t / (3 nu)", "h / H", tau, height, tau, exact(tau))
    return Finding(error, numbers, (curve,))


CASE = Case(
    "viscous_column_slip",
    "a slender viscous column sinking on a slip floor",
    "viscous",
    "slender theory, error (R/H)^2/2 = 2 %; Trouton 1906, references.md, C",
    "largest |h / h_ref - 1|, 0.2 <= tau <= 0.8",
    spacing=RADIUS / 8,
    tolerance=0.03,
    fine_tolerance=0.02,
    scenarios=scenarios,
    evaluate=evaluate,
)
