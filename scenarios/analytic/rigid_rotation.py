"""A spinning elastic disc keeps its angular momentum (references.md, A, exact)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

OMEGA, TURNS, CENTRE = 10.0, 2.0, np.array([0.15, 0.15, 0.1])


def scenarios(spacing: float) -> dict[str, Scenario]:
    body = {
        "kind": "cylinder",
        "center": CENTRE.tolist(),
        "radius": 0.1,
        "height": 0.05,
        "angular_velocity": [0.0, 0.0, OMEGA],
    }
    disc = define(
        "rigid_rotation",
        domain={"lower": [0, 0, 0], "upper": [0.3, 0.3, 0.2]},
        bodies=[body],
        material={"density": 1000.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3},
        gravity=[0.0, 0.0, 0.0],
        duration=TURNS * 2 * np.pi / OMEGA,
        spacing=spacing,
    )
    return {"disc": disc}


def momentum(frame: dict[str, np.ndarray]) -> float:
    """Angular momentum about the disc's axis, the particles' own spin included [kg m^2/s]."""
    m, v = frame["mass"].astype(float), frame["velocity"].astype(float)
    arm = frame["position"].astype(float) - CENTRE
    return float((m * (arm[:, 0] * v[:, 1] - arm[:, 1] * v[:, 0])).sum() + frame["spin"][:, 2].astype(float).sum())


def evaluate(runs: dict[str, Run]) -> Finding:
    """|L / L0 - 1| per turn."""
    run = runs["disc"]
    share = np.array([momentum(frame) for frame in run.frames]) / momentum(run.frames[0])
    numbers = (Number("L / L0 after two turns", share[-1], 1.0),)
    curve = Curve("momentum", "time [s]", "L / L0", run.times, share, run.times, np.ones_like(share))
    return Finding(float(np.abs(share - 1.0).max()) / TURNS, numbers, (curve,))


CASE = Case(
    "rigid_rotation",
    "an elastic disc spinning freely",
    "kinematics",
    "exact; references.md, A",
    "|L / L0 - 1| per turn",
    spacing=0.01,
    tolerance=1e-3,
    scenarios=scenarios,
    evaluate=evaluate,
)
