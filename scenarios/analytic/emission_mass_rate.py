"""A nozzle extruding without gravity, at rest and moving: mass rho Q t to one layer (references.md, A, exact)."""

import numpy as np

from fluidbench.method.frame import CARRIED
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

RADIUS, EXIT, TIME = 0.004, 0.1, 0.4


def scenarios(spacing: float) -> dict[str, Scenario]:
    def nozzle(speed: float, end: float) -> Scenario:
        return define(
            "emission_mass_rate",
            domain={"lower": [-0.01, -0.01, 0], "upper": [0.06, 0.01, 0.08]},
            material={"density": 1000.0},
            gravity=[0.0, 0.0, 0.0],
            nozzle={"diameter": 2 * RADIUS, "exit_speed": EXIT, "standoff": 0.06},
            toolpath={"kind": "line", "start": [0.0, 0.0], "end": [end, 0.0], "speed": speed},
            duration=TIME,
            output_interval=TIME / 8,
            spacing=spacing,
        )

    return {"slow": nozzle(0.01, 0.01), "moving": nozzle(0.1, 0.05)}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Mass off by how many layers, at any output; momentum off over 1 %; how much nearer than the lattice the last
    particles are to each other, over 0.3 d."""
    from scipy.spatial import cKDTree

    worst, numbers = 0.0, []
    for label, run in runs.items():
        d = run.scenario.spacing
        layer = 1000.0 * np.pi * RADIUS**2 * d
        for frame in run.frames[1:]:
            free = frame["held"] != CARRIED
            mass = frame["mass"][free].astype(float).sum()
            worst = max(worst, abs(mass - 1000.0 * np.pi * RADIUS**2 * EXIT * float(frame["time"])) / layer)
        last = run.frames[-1]
        free = last["held"] != CARRIED
        mass = last["mass"][free].astype(float)
        momentum = -float(mass @ last["velocity"][free, 2])
        fresh = last["position"][free & (last["birth_time"] > TIME - 5 * d / EXIT)]
        closest = float(cKDTree(fresh).query(fresh, k=2)[0][:, 1].min()) / d
        worst = max(worst, abs(momentum / (mass.sum() * EXIT) - 1.0) / 0.01, (1.0 - closest) / 0.3)
        numbers += [
            Number(f"{label}: mass [kg]", mass.sum(), 1000.0 * np.pi * RADIUS**2 * EXIT * TIME),
            Number(f"{label}: downward momentum [kg m/s]", momentum, mass.sum() * EXIT),
            Number(f"{label}: closest of the last layers over d (at least 0.7)", closest, 1.0),
        ]
    return Finding(worst, tuple(numbers))


CASE = Case(
    "emission_mass_rate",
    "a nozzle extruding without gravity, slow and fast",
    "emission",
    "exact; references.md, A",
    "worst of |m - rho Q t| in layers, error of momentum over 1 %, approach of neighbours over 0.3 d",
    spacing=RADIUS / 4,
    tolerance=1.0,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=RADIUS / 4,
)
