"""Two strands of mortar, one over the other, pressed by a nozzle's flat tip: how wide the lower one is, and how high
the notch in the outline of both, where they meet. The reference foretells outlines; it knows of no face within."""

import math

import numpy as np

from fluidbench.measure.deposit import Section, cut
from fluidbench.measure.ledger import deposit_of
from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

from .strand_concrete import mortar
from .strand_newtonian import mean_of

PUBLISHED = table("strand_two_layers_rizzieri").set_index("id").query("usable == 'yes'").T.to_dict()
LENGTH = 7.0  # of a strand, over D
MIDDLE = (2.75, 4.25, 7)  # from and to, over D, and how many sections between: both ends are far
# Times faster than printed, at a viscosity as much lower: stress over yield stress is as it was, but for inertia, which
# is rho V^2 = 54 Pa at most.
HASTE = 4.0
TOLERANCE = 0.15
COLUMNS = {"width": "w1", "height": "h1", "contact": "contact"}


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {name: strands(name, spacing) for name in PUBLISHED}


def strands(name: str, spacing: float) -> Scenario:
    """Back and forth over one path. It begins on a bar of the strand's section, and walls slip, as in
    strand_concrete."""
    row = PUBLISHED[name]
    d, gap, tau = row["nozzle_d_mm"] / 1e3, row["gap_mm"] / 1e3, float(row["yield_stress_pa"])
    travel, speed = HASTE * row["travel_mm_s"] / 1e3, HASTE * row["extrusion_mm_s"] / 1e3
    bar = [2.0 * d, math.pi / 4.0 * d * d * speed / (travel * gap), gap]
    half = 0.75 * bar[1] + d
    duration = 2.0 * LENGTH * d / travel + gap / travel
    return define(
        f"strand_two_layers_{name}",
        domain={
            "lower": [-3.0 * d, -half, 0.0],
            "upper": [(LENGTH + 2.5) * d, half, 2.0 * gap + d + 14 * spacing],
        },
        material=mortar(row["density_kg_m3"], tau, row["viscosity_pa_s"] / HASTE),
        bodies=[{"kind": "box", "center": [-0.5 * d, 0.0, bar[2] / 2], "size": bar}],
        nozzle={"diameter": d, "exit_speed": speed, "standoff": gap, "tip": "flat", "walls": "slip"},
        toolpath={
            "kind": "wall",
            "start": [0.0, 0.0],
            "end": [LENGTH * d, 0.0],
            "speed": travel,
            "layers": 2,
            "layer_height": gap,
        },
        duration=duration,
        output_interval=duration / 20,
        spacing=spacing,
    )


def outline(section: Section, gap: float) -> dict[str, float]:
    """Of two strands of height `gap` [m]: largest width below the notch, height and width of the notch, which is the
    narrowest place from half way up the lower one to half way up the other, and the area of both [m, m^2]."""
    widths = section.solid.sum(axis=0) * (section.across[1] - section.across[0])
    within = np.flatnonzero((section.up > 0.5 * gap) & (section.up < 1.5 * gap))
    narrowest = within[widths[within] == widths[within].min()]
    below = widths[: narrowest[0] + 1]
    return {
        "width": float(below.max()),
        "height": float(section.up[narrowest].mean()),
        "contact": float(widths[narrowest[0]]),
        "area": section.area,
    }


def measured(run: Run) -> dict[str, float]:
    """Means over the middle of the path at the end of a run."""
    scenario = run.scenario
    nozzle, domain = scenario.nozzle, scenario.domain
    assert nozzle is not None
    deposit = deposit_of(run.frames[-1], scenario)
    gap = nozzle.standoff
    along, places = np.array([1.0, 0.0]), nozzle.diameter * np.linspace(*MIDDLE)
    cuts = [cut(deposit, np.array([x, 0.0]), along, domain.upper[1], 2.5 * gap, 0.0) for x in places]
    found = [outline(section, gap) for section in cuts]
    return mean_of(found)


def evaluate(runs: dict[str, Run]) -> Finding:
    """The worst |w1 / w1_ref - 1| and |h1 / h1_ref - 1|; or |A / (2 Q / V) - 1|, where a strand is not whole."""
    errors, numbers = [], []
    for name, row in PUBLISHED.items():
        found = measured(runs[name])
        wanted = {key: row[f"{column}_mm"] / 1e3 for key, column in COLUMNS.items()}
        wanted["area"] = row["mass_balance_area_mm2"] / 1e6
        errors += [abs(found[key] / wanted[key] - 1.0) for key in ("width", "height", "area")]
        for key, value in wanted.items():
            unit = "m^2" if key == "area" else "m"
            numbers.append(Number(f"{key} of {name} [{unit}]", found[key], value))
    return Finding(max(errors), tuple(numbers))


CASE = Case(
    "strand_two_layers",
    "two strands of mortar, one over the other, pressed by a nozzle's flat tip",
    "emission",
    "network trained on particle finite elements, 1 to 15 % itself; Rizzieri et al. 2026",
    "worst |w / w_ref - 1| of the lower strand and |h / h_ref - 1| of the notch between both",
    spacing=0.02 / 8,
    tolerance=TOLERANCE,
    scenarios=scenarios,
    evaluate=evaluate,
    causes={
        "mpm": "the notch is 14 to 29 % too high in all rows but ID3 (11 %), for the second strand is wide, and in ID5 "
        "a third of a cell above the first; the joint is 29 % wider than published in ID3, 15 % in ID2 and ID4, 19 to "
        "30 % narrower in the others; areas within 6 % of Q / V",
        "sph": "the notch is up to 22 % too high, as in ID2 and LM30, whose published outlines hold 14 and 6 % less "
        "than a strand's matter",
        "pbd": "the notch is 17 % too high in one of six rows (LM30), whose published outline holds 6 % less than a "
        "strand's matter; all else within 14 %",
    },
)
