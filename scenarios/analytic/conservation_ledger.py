"""A spinning, straining drop in free flight: mass, momentum and energy book-keeping (references.md, A, exact)."""

import numpy as np

from fluidbench.measure.profiles import kinetic_energy
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

G = np.array([0.0, 0.0, -9.81])


def scenarios(spacing: float) -> dict[str, Scenario]:
    body = {
        "kind": "sphere",
        "center": [0.2, 0.2, 0.2],
        "radius": 0.05,
        "velocity_gradient": [[5.0, -8.0, 0.0], [8.0, 5.0, 0.0], [0.0, 0.0, -10.0]],
    }
    drop = define(
        "conservation_ledger",
        domain={"lower": [0, 0, 0], "upper": [0.4, 0.4, 0.4]},
        material={"density": 1000.0},
        gravity=G.tolist(),
        bodies=[body],
        duration=0.06,
        output_interval=0.01,
        spacing=spacing,
    )
    return {"drop": drop}


def evaluate(runs: dict[str, Run]) -> Finding:
    """|P - P0 - M g t| / (M g t); energy apart from the fall must not grow."""
    frames = runs["drop"].frames
    mass = [frame["mass"].astype(float) for frame in frames]
    momentum = [m @ frame["velocity"].astype(float) for m, frame in zip(mass, frames, strict=True)]
    t = float(frames[-1]["time"])
    impulse = mass[-1].sum() * G * t
    off = float(np.linalg.norm(momentum[-1] - momentum[0] - impulse) / np.linalg.norm(impulse))
    inner = [
        kinetic_energy(frame) - 0.5 * float(p @ p) / m.sum() for frame, p, m in zip(frames, momentum, mass, strict=True)
    ]
    numbers = (
        Number("mass [kg]", mass[-1].sum(), mass[0].sum()),
        Number("momentum gained [kg m/s]", float((momentum[-1] - momentum[0])[2]), float(impulse[2])),
        Number("largest growth of inner kinetic energy", max(inner) / inner[0] - 1.0, 0.0),
    )
    grown = max(max(inner) / inner[0] - 1.01, 0.0)
    return Finding(off + abs(mass[-1].sum() / mass[0].sum() - 1.0) + grown, numbers)


CASE = Case(
    "conservation_ledger",
    "a spinning, straining drop in free flight",
    "kinematics",
    "exact; references.md, A",
    "|P - P0 - M g t| / (M g t), plus any change of mass, plus growth of energy beyond 1 %",
    spacing=0.01,
    tolerance=1e-4,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=0.01,
)
