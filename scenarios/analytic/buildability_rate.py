"""A column grows layer by layer while its yield stress grows with age: which wins decides how high it can be built.

A nozzle's plug would carry part of the column, so whole layers are laid on it instead, at rest.
"""

import math

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

RADIUS, WEIGHT, RISE = 0.01, 9810.0, 0.05  # m, rho g [N/m^3], vertical building rate w [m/s]
YIELD, YOUNG, POISSON, TIME = 183.0, 7e4, 0.45, 1.4  # Pa, Pa, -, s
RATES = {"weak": 100.0, "strong": 350.0}  # A_thix [Pa/s], on either side of rho g w / sqrt(3) = 283 Pa/s
SPREAD = 0.04  # plastic growth of the foot's section that counts as yielding [-]


def scenarios(spacing: float) -> dict[str, Scenario]:
    thick = 2 * spacing
    layers = math.ceil(TIME * RISE / thick)
    column = [
        {
            "kind": "cylinder",
            "center": [0, 0, (k + 0.5) * thick],
            "radius": RADIUS,
            "height": thick,
            "start": k * thick / RISE,
        }
        for k in range(layers)
    ]
    return {
        label: define(
            f"buildability_{label}",
            domain={"lower": [0, 0, 0], "upper": [0.03, 0.03, 0.085], "walls": {"z_lower": "slip"}},
            material={
                "density": 1000.0,
                "sound_speed": 10.0,
                "youngs_modulus": YOUNG,
                "poisson_ratio": POISSON,
                "yield_stress": YIELD,
                "plastic_viscosity": 5.0,
                "cure": {"kind": "linear", "time": TIME, "yield_stress": YIELD + rate * TIME},
            },
            bodies=column,
            duration=TIME,
            output_interval=TIME / 70,
            spacing=spacing,
            numerics={"mpm": {"grid_ratio": 1.5}},
        )
        for label, rate in RATES.items()
    }


def spread_of(run: Run) -> np.ndarray:
    """Growth of the section of the lowest layer at every output, without its elastic part, shape (n,) [-]."""
    count = int((run.frames[0]["birth_time"] == 0.0).sum())  # snapshots are in the order of creation
    moment = np.array([(frame["position"][:count, :2].astype(float) ** 2).sum() for frame in run.frames])
    return moment / moment[0] - 1.0 - 2.0 * POISSON * WEIGHT * RISE * run.times / YOUNG


def evaluate(runs: dict[str, Run]) -> Finding:
    """Height at which the foot yields, against a slice that carries rho g w t; the strong column must never yield."""
    clock, foot = runs["weak"].times, spread_of(runs["weak"])
    thin = WEIGHT * RISE - (1.0 + SPREAD) * math.sqrt(3.0) * RATES["weak"]
    wanted = RISE * (1.0 + SPREAD) * math.sqrt(3.0) * YIELD / thin
    yielded = np.flatnonzero(foot > SPREAD)
    seen = math.inf
    if len(yielded):  # the first is not the beginning, at which nothing has spread
        between = slice(yielded[0] - 1, yielded[0] + 1)
        seen = RISE * float(np.interp(SPREAD, foot[between], clock[between]))
    held = float(spread_of(runs["strong"]).max())
    layer = 2.0 * runs["weak"].scenario.spacing
    error = max(abs(seen - wanted) - layer, 0.0) / wanted if held < SPREAD else math.inf
    numbers = (
        Number("height at which the foot has spread by 4 % [m]", seen, wanted),
        Number("spread of the strong column's foot", held, 0.0),
    )
    section = WEIGHT * RISE * clock / (math.sqrt(3.0) * (YIELD + RATES["weak"] * clock))
    curve = Curve("foot", "time [s]", "growth of its section", clock, foot, clock, np.maximum(section - 1.0, 0.0))
    return Finding(error, numbers, (curve,))


CASE = Case(
    "buildability_rate",
    "how high a column can be built before its foot yields",
    "process",
    "first yield at sqrt(3) tau_0 / (rho g w - sqrt(3) A_thix), or never; Roussel 2018, references.md, D",
    "(|H / H_ref - 1| beyond one layer); infinite if the strong column yields",
    spacing=RADIUS / 8,
    tolerance=0.10,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=RADIUS / 6,
)
