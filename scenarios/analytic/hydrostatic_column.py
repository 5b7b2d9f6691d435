"""Water at rest in a smooth tank: pressure rho g (H - z) (exact)."""

import numpy as np

from fluidbench.measure.profiles import relative_l2
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Curve, Finding, Number, Run

DEPTH, C, G = 0.2, 14.0, 9.81
PERIOD = 4 * DEPTH / C


def scenarios(spacing: float) -> dict[str, Scenario]:
    tank = define(
        "hydrostatic_column",
        material={"density": 1000.0, "sound_speed": C},
        domain={"lower": [0, 0, 0], "upper": [0.1, 0.1, 0.3], "walls": {"z_lower": "slip"}},
        bodies=[{"kind": "box", "center": [0.05, 0.05, DEPTH / 2], "size": [0.1, 0.1, DEPTH]}],
        duration=14 * PERIOD,
        output_interval=PERIOD / 8,
        spacing=spacing,
    )
    return {"tank": tank}


def evaluate(runs: dict[str, Run]) -> Finding:
    """E2 of pressure in layers of two spacings, d < z < H - 2 d, over the last eight periods of the ringing."""
    run = runs["tank"]
    d = run.scenario.spacing
    late = [frame for frame in run.frames if float(frame["time"]) > 6 * PERIOD]
    z = np.concatenate([frame["position"][:, 2] for frame in late]).astype(float)
    p = C**2 * (np.concatenate([frame["density"] for frame in late]).astype(float) - 1000.0)
    layer = np.floor(z / (2 * d)).astype(int)
    inside = [i for i in np.unique(layer) if (layer == i).sum() > len(late) and (2 * i + 2) * d <= DEPTH - 2 * d]
    height = np.array([z[layer == i].mean() for i in inside])
    mean = np.array([p[layer == i].mean() for i in inside])
    exact = 1000.0 * G * (DEPTH - height)
    speed = float(np.linalg.norm(run.frames[-1]["velocity"], axis=1).max()) / np.sqrt(G * DEPTH)
    top = float(np.mean([frame["position"][:, 2].mean() for frame in late]))
    e = G * DEPTH / C**2
    numbers = (
        Number("largest speed at the end over sqrt(g H)", speed, 0.0),
        Number("settlement over H", 2 * (DEPTH / 2 - top) / DEPTH, (e - np.log1p(e)) / e),
    )
    curve = Curve("pressure", "height [m]", "pressure [Pa]", height, mean, height, exact)
    return Finding(relative_l2(mean, exact), numbers, (curve,))


CASE = Case(
    "hydrostatic_column",
    "water at rest in a smooth tank",
    "liquid",
    "exact; references.md, B",
    "E2 of the mean pressure, d < z < H - 2 d",
    spacing=0.01,
    tolerance=0.03,
    scenarios=scenarios,
    evaluate=evaluate,
    exempt={"pbd": "PBD has no pressure; its settlement is judged by pbd_stiffness"},
)
