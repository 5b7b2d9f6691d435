"""Width of a strand laid through a gap narrower than the nozzle (mass balance with rounded edges).

Gravity is a tenth of the earth's: enough to lay the strand down, too little to spread it in the time of the run.
"""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

NOZZLE, GAP, SPEED, LENGTH = 0.008, 0.0048, 0.04, 0.06
AREA = np.pi / 4 * NOZZLE**2
WIDTH = AREA / GAP + (1 - np.pi / 4) * GAP


def scenarios(spacing: float) -> dict[str, Scenario]:
    strand = define(
        "bead_strand_shape",
        domain={"lower": [-0.02, -0.02, 0], "upper": [0.08, 0.02, 0.02]},
        material={"density": 1000.0, "viscosity": 5.0, "sound_speed": 2.0},
        gravity=[0.0, 0.0, -1.0],
        nozzle={"diameter": NOZZLE, "exit_speed": SPEED, "standoff": GAP},
        toolpath={"kind": "line", "start": [0.0, 0.0], "end": [LENGTH, 0.0], "speed": SPEED},
        duration=LENGTH / SPEED,
        output_interval=LENGTH / SPEED / 10,
        spacing=spacing,
    )
    return {"strand": strand}


def evaluate(runs: dict[str, Run]) -> Finding:
    """|W - W_ref| / W_ref over the middle 60 % of the track."""
    measures = runs["strand"].record.measures
    numbers = (
        Number("width [m]", measures["bead_width_m"], WIDTH),
        Number("height [m]", measures["bead_height_m"], GAP),
        Number("area [m^2]", measures["bead_area_m2"], AREA),
    )
    return Finding(abs(measures["bead_width_m"] / WIDTH - 1.0), numbers)


CASE = Case(
    "bead_strand_shape",
    "width of a viscous strand laid through a narrow gap",
    "emission",
    "rounded rectangle of height g: W = A/g + (1 - pi/4) g; Xu, Agassant & Pigeonneau 2022",
    "|W / W_ref - 1|",
    spacing=NOZZLE / 8,
    tolerance=0.10,
    scenarios=scenarios,
    evaluate=evaluate,
    causes=dict.fromkeys(
        ("mpm", "sph", "pbd"), "not understood; suspected: no nozzle face presses the strand from above"
    ),
)
