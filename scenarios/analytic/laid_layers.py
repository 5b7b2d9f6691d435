"""Two beads laid on each other: they fuse without a gap between, so their section is that of their matter (exact)."""

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.study.case import Case, Finding, Number, Run

LAYERS = 2


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {"wall": load("wall", {"spacing": spacing, "toolpath.layers": LAYERS, "duration": 2.0})}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Worst of |A / (m/rho) - 1| and |(m/rho) / (Q/V) - 1| over the middle of the path, a layer, and of how densely
    particles lie, |packing - 1|, where beads are wide enough to tell (8 spacings are): a gap within is part of no
    contour."""
    record = runs["wall"].record
    answers = {a.quantity: a for a in record.answers}
    area, matter = (answers[q] for q in ("bead area [m^2]", "bead matter [m^2]"))
    packing = record.measures.get("packing")
    told = () if packing is None else (Number("packing [-]", packing, 1.0),)
    numbers = (
        Number("section of a layer [m^2]", area.measured, area.reference),
        Number("matter of a layer [m^2]", matter.measured, matter.reference),
        *told,
    )
    return Finding(max(area.error, matter.error, *(abs(n.measured - n.reference) for n in told)), numbers)


CASE = Case(
    "laid_layers",
    "two beads of paste, one on the other",
    "emission",
    "exact; conservation of volume",
    "worst of |A / (m/rho) - 1|, |(m/rho) / (Q/V) - 1| and |packing - 1|",
    spacing=1.5e-3,
    tolerance=0.05,
    scenarios=scenarios,
    evaluate=evaluate,
)
