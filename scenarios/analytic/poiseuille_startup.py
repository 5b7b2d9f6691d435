"""Start-up of plane Poiseuille flow between no-slip walls (exact series)."""

import numpy as np

from fluidbench.measure.profiles import relative_l2
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

WIDTH, NU = 0.02, 1e-4
FORCE = 8 * NU * (NU / WIDTH) / WIDTH**2  # Re = u_max L / nu = 1
TIMES = (0.02, 0.1, 0.6)  # nu t / L^2


def scenarios(spacing: float) -> dict[str, Scenario]:
    side = 8 * spacing
    walls = {f"{axis}_{end}": "periodic" for axis in "xz" for end in ("lower", "upper")}
    channel = define(
        "poiseuille_startup",
        domain={
            "lower": [0, 0, 0],
            "upper": [side, WIDTH, side],
            "walls": {**walls, "y_lower": "stick", "y_upper": "stick"},
        },
        material={"density": 1000.0, "viscosity": 1000.0 * NU, "sound_speed": 0.1},
        bodies=[{"kind": "box", "center": [side / 2, WIDTH / 2, side / 2], "size": [side, WIDTH, side]}],
        gravity=[0.0, 0.0, 0.0],
        body_force=[FORCE, 0.0, 0.0],
        duration=TIMES[-1] * WIDTH**2 / NU,
        output_interval=0.02 * WIDTH**2 / NU,
        spacing=spacing,
        numerics={"mpm": {"grid_ratio": 1.5}},  # at 2 the channel is 10 cells across: 0.038
    )
    return {"channel": channel}


def exact(y: np.ndarray, time: float) -> np.ndarray:
    """u(y, t) [m/s]: the steady parabola less its decaying odd harmonics."""
    n = 2 * np.arange(60)[:, None] + 1
    fading = np.exp(-(n**2) * np.pi**2 * NU * time / WIDTH**2)
    series = 4 * FORCE * WIDTH**2 / (NU * np.pi**3 * n**3) * np.sin(n * np.pi * y / WIDTH) * fading
    return FORCE * y * (WIDTH - y) / (2 * NU) - series.sum(axis=0)


def evaluate(runs: dict[str, Run]) -> Finding:
    """E2 of the velocity over all particles, worst of three times."""
    run, errors, numbers, curves = runs["channel"], [], [], []
    across = np.linspace(0.0, WIDTH, 81)
    for share in TIMES:
        frame = run.near(share * WIDTH**2 / NU)
        y, u = frame["position"][:, 1].astype(float), frame["velocity"][:, 0].astype(float)
        time = float(frame["time"])
        errors.append(relative_l2(u, exact(y, time)))
        numbers.append(Number(f"E2 at nu t / L^2 = {share}", errors[-1], 0.0))
        order = np.argsort(y)
        name = f"velocity {share}"
        reference = exact(across, time)
        curves.append(Curve(name, "y [m]", "u [m/s]", y[order], u[order], across, reference))
    return Finding(max(errors), tuple(numbers), tuple(curves))


CASE = Case(
    "poiseuille_startup",
    "start-up of flow between no-slip walls",
    "viscous",
    "exact; Morris et al. 1997, eq. 21",
    "E2 of velocity, worst of nu t / L^2 = 0.02, 0.1, 0.6",
    spacing=WIDTH / 20,
    tolerance=0.03,
    fine_tolerance=0.02,
    scenarios=scenarios,
    evaluate=evaluate,
    quick=WIDTH / 20,
)
