"""How far a PBD liquid settles under its weight: proportional to dt^2 / n (references.md, I)."""

import numpy as np

from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

HEIGHT, SIDE = 0.2, 0.08
JITTER = 0.1  # spacings: how much a lattice packs depends on whether it breaks, which some runs do and some do not
PAIRS = ((8e-3, 32), (8e-3, 16), (4e-3, 16), (4e-3, 8), (4e-3, 4), (2e-3, 4), (2e-3, 2))  # (dt [s], iterations)


def scenarios(spacing: float) -> dict[str, Scenario]:
    def tank(tick: float, iterations: int) -> Scenario:
        return define(
            "pbd_stiffness",
            domain={"lower": [0, 0, 0], "upper": [SIDE, SIDE, 0.3], "walls": {"z_lower": "slip"}},
            material={"density": 1000.0},
            tick=tick,
            duration=1.2,
            output_interval=0.04,
            spacing=spacing,
            jitter=JITTER,
            bodies=[{"kind": "box", "center": [SIDE / 2, SIDE / 2, HEIGHT / 2], "size": [SIDE, SIDE, HEIGHT]}],
            numerics={"pbd": {"iterations": iterations, "advance": 1.0}},
        )

    return {f"{tick} {n}": tank(tick, n) for tick, n in PAIRS}


def evaluate(runs: dict[str, Run]) -> Finding:
    """Settlement over that of c_eff = kappa (d / dt) sqrt(n), kappa fitted once; largest departure from it.

    A column of depth H with stiffness rho c^2 sinks on average by g H / (3 c^2), over H / 2: twice that. What
    the lattice packs whatever dt is taken off.
    """
    load, sunk = [], []
    for label, run in runs.items():
        n = int(label.split()[1])
        late = [frame["position"][:, 2].mean() for frame in run.frames if float(frame["time"]) > 0.5]
        load.append(9.81 * run.dt**2 / (n * run.scenario.spacing**2))
        sunk.append(1 - float(np.mean(late)) / (HEIGHT / 2))
    load, sunk = np.array(load), np.array(sunk)
    slope, packing = np.polyfit(load, sunk, 1, w=1 / load)  # relative departures count alike
    fitted = slope * load + packing
    departure = np.abs((sunk - packing) / (slope * load) - 1.0)
    numbers = (
        Number("kappa in c_eff = kappa d sqrt(n) / dt", float(np.sqrt(2 * HEIGHT / (3 * slope))), 0.5),
        Number("packing left at dt = 0", float(packing), 0.0),
        *(Number(f"settlement / H at dt, n = {name}", s, f) for name, s, f in zip(runs, sunk, fitted, strict=True)),
    )
    order = np.argsort(load)
    x, y = load[order], sunk[order]
    curve = Curve("settlement", "g dt^2 / (n d^2) [1/m]", "settlement / H", x, y, x, fitted[order])
    return Finding(float(departure.max()), numbers, (curve,))


CASE = Case(
    "pbd_stiffness",
    "settlement of a PBD liquid against dt and iterations",
    "numerics",
    "scaling dt^2 / n; references.md, I",
    "largest departure of the settlement from dt^2 / n, packing taken off",
    spacing=0.01,
    tolerance=0.2,
    scenarios=scenarios,
    evaluate=evaluate,
    about="pbd",
)
