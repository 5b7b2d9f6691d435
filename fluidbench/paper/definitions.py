"""What each word of the published table means: the sets and thresholds of the rules, fixed before the runs."""

from __future__ import annotations

METHODS = ("mpm", "sph", "pbd")

CONFIRMED, REFUTED, OPEN = "confirmed", "refuted", "not decidable"
EFFECT = 1.2  # two figures that differ by less than this factor count as equal
GOOD, POOR = 0.75, 0.5  # share of known answers within tolerance that is high fidelity, or low
FEWEST = 2  # known answers that a verdict on a class needs
APART = 0.1  # relative difference of two lengths that counts as disagreement
COLLAPSE = 10.0  # factor by which a step must shrink to count as collapsed
ARTIFACT = 0.01  # share of the bead's area that an artifact must reach
JUDGED = ("coarse", "quick")  # levels at which a known answer counts
TOLERANCES = (0.5, 2.0)  # factors on every tolerance under which a verdict is tried again

DEFORMABLE = ("viscous", "yield stress", "elastic", "viscoelastic")
LIQUIDS = ("liquid",)
FLUIDS = ("yield stress", "viscoelastic")  # viscoelastoplastic: what yields, and what relaxes

COST_PLACES = {"mpm": ("mid-high", "upper"), "sph": ("high", "highest"), "pbd": ("low", "lowest")}
"""Each method's cost in the paper's word, and its place among the three."""
COST_CASES = ("dam_break", "elliptic_drop", "bead_area", "viscous_column_slip", "oldroyd_drop_impact")
"""Known answers that every method is run on at several spacings: error against cost."""
PREVIEWS = (2.0, 8 / 3)  # spacings over the scenario's at which a preview is tried, beside 1 and 4/3

SURFACES = ("dam_break", "elliptic_drop", "oscillating_drop")
STRUCTURE = (
    "bar_vibration",
    "buildability_rate",
    "cantilever_sag",
    "collapse_threshold",
    "self_weight_column",
    "slump_cylinder",
    "slump_slip",
    "stiffening_under_load",
)
CURING = ("buildability_rate", "curing_bead_arrest", "stiffening_under_load")
ELASTIC = ("bar_vibration", "cantilever_sag", "self_weight_column")
DEFORMATION = ("slump_cylinder", "self_weight_column", "cantilever_sag", "viscous_column_slip")
COLLAPSING = ("collapse_threshold", "slump_slip", "buildability_rate")
STRANDS = "strand_newtonian"  # widths of pressed strands, on which PBD alone is asked

RULES = {
    "fidelity": f"high or good: at least {GOOD:.0%} of the known answers of the class within tolerance; not accurate: "
    f"at most {POOR:.0%}; a class needs {FEWEST} of them. Beside it: the error at equal cost",
    "step": f"methods ordered by the largest dt over d/c that a thrown lump survives, at two spacings; a place needs a "
    f"factor of {EFFECT:g} and two standard deviations",
    "equal error": f"ordered by the time to reach the error that all three reach (of a method that was never so far "
    f"off, of its cheapest run), a factor of {EFFECT:g} apart, on most of at least {FEWEST} cases",
    "cost": f"methods ordered by the figure; a place needs a factor of {EFFECT:g}, and means more than two standard "
    "deviations of the repeats apart. Time is CPU time on a CPU, where a run has one thread, and wall time on a GPU",
    "best": "the method that is cheapest, among those within tolerance, on most known answers of the class",
    "real time": f"the most particles at which a simulated second takes no more than one (a power law through four "
    f"spacings of the scenario): PBD's are {EFFECT:g} times as many as any other method's",
    "collapse": f"the step shrinks at least {COLLAPSE:g}-fold from one end to the other",
    "artifacts": f"at 1 particle a cell the run blows up, or the bead's area is {EFFECT:g} times as far off as at 8 "
    f"and 27 and over {ARTIFACT:.0%}, on both of two grids",
    "prediction": f"most of at least {FEWEST} known answers missed; for the bead's width, over {APART:.0%} off in most "
    "places: a free bead at two spacings beside the mean of the other two methods (which must agree as well), and "
    "pressed strands beside their reference, where that was run",
    "reliable": "a larger share of the known answers within tolerance than either of the others",
    "struggles": f"less than {GOOD:.0%} of the known answers on either within tolerance",
}
"""A verdict that rests on what says nothing of its method is open; one that the other language, the other scheme of
viscosity, another device or another seed does not repeat says so."""
