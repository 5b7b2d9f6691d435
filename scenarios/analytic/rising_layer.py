"""A layer of foam rises from a floor that it sticks to while a force drags it sideways (exact)."""

import math

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, RATIO, TIME = 0.02, 8.0, 1.0  # fresh height [m], final volume over fresh volume [-], time constant [s]
DENSITY, YIELD = 500.0, 100.0
JITTER = 0.2  # of a spacing: foam lies in no order, and what begins as a lattice is held by it
SHARE = 0.3  # of the yield stress, that the drag is at the floor
DRAG = SHARE * YIELD / (DENSITY * HEIGHT)  # [m/s^2]


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 8 * spacing
    walls = {f"{axis}_{end}": "periodic" for axis in "xy" for end in ("lower", "upper")}
    layer = define(
        "rising_layer",
        domain={
            "lower": [0, 0, 0],
            "upper": [side, side, 1.3 * RATIO * HEIGHT],
            "walls": {**walls, "z_lower": "stick"},
        },
        material={
            "density": DENSITY,
            "youngs_modulus": 300 * YIELD,
            "yield_stress": YIELD,
            "expansion": {"ratio": RATIO, "time": TIME},
        },
        bodies=[{"kind": "box", "center": [side / 2, side / 2, HEIGHT / 2], "size": [side, side, HEIGHT]}],
        gravity=[0, 0, 0],
        body_force=[DRAG, 0, 0],
        duration=2 * TIME,
        jitter=JITTER,
        output_interval=TIME / 20,
        spacing=spacing,
    )
    return {"layer": layer}


def height(time: np.ndarray) -> np.ndarray:
    """[m]: nothing gives way sideways."""
    return HEIGHT * (1.0 - (RATIO - 1.0) * np.expm1(-time / TIME))


def rise(time: np.ndarray) -> np.ndarray:
    """dH/dt [m/s]."""
    return HEIGHT * (RATIO - 1.0) / TIME * np.exp(-time / TIME)


def drift(share: np.ndarray) -> np.ndarray:
    """Velocity along the drag over dH/dt, where the share xi of the mass lies below.

    Growth at g = (dH/dt) / H shears at 2 g / sqrt(3) [1/s], as sqrt(2 D:D), drag at v'; a plastic flow shares the yield
    stress tau_y out in proportion: v' = 2 g / sqrt(3) s / sqrt(1 - s^2), s(xi) = s_0 (1 - xi) the stress over tau_y.
    Integrated, v = dH/dt 2 / (sqrt(3) s_0) [sqrt(1 - s^2) - sqrt(1 - s_0^2)]. It moves while it grows, however small
    the drag.
    """
    s = SHARE * (1.0 - share)
    return 2.0 / (math.sqrt(3.0) * SHARE) * (np.sqrt(1.0 - s * s) - math.sqrt(1.0 - SHARE * SHARE))


def evaluate(runs: dict[str, Run]) -> Finding:
    """Over the frames from half a time constant on: mean velocity, and that of the lowest eighth, over those of the
    exact profile; height at the end."""
    run = runs["layer"]
    late = run.times >= 0.5 * TIME
    bins = np.linspace(0.0, 1.0, 9)
    profile = np.zeros(8)
    for frame in (frame for frame, take in zip(run.frames, late, strict=True) if take):
        order = np.argsort(frame["position"][:, 2])
        mass = frame["mass"][order].astype(float)
        share = (np.cumsum(mass) - 0.5 * mass) / mass.sum()
        momentum, _ = np.histogram(share, bins, weights=mass * frame["velocity"][order, 0])
        profile += momentum / (mass.sum() / 8)
    profile /= rise(run.times[late]).sum()
    shares = np.linspace(0.0, 1.0, 801)
    exact = drift(shares)
    fine = 0.5 * (exact[1:] + exact[:-1]).reshape(8, 100).mean(axis=1)
    last = run.frames[-1]
    top = 2.0 * float(np.average(last["position"][:, 2], weights=last["mass"]))
    numbers = (
        Number("mean drift over rise [-]", float(profile.mean()), float(fine.mean())),
        Number("drift of the lowest eighth over rise [-]", float(profile[0]), float(fine[0])),
        Number("height at the end [m]", top, float(height(run.times[-1:])[0])),
    )
    curve = Curve("drift", "share of the mass below [-]", "v / (dH/dt) [-]", 0.5 * (bins[1:] + bins[:-1]), profile,
                  shares, exact)  # fmt: skip
    error = float(np.sqrt(np.mean((profile - fine) ** 2)) / np.sqrt(np.mean(fine**2)))
    return Finding(max(error, abs(numbers[2].measured / numbers[2].reference - 1.0)), numbers, (curve,))


CASE = Case(
    "rising_layer",
    "a layer of foam that rises from a floor while it is dragged sideways",
    "process",
    "exact; references.md, G",
    "E2 of the drift's profile, or the relative error of the height",
    spacing=HEIGHT / 6,
    tolerance=0.1,
    scenarios=scenarios,
    evaluate=evaluate,
)
