"""Cross-section of a steady bead: Q / V (exact)."""

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Finding, Number, Run


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"bead": load("line_bead", {"spacing": spacing})}


def evaluate(runs: dict[str, Run]) -> Finding:
    """|A / (Q/V) - 1| over the middle 60 % of the track; emitted mass in layers."""
    answers = {a.quantity: a for a in runs["bead"].record.answers}
    area, mass = answers["bead area [m^2]"], answers["emitted mass [kg]"]
    measures = runs["bead"].record.measures
    numbers = (
        Number("bead area [m^2]", area.measured, area.reference),
        Number("emitted mass [kg]", mass.measured, mass.reference),
        Number("bead width [m]", measures["bead_width_m"], float("nan")),
        Number("bead height [m]", measures["bead_height_m"], float("nan")),
    )
    return Finding(area.error, numbers)


CASE = Case(
    "bead_area",
    "cross-section of a steady bead of paste",
    "emission",
    "exact; conservation of volume",
    "|A / (Q/V) - 1|",
    spacing=1.5e-3,
    tolerance=0.02,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=1.5e-3,
)
