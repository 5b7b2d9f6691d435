"""An Oldroyd-B drop hits a floor, spreads and recoils (two published computations).

The rim that rolls onto the floor is a cell thick: MPM gets small cells, with two particles each.
"""

import numpy as np

from fluidbench.measure.ledger import deposit_of
from fluidbench.measure.profiles import relative_l1, widest_diameter
from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

DIAMETER, SPEED, ETA, RELAXATION, BETA = 0.02, 1.0, 4.0, 0.02, 0.1


def scenarios(spacing: float) -> dict[str, Scenario]:
    modulus = ETA * (1 - BETA) / RELAXATION
    drop = define(
        "oldroyd_drop_impact",
        domain={"lower": [0, 0, 0], "upper": [0.024, 0.024, 0.054], "walls": {"z_lower": "stick"}},
        material={
            "density": 1000.0,
            "sound_speed": 15.0,
            "youngs_modulus": 2.9 * modulus,
            "poisson_ratio": 0.45,
            "relaxation_time": RELAXATION,
            "viscosity": ETA * BETA,
        },
        bodies=[{"kind": "sphere", "center": [0, 0, 2 * DIAMETER], "radius": DIAMETER / 2, "velocity": [0, 0, -SPEED]}],
        duration=5 * DIAMETER / SPEED,
        output_interval=0.1 * DIAMETER / SPEED,
        spacing=spacing,
        numerics={"mpm": {"grid_ratio": 1.25}},
    )
    return {"drop": drop}


def evaluate(runs: dict[str, Run]) -> Finding:
    """E1 of the largest diameter for 1.5 <= t U / D <= 5."""
    run, data = runs["drop"], table("oldroyd_b_drop_impact_axisymmetric")
    clock = run.times * SPEED / DIAMETER
    wide = np.array([widest_diameter(deposit_of(frame, run.scenario), 0.25) for frame in run.frames]) / DIAMETER
    best = data[["D_figueiredo", "D_basilisk"]].mean(axis=1).to_numpy()
    late = (clock >= 1.5) & (clock <= data["t"].iloc[-1])
    numbers = (
        Number("largest spread", float(wide.max()), 1.715),
        Number("at t U / D", float(clock[wide.argmax()]), 2.1),
        Number("recoil", float(wide[(clock > 2.5) & (clock < 4.2)].min()), 1.453),
    )
    curve = Curve("diameter", "t U / D", "D(t) / D", clock, wide, data["t"].to_numpy(), best)
    return Finding(relative_l1(wide[late], np.interp(clock[late], data["t"], best)), numbers, (curve,))


CASE = Case(
    "oldroyd_drop_impact",
    "an Oldroyd-B drop hitting a floor",
    "viscoelastic",
    "Figueiredo et al. 2016 and Basilisk (two computations)",
    "E1 of the largest diameter, 1.5 <= t U / D <= 5",
    spacing=DIAMETER / 32,
    tolerance=0.05,
    fine_tolerance=0.03,
    scenarios=scenarios,
    evaluate=evaluate,
)
