"""Final shape of a soft yield-stress deposit (second-order theory of thin deposits)."""

import numpy as np

from fluidbench.measure.ledger import deposit_of
from fluidbench.measure.profiles import relative_l2
from fluidbench.measure.reference import table
from fluidbench.measure.slump import radial_heights
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, TAU = 0.1, 0.05
LATE = 8.0  # [s]; after 2 s the front still goes at 4 mm/s with MPM, after this no method's at more than 0.2


def scenarios(spacing: float) -> dict[str, Scenario]:
    settings = {"spacing": spacing, "material.yield_stress": TAU * 981.0, "duration": LATE}
    return {"deposit": load("column_slump", settings)}


def profile(radius: np.ndarray, front: float) -> np.ndarray:
    """h = p + sqrt(p^2 + 2 B (R - r)), B = tau_y / (rho g), p = sqrt(3) pi B / 4 [m]; zero beyond R."""
    b = TAU * HEIGHT
    p = np.sqrt(3.0) * np.pi * b / 4.0
    return np.where(radius <= front, p + np.sqrt(p * p + 2.0 * b * np.maximum(front - radius, 0.0)), 0.0)


def evaluate(runs: dict[str, Run]) -> Finding:
    """|R - R_ref| / R_ref against the volume-of-fluid computation, and the theory's profile apart from the last 2 d."""
    run = runs["deposit"]
    data = table("viscoplastic_slump_crosscheck").set_index("tau_prime").loc[TAU]
    front = run.record.measures["spread_radius_m"]
    radius, height = radial_heights(deposit_of(run.frames[-1], run.scenario), 0.0, 0.0)
    inside = radius < data["spread_vof"] * HEIGHT - 2 * run.scenario.spacing
    theory = profile(radius, data["spread_second"] * HEIGHT)
    shape = relative_l2(height[inside], theory[inside])
    numbers = (
        Number("R / H", front / HEIGHT, float(data["spread_vof"])),
        Number("R / H, second-order theory", front / HEIGHT, float(data["spread_second"])),
        Number("slump", run.record.measures["slump"], float(data["slump_vof"])),
        Number("E2 of the profile against the theory", shape, 0.0),
    )
    curve = Curve("profile", "r [m]", "h [m]", radius, height, radius, theory)
    off = abs(front / HEIGHT / float(data["spread_vof"]) - 1.0)
    return Finding(max(off, 0.8 * shape), numbers, (curve,))


CASE = Case(
    "spread_deposit",
    "final shape of a soft yield-stress deposit",
    "yield stress",
    "volume-of-fluid computation (viscoplastic_slump_crosscheck.csv); Roussel & Coussot 2005, Dubash et al. 2009",
    "worse of |R / R_ref - 1| and 4/5 of the profile's E2, tau' = 0.05",
    spacing=HEIGHT / 20,
    tolerance=0.08,
    scenarios=scenarios,
    evaluate=evaluate,
)
