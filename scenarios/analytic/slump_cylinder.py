"""Slump of a yield-stress cylinder on a rough floor (two independent computations)."""

import numpy as np

from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, WEIGHT = 0.1, 981.0  # H [m], rho g H [Pa]
STRESSES = (0.1, 0.2, 0.3)  # tau' = tau_y / (rho g H)


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {
        f"{tau}": load("column_slump", {"spacing": spacing, "material.yield_stress": tau * WEIGHT}) for tau in STRESSES
    }


def evaluate(runs: dict[str, Run]) -> Finding:
    """Largest |s' - s'_ref| over the yield stresses."""
    data = table("viscoplastic_slump_crosscheck")
    best = data[["slump_vof", "slump_mpm_extrap"]].mean(axis=1).to_numpy()
    seen = np.array([run.record.measures["slump"] for run in runs.values()])
    wanted = np.interp(STRESSES, data["tau_prime"], best)
    numbers = tuple(Number(f"slump at tau' = {t}", a, b) for t, a, b in zip(STRESSES, seen, wanted, strict=True))
    x = np.sqrt(3.0) * data["tau_prime"]
    slices = Number(
        "slice theory (von Mises) at tau' = 0.3", float(seen[-1]), float(1 - x.iloc[-1] * (1 - np.log(x.iloc[-1])))
    )
    curve = Curve("slump", "tau'", "slump s'", np.array(STRESSES), seen, data["tau_prime"].to_numpy(), best)
    return Finding(float(np.abs(seen - wanted).max()), (*numbers, slices), (curve,))


CASE = Case(
    "slump_cylinder",
    "slump of a yield-stress cylinder on a rough floor",
    "yield stress",
    "two computations in viscoplastic_slump_crosscheck.csv; classical theory: Murata 1984, Pashias et al. 1996",
    "largest |s' - s'_ref| over tau' = 0.1, 0.2, 0.3",
    spacing=HEIGHT / 24,
    tolerance=0.07,
    fine_tolerance=0.04,
    scenarios=scenarios,
    evaluate=evaluate,
)
