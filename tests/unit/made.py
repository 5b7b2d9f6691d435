"""Hand-made runs, cases and trials for the rules of the studies."""

from pathlib import Path

from fluidbench.library import load
from fluidbench.study.case import Case, Finding
from fluidbench.study.evidence import METHODS, Evidence
from fluidbench.study.execute import Finished
from fluidbench.study.validate import SKIPPED, Trial

COST = {
    "wall_per_simulated_s": 1.0, "wall_s": 1.0, "mean_dt_s": 1e-4, "bytes_per_particle": 900.0, "steps_per_s": 10.0,
    "simulated_to_real": 0.1, "cpu_s": 1.0,
}  # fmt: skip


def finished(method="mpm", verdict="completed", measures=None, *, repeat=0, spacing=1e-3, folder="nowhere", **more):
    """A run that ended so; further keywords are costs where COST has them, and else entries of the record."""
    cost = COST | {key: value for key, value in more.items() if key in COST}
    record = {
        "scenario": "line_bead", "method": method, "device": "cpu", "backend": "warp", "repeat": repeat,
        "verdict": verdict, "reason": "", "spacing_m": spacing, "measures": measures or {}, "answers": [],
        **{key: value for key, value in more.items() if key not in COST},
    }  # fmt: skip
    return Finished(record | ({"cost": cost} if verdict == "completed" else {}), Path(folder), False)


def case(name="any", physics="liquid", tolerance=0.1, spacing=0.01, **more):
    return Case(name, name, physics, "a book", "relative", spacing, tolerance, **more)


def trial(of, method, error=0.0, *, wall=1.0, level="coarse", spacing=None, verdict="pass", note=""):
    """A trial with a finding where its verdict is pass or MISS, without one otherwise."""
    made = Trial(of, method, level, spacing or of.spacing, verdict=verdict, note=note)
    if verdict in ("pass", "MISS", "exempt"):
        made.finding = Finding(error)
        made.cost = {"wall_s": wall, "particles": 10, "wall_per_simulated_s": 2.0 * wall}
        made.runs = {"a": finished(method, spacing=made.spacing)}
    elif verdict != SKIPPED:
        made.runs = {"a": finished(method, verdict)}
    return made


BEAD = load("line_bead")


def evidence(trials=(), **more):
    repeats = more.pop("repeats", None) or {m: [finished(m, repeat=r) for r in range(2)] for m in METHODS}
    return Evidence(BEAD, list(trials), repeats, **more)


def known(method, good, bad, physics="liquid", **more):
    """So many known answers within tolerance, and beyond it."""
    rows = [trial(case(f"g{i}", physics), method, 0.01, **more) for i in range(good)]
    return rows + [trial(case(f"b{i}", physics), method, 0.9, verdict="MISS", **more) for i in range(bad)]


def repeated(counts=2, **paces):
    return {m: [finished(m, repeat=r, wall_per_simulated_s=p, mean_dt_s=1e-3 / p, bytes_per_particle=100 * p)
                for r in range(counts)] for m, p in paces.items()}  # fmt: skip
