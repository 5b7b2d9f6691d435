"""A slender yield-stress column sinks on a slip floor (slice theory, nearly exact without base friction)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, RADIUS, WEIGHT, TAU = 0.1, 0.025, 981.0, 0.3


def column(name: str, tau: float | None, spacing: float, duration: float) -> Scenario:
    """A quarter of a cylinder, H / R = 4, between symmetry planes on a slip floor; tau = None never yields."""
    paste = {} if tau is None else {"yield_stress": tau * WEIGHT, "plastic_viscosity": 30.0}
    return define(
        name,
        domain={"lower": [0, 0, 0], "upper": [0.06, 0.06, 0.11], "walls": {"z_lower": "slip"}},
        material={"density": 1000.0, "sound_speed": 10.0, "youngs_modulus": 7e4, "poisson_ratio": 0.45, **paste},
        bodies=[{"kind": "cylinder", "center": [0, 0, HEIGHT / 2], "radius": RADIUS, "height": HEIGHT}],
        duration=duration,
        output_interval=duration / 30,
        spacing=spacing,
        numerics={"mpm": {"grid_ratio": 1.5}},
    )


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"column": column("slump_slip", TAU, spacing, 1.5)}


def evaluate(runs: dict[str, Run]) -> Finding:
    """|s' - s'_ref| with s' = 1 - x (1 - ln x), x = sqrt(3) tau' (von Mises)."""
    run = runs["column"]
    x = np.sqrt(3.0) * TAU
    wanted = float(1 - x * (1 - np.log(x)))
    seen = run.record.measures["slump"]
    clock, slump = run.series["time_s"].to_numpy(), run.series["slump"].to_numpy()
    curve = Curve("slump", "time [s]", "slump s'", clock, slump, clock, np.full_like(clock, wanted))
    return Finding(abs(seen - wanted), (Number("slump s'", seen, wanted),), (curve,))


CASE = Case(
    "slump_slip",
    "a slender yield-stress column sinking on a slip floor",
    "yield stress",
    "slice theory, error (R/H)^2/2 and bulging; Pashias et al. 1996, von Mises",
    "|s' - s'_ref| at tau' = 0.3",
    spacing=HEIGHT / 32,
    tolerance=0.05,
    scenarios=scenarios,
    evaluate=evaluate,
)
