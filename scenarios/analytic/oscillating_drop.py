"""An inviscid sphere oscillating in a central force -Omega^2 r (exact; Monaghan & Rafiee 2013)."""

import numpy as np

from fluidbench.measure.profiles import period, semi_axes
from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

RADIUS, OMEGA, STRAIN, PERIODS = 0.05, 20.0, 0.3, 4.0
CENTRE = [0.1, 0.1, 0.1]


def scenarios(spacing: float) -> dict[str, Scenario]:
    rate, pull = STRAIN * OMEGA, -(OMEGA**2)
    body = {
        "kind": "sphere",
        "center": CENTRE,
        "radius": RADIUS,
        "velocity_gradient": [[rate, 0, 0], [0, rate, 0], [0, 0, -2 * rate]],
    }
    drop = define(
        "oscillating_drop",
        domain={"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2]},
        bodies=[body],
        material={"density": 1000.0, "sound_speed": 15.0},
        gravity=[0.0, 0.0, 0.0],
        body_force_center=CENTRE,
        body_force_gradient=np.diag([pull, pull, pull]).tolist(),
        duration=PERIODS * 4.5233 / OMEGA,
        output_interval=4.5233 / OMEGA / 24,
        spacing=spacing,
    )
    return {"drop": drop}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Period of the axial semi-axis; its extrema in the first and in the last period."""
    run = runs["drop"]
    exact = table("oscillating_drop_periods").set_index("A0_over_Omega").loc[STRAIN]
    axis = np.array([semi_axes(frame)[2] for frame in run.frames])
    axis /= axis[0]
    seen = period(run.times, axis) * OMEGA
    one = len(axis) // int(PERIODS)
    first, last = np.ptp(axis[: one + 1]), np.ptp(axis[-one - 1 :])
    numbers = (
        Number("period times Omega", seen, exact["period_axi_Omega"]),
        Number("largest axial semi-axis over R", axis.max(), exact["c_axi_max"]),
        Number("smallest axial semi-axis over R", axis[: one + 1].min(), exact["c_axi_min"]),
        Number("amplitude in the last period over the first", last / first, 1.0),
    )
    curve = Curve("axis c", "t Omega", "c / R", run.times * OMEGA, axis, np.array([]), np.array([]))
    return Finding(abs(seen / exact["period_axi_Omega"] - 1.0), numbers, (curve,))


CASE = Case(
    "oscillating_drop",
    "an inviscid sphere oscillating in a central force",
    "liquid",
    "exact; Monaghan & Rafiee 2013, axisymmetric form derived in references.md, B",
    "relative error of the period",
    spacing=RADIUS / 10,
    tolerance=0.03,
    fine_tolerance=0.02,
    scenarios=scenarios,
    evaluate=evaluate,
)
