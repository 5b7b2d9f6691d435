"""Start-up of plane Poiseuille flow of an Oldroyd-B liquid (exact; Waters & King 1970)."""

import numpy as np

from fluidbench.measure.profiles import relative_l2
from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HALF, NU, BETA, SPEED = 0.01, 1e-2, 0.1, 0.02  # half width [m], nu0 [m^2/s], solvent share, steady centre speed [m/s]
RELAXATION = HALF**2 / NU  # E = lambda nu0 / b^2 = 1
UNIT = HALF**2 / NU


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 8 * spacing
    walls = {f"{axis}_{end}": "periodic" for axis in "xz" for end in ("lower", "upper")}
    modulus = 1000.0 * NU * (1 - BETA) / RELAXATION
    channel = define(
        "oldroyd_startup",
        domain={
            "lower": [0, 0, 0],
            "upper": [side, HALF, side],
            "walls": {**walls, "y_lower": "stick", "y_upper": "slip"},
        },
        material={
            "density": 1000.0,
            "sound_speed": 5.0,
            "youngs_modulus": 2.9 * modulus,
            "poisson_ratio": 0.45,
            "relaxation_time": RELAXATION,
            "viscosity": 1000.0 * NU * BETA,
        },
        bodies=[{"kind": "box", "center": [side / 2, HALF / 2, side / 2], "size": [side, HALF, side]}],
        gravity=[0.0, 0.0, 0.0],
        body_force=[2 * NU * SPEED / HALF**2, 0.0, 0.0],
        duration=6 * UNIT,
        output_interval=0.1 * UNIT,
        spacing=spacing,
    )
    return {"channel": channel}


def evaluate(runs: dict[str, Run]) -> Finding:
    """E2 of the centre velocity over time: it overshoots to 1.72, undershoots to 0.82."""
    run, exact = runs["channel"], table("oldroyd_b_poiseuille_startup_E1_beta0p1")
    d = run.scenario.spacing
    centre = (
        np.array([float(frame["velocity"][frame["position"][:, 1] > HALF - d, 0].mean()) for frame in run.frames])
        / SPEED
    )
    clock = run.times / UNIT
    wanted = np.interp(clock, exact["t_star"], exact["u_centre_over_u_inf"])
    seen = clock >= exact["t_star"].iloc[0]
    numbers = (
        Number("overshoot", float(centre.max()), 1.720),
        Number("time of the overshoot in b^2 / nu0", float(clock[centre.argmax()]), 1.216),
        Number("undershoot", float(centre[clock > 2].min()), 0.820),
    )
    curve = Curve(
        "centre velocity",
        "t nu0 / b^2",
        "u / u_inf",
        clock,
        centre,
        exact["t_star"].to_numpy(),
        exact["u_centre_over_u_inf"].to_numpy(),
    )
    return Finding(relative_l2(centre[seen], wanted[seen]), numbers, (curve,))


CASE = Case(
    "oldroyd_startup",
    "start-up of flow of an Oldroyd-B liquid between plates",
    "viscoelastic",
    "exact; Waters & King 1970",
    "E2 of the centre velocity over time",
    spacing=HALF / 16,
    tolerance=0.03,
    fine_tolerance=0.03,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=HALF / 16,
)
