"""A strip spreads on a no-slip floor while its viscosity grows without bound: cure decides the width of a bead.

The strip is half as high as wide to its middle, as in viscous_release: lubrication theory is 15 to 20 % off, with and
without cure, for one that is twice as high (references.md, F).
"""

import math

import numpy as np

from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HALF, HEIGHT, NU, G, TIME = 0.01, 0.005, 5e-4, 9.81, 0.6
LATE = 3.0  # end of the run in time constants
UNIT = 3 * NU * HALF**2 / (G * HEIGHT**3)  # s at t* = 1 with the fresh viscosity


def scenarios(spacing: float) -> dict[str, Scenario]:
    slab = 6 * spacing
    viscosity = 1000.0 * NU
    strip = define(
        "curing_bead_arrest",
        domain={
            "lower": [0, 0, 0],
            "upper": [0.024, slab, 0.00625],
            "walls": {"z_lower": "stick", "y_lower": "periodic", "y_upper": "periodic"},
        },
        material={
            "density": 1000.0,
            "viscosity": viscosity,
            "sound_speed": 2.3,
            "cure": {
                "kind": "linear",
                "time": LATE * TIME,
                "viscosity": viscosity * math.exp(LATE),
                "interpolation": "geometric",
            },
        },
        bodies=[{"kind": "box", "center": [0, slab / 2, HEIGHT / 2], "size": [2 * HALF, slab, HEIGHT]}],
        duration=LATE * TIME,
        output_interval=TIME / 10,
        spacing=spacing,
    )
    return {"strip": strip}


def spent(time: np.ndarray) -> np.ndarray:
    """s = integral of nu0 / nu dt [s]: all that lubrication theory knows of time."""
    return TIME * (1.0 - np.exp(-time / TIME))


def evaluate(runs: dict[str, Run]) -> Finding:
    """Half width at the end, against the release of this very shape at t* = s / unit; it must have come to rest."""
    run, exact = runs["strip"], table("viscous_current_slab_release_plane")
    clock = run.series["time_s"].to_numpy()
    front = run.series["front_x_m"].to_numpy()
    wanted = HALF * np.interp(spent(clock) / UNIT, exact["t_star"], exact["xN_over_X0"])
    last = clock > (LATE - 0.5) * TIME
    creep = float(np.polyfit(clock[last], front[last], 1)[0]) / math.sqrt(G * HEIGHT)
    numbers = (
        Number("final half width [m]", float(front[-1]), float(wanted[-1])),
        Number("front speed at the end over sqrt(g H)", creep, 0.0),
    )
    curve = Curve("front", "time [s]", "half width [m]", clock, front, clock, wanted)
    return Finding(abs(float(front[-1] / wanted[-1]) - 1.0), numbers, (curve,))


CASE = Case(
    "curing_bead_arrest",
    "a strip that spreads until its cure stops it",
    "process",
    "lubrication theory in s = integral nu0 / nu dt; Huppert 1982, references.md, F",
    "relative error of the final half width",
    spacing=HEIGHT / 10,
    tolerance=0.08,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=HEIGHT / 6,
)
