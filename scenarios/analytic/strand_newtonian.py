"""Newtonian strands under a nozzle with a flat tip, in creeping flow, against a finite-volume computation."""

import numpy as np

from fluidbench.measure.deposit import cut
from fluidbench.measure.feed import feeding, is_out
from fluidbench.measure.ledger import deposit_of
from fluidbench.measure.reference import table
from fluidbench.method.frame import Frame
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import define
from fluidbench.study.case import Case, Finding, Number, Run

DIAMETER, SPEED, DENSITY = 0.01, 0.01, 1000.0
REYNOLDS = 0.05
VISCOSITY = DENSITY * SPEED * DIAMETER / REYNOLDS
AREA = np.pi / 4.0  # over D^2: Q / V, at a travel speed V that is the exit speed
GAPS = (0.6, 0.8, 1.0)  # over D
TIME = 12.0  # D / U: what is laid is steady 3.5 D behind the axis from 7 on, but for waves of some percent
BEHIND = 3.5  # D
LAST = 16  # frames, 0.25 D / U apart, over which a moving section is averaged
TOLERANCES = {"width": 0.08, "height": 0.08, "contact": 0.15, "area": 0.02, "pressure": 0.10}


def scenarios(spacing: float) -> dict[str, Scenario]:
    return {f"gap {gap:g} D": strand(gap, spacing) for gap in GAPS}


def strand(gap: float, spacing: float) -> Scenario:
    """One of them; the path goes on beyond the end of the run. It begins on a piece of the strand, a bar of its
    section: else it would take ten diameters until nothing is left of the lump that an end makes."""
    d, end = DIAMETER, TIME * DIAMETER / SPEED
    bar = np.array([2.0 * d, AREA * d / gap, gap * d])
    return define(
        f"strand_newtonian_{gap:g}",
        domain={
            "lower": [-3.0 * d, -2.0 * d, 0],
            "upper": [(TIME + 2.5) * d, 2.0 * d, (gap + 1.0) * d + 14 * spacing],
        },
        material={"density": DENSITY, "viscosity": VISCOSITY},
        gravity=[0.0, 0.0, 0.0],
        bodies=[{"kind": "box", "center": [-0.5 * d, 0.0, bar[2] / 2], "size": bar.tolist()}],
        nozzle={"diameter": d, "exit_speed": SPEED, "standoff": gap * d, "tip": "flat"},
        toolpath={"kind": "line", "start": [0.0, 0.0], "end": [(TIME + 1.0) * d, 0.0], "speed": SPEED},
        duration=end,
        output_interval=end / (4 * TIME),
        spacing=spacing,
        sound_speed_ratio=5.0,
        numerics={"mpm": {"grid_ratio": 1.0}},
    )


def section(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Of the strand 3.5 D behind the axis, over D; its area times its speed, seen from the nozzle, over Q."""
    nozzle, track, path = scenario.nozzle, scenario.track, scenario.toolpath
    assert nozzle is not None and track is not None and path is not None and path.speed is not None
    d = nozzle.diameter
    place = float(track.at(float(frame["time"]))[0]) - BEHIND * d
    deposit = deposit_of(frame, scenario)
    height = deposit.origin[2] + (deposit.fill.shape[2] - 0.5) * deposit.spacing
    found = cut(deposit, np.array([place, 0.0]), np.array([1.0, 0.0]), -scenario.domain.lower[1], height, 0.0)
    near = is_out(frame, scenario) & (np.abs(frame["position"][:, 0] - place) < 0.25 * d)
    drift = float(frame["velocity"][near, 0].mean()) if near.any() else 0.0
    return {
        "width": found.width / d,
        "height": found.height / d,
        "contact": found.contact / d,
        "area": found.area * (path.speed - drift) / nozzle.rate,
        "pressure": feeding(frame, scenario).get("inlet_pressure_Pa", np.nan),
    }


def steady(run: Run) -> dict[str, float]:
    """Mean over the last frames of a run."""
    return mean_of([section(frame, run.scenario) for frame in run.frames[-LAST:]])


def mean_of(found: list[dict[str, float]]) -> dict[str, float]:
    """Of sections, key by key."""
    return {key: float(np.mean([each[key] for each in found])) for key in found[0]}


def evaluate(runs: dict[str, Run]) -> Finding:
    """The worst error of all, each over its tolerance."""
    answers = table("strand_vof_newtonian")
    errors, numbers = [], []
    for gap in GAPS:
        run, row = runs[f"gap {gap:g} D"], answers[answers["gap_over_d"] == gap].iloc[0]
        measured = steady(run)
        measured["pressure"] *= DIAMETER / (VISCOSITY * SPEED)
        closed = {key: float(row[f"{key}_closed_over_d"]) for key in ("width", "height", "contact")}
        for key, wanted in (closed | {"area": 1.0, "pressure": float(row["inlet_pressure"])}).items():
            found = measured[key]
            unit = {"area": "area V / Q", "pressure": "inlet pressure over eta U / D"}.get(key, f"{key} over D")
            numbers.append(Number(f"{unit} at a gap of {gap:g} D", found, wanted))
            if key != "pressure" or "pressure" in run.frames[-1]:
                error = abs(found / wanted - 1.0) / TOLERANCES[key]
                errors.append(error if np.isfinite(error) else np.inf)
    return Finding(max(errors), tuple(numbers))


CASE = Case(
    "strand_newtonian",
    "Newtonian strands pressed by a nozzle's flat tip",
    "emission",
    "finite-volume computation (interFoam), 4 to 6 % itself; scenarios/reference",
    "worst of width, height (8 %), contact (15 %), area (2 %), inlet pressure (10 %), each over its tolerance",
    spacing=DIAMETER / 8,
    tolerance=1.0,
    scenarios=scenarios,
    evaluate=evaluate,
    exempt={"pbd": "height at 0.6 D 9 to 14 % too large, all else as asked; it has no pressure"},
    causes={
        "mpm": "pressures 9 to 14 % too high and contact at 1.0 D 24 % too wide; with 10 and 12 particles across (the "
        "medium level) it passes, as SPH does",
        "sph": "at 1.0 D contact 30 % short, 12 % at D / 12, where the wedge beside it is finer than the deposit's "
        "resolution, and height then 7 to 8 % short",
    },
)
