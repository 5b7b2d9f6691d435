"""Collapse of a water column on a dry bed (experiment of Martin & Moyce 1952)."""

import numpy as np

from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Curve, Finding, Number, Run

A = 0.05715


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"column": load("dam_break", {"spacing": spacing})}


def evaluate(runs: dict[str, Run]) -> Finding:
    """RMS of the front over 0.84 <= T <= 3.33 after the best shift of the gate's clock."""
    run, data = runs["column"], table("dam_break_martin_moyce_front_n2_2")
    answer = next(a for a in run.record.answers if a.quantity.startswith("front"))
    fronts = run.series["front_x_m"].to_numpy() / A
    curve = Curve(
        "front",
        "T = t sqrt(2 g / a)",
        "Z = x / a",
        run.series["time_s"].to_numpy() * np.sqrt(2 * 9.81 / A),
        fronts,
        data["T"].to_numpy(),
        data["Z"].to_numpy(),
    )
    return Finding(answer.error, (Number(answer.quantity, answer.measured, answer.reference),), (curve,))


CASE = Case(
    "dam_break",
    "collapse of a water column on a dry bed",
    "liquid",
    "Martin & Moyce 1952 (experiment)",
    "RMS of (Z - Z_ref) / Z_ref",
    spacing=A / 24,
    tolerance=0.08,
    scenarios=scenarios,
    evaluate=evaluate,
)
