"""Decay of a sine wave of shear in a periodic box: the viscosity meter (exact at any amplitude)."""

import numpy as np

from fluidbench.measure.profiles import sine_amplitude
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

LENGTH, NU, SPEED = 0.16, 0.01, 0.1
K = 2 * np.pi / LENGTH
WALLS = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 8 * spacing
    body = {
        "kind": "box",
        "center": [side / 2, side / 2, LENGTH / 2],
        "size": [side, side, LENGTH],
        "wave": {"amplitude": [SPEED, 0, 0], "number": [0, 0, K], "phase": float(K * LENGTH / 2)},
    }
    wave = define(
        "shear_wave_decay",
        domain={"lower": [0, 0, 0], "upper": [side, side, LENGTH], "walls": WALLS},
        material={"density": 1000.0, "viscosity": 1000.0 * NU, "sound_speed": 100 * SPEED},
        bodies=[body],
        gravity=[0.0, 0.0, 0.0],
        duration=1.0 / (NU * K * K),
        spacing=spacing,
    )
    return {"wave": wave}


def evaluate(runs: dict[str, Run]) -> Finding:
    """nu from a log fit of the Fourier amplitude."""
    run = runs["wave"]
    amplitude = np.array([sine_amplitude(frame, 0, 2, K) for frame in run.frames]) / SPEED
    seen = -np.polyfit(run.times, np.log(np.maximum(amplitude, 1e-12)), 1)[0] / K**2
    numbers = (Number("viscosity of the material [m^2/s]", seen, NU),)
    if run.method == "mpm":
        dx = run.record.config["grid_ratio"] * run.scenario.spacing
        extra = 0.024 * K**2 * dx**4 / run.dt
        numbers += (Number("viscosity with that of the APIC transfer [m^2/s]", seen, NU + extra),)
    exact = np.exp(-NU * K**2 * run.times)
    curve = Curve("amplitude", "time [s]", "amplitude / U", run.times, amplitude, run.times, exact)
    return Finding(abs(seen / NU - 1.0), numbers, (curve,))


CASE = Case(
    "shear_wave_decay",
    "decay of a shear wave in a periodic box",
    "viscous",
    "exact; references.md, C",
    "|nu_eff / nu - 1|",
    spacing=LENGTH / 64,
    tolerance=0.03,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=LENGTH / 64,
)
