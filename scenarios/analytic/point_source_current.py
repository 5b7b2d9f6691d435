"""A viscous puddle fed at constant flux through a nozzle (lubrication theory; Huppert 1982)."""

import numpy as np

from fluidbench.measure.ledger import deposit_of
from fluidbench.measure.profiles import relative_l2
from fluidbench.measure.reference import table
from fluidbench.measure.slump import radial_heights, spread_radius
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

NOZZLE, FLUX, NU, G = 0.005, 2.34e-5, 1.4e-3, 9.81
THICK = (3 * NU * FLUX / G) ** 0.25  # h_s = 10 mm
UNIT = 3 * NU / (G * THICK)  # t_s [s]
END = 40.0


def scenarios(spacing: float) -> dict[str, Scenario]:
    puddle = define(
        "point_source_current",
        domain={"lower": [-0.06, -0.06, 0], "upper": [0.06, 0.06, 0.022]},
        material={"density": 1000.0, "viscosity": 1000.0 * NU},
        nozzle={"diameter": 2 * NOZZLE, "flow_rate": FLUX, "standoff": 0.015},
        toolpath={"kind": "line", "start": [0.0, 0.0], "end": [1e-6, 0.0], "speed": 1e-6 / (END * UNIT)},
        duration=END * UNIT,
        output_interval=UNIT,
        spacing=spacing,
    )
    return {"puddle": puddle}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Exponent of r_N for t > 10 t_s, its prefactor, and the profile for 0.2 < r / r_N < 0.9."""
    run, exact = runs["puddle"], table("viscous_current_constant_flux_profile")
    clock = run.times / UNIT
    deposits = [deposit_of(frame, run.scenario) for frame in run.frames]
    late = clock >= 10.0
    front = np.array([spread_radius(deposit, 0.0, 0.0) for deposit in deposits]) / THICK
    exponent = float(np.polyfit(np.log(clock[late]), np.log(front[late]), 1)[0])
    prefactor = float(np.mean(front[late] / np.sqrt(clock[late])))
    radius, height = radial_heights(deposits[-1], 0.0, 0.0)
    filled = float(deposits[-1].column_heights()[2].sum()) * deposits[-1].spacing ** 2
    share = radius / (front[-1] * THICK)
    inner = (share > max(0.2, 2 * NOZZLE / (front[-1] * THICK))) & (share < 0.9)
    wanted = np.interp(share[inner], exact["y"], exact["H"])
    numbers = (
        Number("exponent of r_N", exponent, 0.5),
        Number("r_N / (h_s sqrt(t / t_s))", prefactor, 0.71502),
        Number("E2 of the profile", relative_l2(height[inner] / THICK, wanted), 0.0),
        Number("volume of the puddle over that emitted", filled / (FLUX * float(run.times[-1])), 1.0),
        Number("front at the end [m]", float(front[-1] * THICK), 0.71502 * THICK * float(np.sqrt(clock[-1]))),
    )
    curves = (
        Curve("front", "t / t_s", "r_N / h_s", clock, front, clock, 0.71502 * np.sqrt(clock)),
        Curve(
            "profile",
            "r / r_N",
            "h / h_s",
            share[inner],
            height[inner] / THICK,
            exact["y"].to_numpy(),
            exact["H"].to_numpy(),
        ),
    )
    return Finding(max(abs(exponent - 0.5) * 0.05 / 0.03, abs(prefactor / 0.71502 - 1.0)), numbers, curves)


CASE = Case(
    "point_source_current",
    "a viscous puddle fed through a nozzle",
    "viscous",
    "lubrication theory; Huppert 1982",
    "worse of prefactor error and 5/3 of the error of the exponent",
    spacing=THICK / 6,
    tolerance=0.05,
    scenarios=scenarios,
    evaluate=evaluate,
)
