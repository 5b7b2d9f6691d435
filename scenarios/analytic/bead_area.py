"""Cross-section of a steady bead: that of the matter which lies there, Q / V (exact)."""

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Finding, Number, Run


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"bead": load("line_bead", {"spacing": spacing})}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Worse of |A / (m/rho) - 1| and |(m/rho) / (Q/V) - 1| over the middle of the track; emitted mass in layers."""
    answers = {a.quantity: a for a in runs["bead"].record.answers}
    area, matter, mass = (answers[q] for q in ("bead area [m^2]", "bead matter [m^2]", "emitted mass [kg]"))
    measures = runs["bead"].record.measures
    numbers = (
        Number("bead area [m^2]", area.measured, area.reference),
        Number("bead matter [m^2]", matter.measured, matter.reference),
        Number("emitted mass [kg]", mass.measured, mass.reference),
        Number("bead width [m]", measures["bead_width_m"], float("nan")),
        Number("bead height [m]", measures["bead_height_m"], float("nan")),
    )
    return Finding(max(area.error, matter.error), numbers)


CASE = Case(
    "bead_area",
    "cross-section of a steady bead of paste",
    "emission",
    "exact; conservation of volume",
    "worse of |A / (m/rho) - 1| and |(m/rho) / (Q/V) - 1|",
    spacing=1.5e-3,
    tolerance=0.02,
    causes={"mpm": "its skin is 4 to 8 % too dense a spacing deep, at every spacing, and a little of it lies outside"},
    scenarios=scenarios,
    evaluate=evaluate,
    quick=1.5e-3,
)
