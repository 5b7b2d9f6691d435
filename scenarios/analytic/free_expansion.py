"""A sphere of foam expands freely: every length grows as the cube root of the volume ratio (exact)."""

import math

import numpy as np

from fluidbench.measure.profiles import semi_axes
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

RADIUS, TIME, RATIOS = 0.02, 1.0, (10.0, 30.0)


def volume_ratio(ratio: float, time: np.ndarray) -> np.ndarray:
    return 1.0 - (ratio - 1.0) * np.expm1(-time / TIME)


def scenarios(spacing: float) -> dict[str, Scenario]:
    found = {}
    for ratio in RATIOS:
        half = 1.4 * RADIUS * ratio ** (1 / 3)
        rate = (ratio - 1.0) / (3.0 * TIME)
        found[f"R = {ratio:g}"] = define(
            f"free_expansion_{ratio:g}",
            domain={"lower": [-half] * 3, "upper": [half] * 3, "walls": {"z_lower": "slip"}},
            material={
                "density": 100.0,
                "youngs_modulus": 2e3,
                "yield_stress": 20.0,
                "expansion": {"ratio": ratio, "time": TIME},
            },
            bodies=[
                {
                    "kind": "sphere",
                    "center": [0, 0, 0],
                    "radius": RADIUS,
                    "velocity_gradient": np.diag([rate] * 3).tolist(),
                }
            ],
            gravity=[0, 0, 0],
            duration=2 * TIME,
            output_interval=TIME / 4,
            spacing=spacing,
        )
    return found


def evaluate(runs: dict[str, Run]) -> Finding:
    """Volume by second moments of mass at the end over the exact one; mass; roundness."""
    numbers, curves, worst = [], [], 0.0
    for (label, run), ratio in zip(runs.items(), RATIOS, strict=True):
        axes = np.array([semi_axes(frame, cubes=True) for frame in run.frames])
        volume = axes.prod(axis=1) / axes[0].prod()
        exact = volume_ratio(ratio, run.times)
        mass = [float(frame["mass"].astype(float).sum()) for frame in run.frames]
        numbers += [
            Number(f"{label}: volume ratio at the end", float(volume[-1]), float(exact[-1])),
            Number(f"{label}: mass [kg]", mass[-1], mass[0]),
            Number(f"{label}: longest over shortest axis", float(axes[-1].max() / axes[-1].min()), 1.0),
        ]
        curves.append(Curve(label, "time [s]", "volume over fresh volume", run.times, volume, run.times, exact))
        if not math.isclose(mass[-1], mass[0], rel_tol=1e-6):
            worst = math.inf
        worst = max(worst, abs(float(volume[-1] / exact[-1]) - 1.0), float(axes[-1].max() / axes[-1].min()) - 1.0)
    return Finding(worst, tuple(numbers), tuple(curves))


CASE = Case(
    "free_expansion",
    "a sphere of foam that expands tenfold and thirtyfold",
    "process",
    "exact: lengths as R^(1/3); references.md, G",
    "largest relative error of volume and of roundness; infinite if mass moved",
    spacing=RADIUS / 4,
    tolerance=0.02,
    scenarios=scenarios,
    evaluate=evaluate,
)
