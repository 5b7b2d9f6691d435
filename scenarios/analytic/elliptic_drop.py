"""An inviscid sphere flattened by a straining flow (exact; the 3D form of Monaghan 1994)."""

import numpy as np

from fluidbench.measure.profiles import kinetic_energy, semi_axes
from fluidbench.measure.reference import table
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

RADIUS, RATE, END = 0.05, 20.0, 0.5


def scenarios(spacing: float) -> dict[str, Scenario]:
    body = {
        "kind": "sphere",
        "center": [0.12, 0.12, 0.12],
        "radius": RADIUS,
        "velocity_gradient": [[RATE, 0, 0], [0, RATE, 0], [0, 0, -2 * RATE]],
    }
    drop = define(
        "elliptic_drop",
        domain={"lower": [0, 0, 0], "upper": [0.24, 0.24, 0.24]},
        bodies=[body],
        material={"density": 1000.0, "sound_speed": 20.0},
        gravity=[0.0, 0.0, 0.0],
        duration=END / RATE,
        output_interval=0.05 / RATE,
        spacing=spacing,
    )
    return {"drop": drop}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Semi-axes from second moments against the exact ones, in radii, at t A0 = 0.5."""
    run, exact = runs["drop"], table("elliptic_drop_axisymmetric_oblate")
    axes = np.array([semi_axes(frame) for frame in run.frames])
    a, c = axes[:, :2].mean(axis=1) / axes[0, :2].mean(), axes[:, 2] / axes[0, 2]
    clock = run.times * RATE
    a_ref, c_ref = (float(np.interp(END, exact["t_A0"], exact[key])) for key in "ac")
    energy = kinetic_energy(run.frames[-1]) / kinetic_energy(run.frames[0])
    density = run.frames[-1]["density"].astype(float)
    numbers = (
        Number("radial semi-axis a / R", a[-1], a_ref),
        Number("axial semi-axis c / R", c[-1], c_ref),
        Number("kinetic energy over the initial one", energy, 1.0),
        Number("mean density over rho0", float(density.mean()) / 1000.0, 1.0),
    )
    curves = tuple(
        Curve(f"axis {key}", "t A0", f"{key} / R", clock, values, exact["t_A0"].to_numpy(), exact[key].to_numpy())
        for key, values in (("a", a), ("c", c))
    )
    return Finding(max(abs(a[-1] - a_ref), abs(c[-1] - c_ref)), numbers, curves)


CASE = Case(
    "elliptic_drop",
    "an inviscid sphere flattened by a straining flow",
    "liquid",
    "exact; Monaghan 1994, axisymmetric form: references.md, B",
    "error of the worse semi-axis over R, t A0 = 0.5",
    spacing=RADIUS / 10,
    tolerance=0.02,
    fine_tolerance=0.01,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=RADIUS / 10,
)
