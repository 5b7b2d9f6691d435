"""Pressure that drives a liquid through a nozzle's bore, in creeping flow (exact)."""

import numpy as np

from fluidbench.method.frame import FREE, Frame
from fluidbench.scenario import Scenario
from fluidbench.scenario.bore import Bore
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

DIAMETER, SPEED, DENSITY = 0.01, 0.01, 1000.0
VISCOSITY = 2.0  # Re = 0.05
LENGTH = 2.0  # of the bore, over D
WITHIN = 1.0, 0.6  # middle and half length of where the gradient is taken: away from mouth and feed, over D
GAP = 1.5  # over D
TIME = 3.0  # D / U
LAST = 20  # frames, of 30


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"liquid": flow({"viscosity": VISCOSITY}, spacing)}


def flow(material: dict[str, float], spacing: float) -> Scenario:
    """Through a nozzle that stands still."""
    d, end = DIAMETER, TIME * DIAMETER / SPEED
    return define(
        "bore_flow",
        domain={"lower": [-2 * d, -2 * d, 0], "upper": [2 * d, 2 * d, (GAP + LENGTH) * d + 14 * spacing]},
        material={"density": DENSITY, **material},
        gravity=[0.0, 0.0, 0.0],
        nozzle={"diameter": d, "exit_speed": SPEED, "standoff": GAP * d, "tip": "flat", "bore": LENGTH * d},
        toolpath={"kind": "line", "start": [0.0, 0.0], "end": [1e-6, 0.0], "speed": 1e-6 / end},
        duration=0.98 * end,
        output_interval=end / 30,
        spacing=spacing,
        sound_speed_ratio=5.0,
        numerics={"mpm": {"grid_ratio": 1.0}},
    )


def within(frame: Frame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Height above the exit and distance from the axis [m] of what flows well inside the bore, and which that is."""
    height = frame["position"][:, 2].astype(float) - GAP * DIAMETER
    radius = np.hypot(frame["position"][:, 0], frame["position"][:, 1]).astype(float)
    inside = (frame["held"] == FREE) & (radius < DIAMETER / 2) & (np.abs(height / DIAMETER - WITHIN[0]) < WITHIN[1])
    return height[inside], radius[inside], inside


def evaluate(runs: dict[str, Run]) -> Finding:
    """|(dp/dz) / (4 tau_w / D) - 1|, of a line through the pressures by least squares, mean over the last frames."""
    ((name, run),) = runs.items()
    bore = Bore(run.scenario.material, DIAMETER, SPEED)
    found = []
    for frame in run.frames[-LAST:]:
        height, radius, inside = within(frame)
        found.append(np.polyfit(height, frame["pressure"][inside].astype(float), 1)[0])
    wanted = bore.pressure_drop(1.0)
    number = Number(f"pressure gradient of the {name} [Pa/m]", float(np.mean(found)), wanted)
    speed = -frame["velocity"][inside, 2].astype(float)
    order, across = np.argsort(radius), np.linspace(0.0, DIAMETER / 2, 61)
    exact = SPEED * bore.profile(across)
    curve = Curve(f"speed of the {name}", "r [m]", "u [m/s]", radius[order], speed[order], across, exact)
    return Finding(abs(float(np.mean(found)) / wanted - 1.0), (number,), (curve,))


CASE = Case(
    "bore_flow",
    "pressure that drives a liquid through a bore",
    "emission",
    "exact: Hagen-Poiseuille",
    "|dp/dz / (4 tau_w / D) - 1|",
    spacing=DIAMETER / 12,  # with 8 across SPH's wall drags 10 % too much (docs/physics/sph.md)
    tolerance=0.10,
    scenarios=scenarios,
    evaluate=evaluate,
    skipped={"pbd": "it has no pressure"},
)
