"""A bar swinging along its axis between slip walls: elastic waves and numerical damping (exact)."""

import math

import numpy as np

from fluidbench.measure.profiles import period
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

LENGTH, YOUNG, POISSON = 0.5, 1e6, 0.3
C = np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / 1000.0)
PERIOD, PERIODS, SPEED = 4 * LENGTH / C, 5, 1e-3 * C
K = np.pi / (2 * LENGTH)


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 4 * spacing
    body = {
        "kind": "box",
        "center": [LENGTH / 2, side / 2, side / 2],
        "size": [LENGTH, side, side],
        "wave": {"amplitude": [SPEED, 0, 0], "number": [K, 0, 0], "phase": K * LENGTH / 2},
    }
    bar = define(
        "bar_vibration",
        domain={"lower": [0, 0, 0], "upper": [LENGTH + 10 * spacing, side, side], "walls": {"z_lower": "slip"}},
        bodies=[body],
        material={"density": 1000.0, "youngs_modulus": YOUNG, "poisson_ratio": POISSON},
        gravity=[0.0, 0.0, 0.0],
        duration=PERIODS * PERIOD,
        output_interval=PERIOD / 24,
        spacing=spacing,
    )
    return {"bar": bar}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Period of the first mode, infinite where it does not swing, and how much of its amplitude is left after five."""
    run = runs["bar"]
    mode = np.sin(K * run.frames[0]["position"][:, 0].astype(float))
    swing = np.array([(frame["velocity"][:, 0] * mode).sum() for frame in run.frames]) / np.square(mode).sum() / SPEED
    seen = period(run.times, swing)
    seen = seen if math.isfinite(seen) else math.inf
    left = float(np.abs(swing[-24:]).max())
    numbers = (
        Number("period [s]", seen, PERIOD),
        Number("amplitude left after five periods", left, 1.0),
        Number("numerical viscosity over c L", -2 * np.log(left) / (K**2 * PERIODS * PERIOD * C * LENGTH), 0.0),
    )
    exact = np.cos(2 * np.pi * run.times / PERIOD)
    curve = Curve("mode", "time [s]", "modal velocity / V0", run.times, swing, run.times, exact)
    return Finding(abs(seen / PERIOD - 1.0), numbers, (curve,))


CASE = Case(
    "bar_vibration",
    "a bar swinging along its axis",
    "elastic",
    "exact; d'Alembert, references.md, E",
    "relative error of the period 4 L / c",
    spacing=LENGTH / 50,
    tolerance=0.01,
    fine_tolerance=0.005,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=LENGTH / 50,
)
