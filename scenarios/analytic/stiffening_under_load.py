"""A loaded column cures: stress and strain stay, for new bonds form without stress (curing does no work)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

from .self_weight_column import LENGTH, PERIOD, POISSON, YOUNG

STIFFER, ONSET = 10.0, 5 * PERIOD
CURES = {"jump": {"kind": "jump"}, "linear": {"kind": "linear", "time": PERIOD}}


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 4 * spacing
    return {
        label: define(
            f"stiffening_{label}",
            domain={"lower": [0, 0, 0], "upper": [side, side, 1.1 * LENGTH], "walls": {"z_lower": "slip"}},
            material={
                "density": 1000.0,
                "youngs_modulus": YOUNG,
                "poisson_ratio": POISSON,
                "viscosity": 100.0,
                "cure": cure | {"delay": ONSET, "youngs_modulus": STIFFER * YOUNG},
            },
            bodies=[{"kind": "box", "center": [side / 2, side / 2, LENGTH / 2], "size": [side, side, LENGTH]}],
            duration=8 * PERIOD,
            output_interval=PERIOD / 16,
            spacing=spacing,
        )
        for label, cure in CURES.items()
    }


def evaluate(runs: dict[str, Run]) -> Finding:
    """Settlement of the top long after the cure, against the settlement before it: sigma / E0, not sigma / E1."""
    numbers, curves, worst = [], [], 0.0
    for label, run in runs.items():
        rest = run.frames[0]["position"][:, 2].astype(float)
        top = rest > rest.max() - 0.5 * run.scenario.spacing
        sunk = np.array([float((rest - frame["position"][:, 2])[top].mean()) for frame in run.frames]) / LENGTH
        clock = run.times / PERIOD
        before = float(sunk[(clock > 4) & (clock < 5.01)].mean())
        after = float(sunk[clock > 7].mean())
        numbers.append(Number(f"settlement over L after the cure, {label}", after, before))
        curves.append(
            Curve(label, "time over 4 L / c", "settlement / L", clock, sunk, clock, np.full(len(clock), before))
        )
        worst = max(worst, abs(after / before - 1.0))
    return Finding(worst, tuple(numbers), tuple(curves))


CASE = Case(
    "stiffening_under_load",
    "a column that cures under its own weight",
    "process",
    "d sigma = E(t) d eps: strain stays sigma / E0; references.md, E",
    "relative change of the settlement by the cure",
    spacing=LENGTH / 25,
    tolerance=0.05,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=LENGTH / 16,
)
