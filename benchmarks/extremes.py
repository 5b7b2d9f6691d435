"""Extreme points: a lump of the line bead's paste thrown at the floor, two of the axes of `stability` pushed at once,
through every method at its own step. Each point holds, is refused with a reason, or diverges and says so; what ends as
completed is looked at again with NumPy, which knows nothing of the health check.

    python benchmarks/extremes.py --points 1000 --seed 1 --out extremes.csv
"""

import argparse
import itertools
from collections import Counter

import numpy as np
import pandas as pd

from fluidbench.errors import UserError
from fluidbench.method.suitability import refusal
from fluidbench.native.device import quiet_warp
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.runs.drive import Drive
from fluidbench.scenario import Scenario
from fluidbench.scenario.library import load
from fluidbench.scenario.numerics import configure
from fluidbench.study.limits import default_dt, lump
from fluidbench.study.points import AXES, varied

METHODS = ("mpm", "sph", "pbd")
BEYOND = 10.0  # factor by which values may lie beyond an axis' own ends


def value_on(axis, rng: np.random.Generator) -> float:
    """A value between a tenth of the axis' least (but zero) and ten times its greatest, evenly in its logarithm."""
    positive = [v for v in axis.values if v > 0]
    value = float(np.exp(rng.uniform(np.log(min(positive) / BEYOND), np.log(BEYOND * max(positive)))))
    return min(value, 0.4999) if axis.key == "material.poisson_ratio" else value


def thrown(scenario: Scenario, method: str) -> tuple[str, str]:
    """(how the lump ended, why): held, refused, diverged, or FALSE where a result is none."""
    solver = get_method(method)
    try:
        config = configure(solver, scenario)
        if reason := refusal(solver, scenario, config):
            return "refused", reason
        dt, _ = default_dt(scenario, solver, config)
        made = Scenario.model_validate(lump(scenario, dt).model_dump())
        sim = Simulation(made, method, config=config)
    except UserError as error:
        return "refused", str(error).splitlines()[0]
    start = sim.frame()
    outcome = Drive(sim, sim.scenario, wall_limit=60.0).run()
    if outcome.verdict != "completed":
        return str(outcome.verdict), outcome.reason
    return ("FALSE", wrong) if (wrong := false_result(start, sim)) else ("held", "")


def false_result(start: dict[str, np.ndarray], sim: Simulation) -> str:
    """What makes a completed run no result: non-finite state, particles outside or farther than any speed leads."""
    end, s = sim.frame(), sim.scenario
    for name, values in end.items():
        if not np.isfinite(values).all():
            return f"{name} is not finite"
    if not s.domain.contains(end["position"], 1e-6 * s.spacing + 1e-6 * np.abs(s.domain.upper).max()).all():
        return "a particle is outside the domain"
    if np.linalg.norm(end["velocity"], axis=1).max() > sim.scene.top_speed:
        return "a particle is faster than any matter"
    moved = np.linalg.norm(end["position"] - start["position"], axis=1).max()
    if moved > sim.scene.top_speed * sim.now + s.spacing:
        return f"a particle moved {moved:.3g} m in {sim.now:.3g} s"
    if end["mass"].astype(float).sum() != start["mass"].astype(float).sum():
        return "mass is not kept"
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default="")
    given = parser.parse_args()
    quiet_warp()
    rng, base, rows = np.random.default_rng(given.seed), load("line_bead"), []
    pairs = list(itertools.combinations(AXES, 2))
    for i in range(given.points):
        names, method = pairs[i // len(METHODS) % len(pairs)], METHODS[i % len(METHODS)]
        values = {name: value_on(AXES[name], rng) for name in names}
        settings = {k: v for name in names for k, v in AXES[name].setting(base, values[name]).items()}
        try:
            verdict, why = thrown(varied(base.model_dump(mode="json"), settings), method)
        except UserError as error:
            verdict, why = "refused", str(error).splitlines()[0]
        point = {"method": method, "verdict": verdict, "why": why}
        for k, name in enumerate(names, 1):
            point |= {f"axis_{k}": name, f"value_{k}": values[name]}
        rows.append(point)
    table = pd.DataFrame(rows)
    print(table.pivot_table(index="verdict", columns="method", values="why", aggfunc="count", fill_value=0).to_string())
    for why, count in Counter(r["why"].split("(")[0][:80] for r in rows if r["verdict"] != "held").most_common(12):
        print(f"{count:5d}  {why}")
    if given.out:
        table.to_csv(given.out, index=False)


if __name__ == "__main__":
    main()
