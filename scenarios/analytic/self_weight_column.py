"""A confined elastic column settles under its own weight (exact for the common material law)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

LENGTH, POISSON, G = 0.1, 0.3, 9.81
MODULUS = 1000.0 * G * LENGTH / 0.1  # lambda + 2 mu: q = rho g L / M = 0.1
YOUNG = MODULUS * (1 + POISSON) * (1 - 2 * POISSON) / (1 - POISSON)
SHEAR, BULK = YOUNG / (2 * (1 + POISSON)), YOUNG / (3 * (1 - 2 * POISSON))
PERIOD = 4 * LENGTH / np.sqrt(MODULUS / 1000.0)


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 4 * spacing
    column = define(
        "self_weight_column",
        domain={"lower": [0, 0, 0], "upper": [side, side, 1.1 * LENGTH], "walls": {"z_lower": "slip"}},
        material={"density": 1000.0, "youngs_modulus": YOUNG, "poisson_ratio": POISSON, "viscosity": 20.0},
        bodies=[{"kind": "box", "center": [side / 2, side / 2, LENGTH / 2], "size": [side, side, LENGTH]}],
        duration=8 * PERIOD,
        output_interval=PERIOD / 16,
        spacing=spacing,
    )
    return {"column": column}


def compression(height: np.ndarray) -> np.ndarray:
    """J(Z) from P(J) = -rho g (L - Z), P = -K (1/J - 1) + 2/3 G J^(-5/3) (J^2 - 1): our law in uniaxial strain."""
    j = np.linspace(0.5, 1.0, 20001)
    stress = -BULK * (1 / j - 1) + 2 / 3 * SHEAR * j ** (-5 / 3) * (j**2 - 1)
    return np.interp(-1000.0 * G * (LENGTH - height), stress, j)


def evaluate(runs: dict[str, Run]) -> Finding:
    """Top's settlement over the last two of eight lightly damped periods, against the exact static one."""
    run = runs["column"]
    rest = run.frames[0]["position"][:, 2].astype(float)
    top = rest > rest.max() - 0.5 * run.scenario.spacing
    levels = np.linspace(0.0, LENGTH, 2001)
    squeezed = np.concatenate(
        [[0.0], np.cumsum(0.5 * np.diff(levels) * (compression(levels[1:]) + compression(levels[:-1])))]
    )
    late = [frame for frame in run.frames if float(frame["time"]) > 5.99 * PERIOD]
    place = np.mean([frame["position"][:, 2] for frame in late], axis=0)
    seen = float((rest - place)[top].mean()) / LENGTH
    wanted = float(np.mean(rest[top] - np.interp(rest[top], levels, squeezed))) / LENGTH
    order = np.argsort(rest)
    curve = Curve(
        "sinking", "rest height [m]", "sinking [m]", rest[order], (rest - place)[order], levels, levels - squeezed
    )
    return Finding(abs(seen / wanted - 1.0), (Number("settlement of the top over L", seen, wanted),), (curve,))


CASE = Case(
    "self_weight_column",
    "a confined elastic column under its own weight",
    "elastic",
    "exact for the law of solvers/constitutive.py; references.md, E",
    "relative error of the top's settlement",
    spacing=LENGTH / 50,
    tolerance=0.01,
    fine_tolerance=0.005,
    scenarios=scenarios,
    evaluate=evaluate,
)
