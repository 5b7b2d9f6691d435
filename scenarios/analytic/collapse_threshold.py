"""The yield stress below which a slender column flows (slender theory)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.study.case import Case, Curve, Finding, Number, Run

from .slump_slip import HEIGHT, column

STRESSES = (0.38, 0.42, 0.46, 0.50, 0.54, 0.60)  # tau'
CRITERION, WANTED = 0.02, 0.466


def scenarios(spacing: float) -> dict[str, Scenario]:
    runs = {f"{tau}": column("collapse_threshold", tau, spacing, 0.8) for tau in STRESSES}
    return {**runs, "never yields": column("collapse_threshold", None, spacing, 0.8)}


def evaluate(runs: dict[str, Run]) -> Finding:
    """tau' at which the slump beyond that of an unyielding column is 0.02, between the runs."""

    def late(run: Run) -> float:
        """Mean over the last third: an elastic column keeps swinging."""
        slump = run.series["slump"].to_numpy()
        return float(slump[-len(slump) // 3 :].mean())

    settled = late(runs["never yields"])
    slump = np.array([late(runs[f"{tau}"]) for tau in STRESSES]) - settled
    seen = float(np.interp(-CRITERION, -slump, STRESSES))
    numbers = (
        Number("tau' at s' = 0.02", seen, WANTED),
        Number("settlement of the unyielding column", settled, 0.0),
        *(Number(f"slump at tau' = {t}, settlement taken off", s, 0.0) for t, s in zip(STRESSES, slump, strict=True)),
    )
    taus = np.linspace(STRESSES[0], STRESSES[-1], 40)
    x = np.minimum(np.sqrt(3.0) * taus, 1.0)
    curve = Curve("slump", "tau'", "slump s'", np.array(STRESSES), slump, taus, 1 - x * (1 - np.log(x)))
    return Finding(abs(seen / WANTED - 1.0), numbers, (curve,))


CASE = Case(
    "collapse_threshold",
    "the yield stress below which a slender column flows",
    "yield stress",
    "slender theory (von Mises); Roussel 2018, references.md, D",
    "|tau'_c / 0.466 - 1| at the criterion s' = 0.02",
    spacing=HEIGHT / 24,
    tolerance=0.15,
    fine_tolerance=0.10,
    scenarios=scenarios,
    evaluate=evaluate,
)
