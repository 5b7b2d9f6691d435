"""Hand-made runs, cases, trials, pools and towers; workplaces where nothing is run."""

import math
from pathlib import Path

import numpy as np

from fluidbench.method.frame import FREE
from fluidbench.method.target import Target
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.paper.definitions import METHODS
from fluidbench.paper.evidence import Evidence
from fluidbench.runs.execute import Hooks
from fluidbench.runs.record import Cost, Record, Run
from fluidbench.runs.store import Store
from fluidbench.scenario.library import load
from fluidbench.study import workplace
from fluidbench.study.case import Case, Finding
from fluidbench.study.trials import SKIPPED, Trial
from fluidbench.study.workplace import Workplace

from ..conftest import scenario

COST = {
    "simulated_s": 1.0,
    "wall_s": 1.0,
    "cpu_s": 1.0,
    "prepare_s": 0.0,
    "total_s": 1.0,
    "substeps": 10,
    "mean_dt_s": 1e-4,
    "steps_per_s": 10.0,
    "particle_substeps_per_s": 100.0,
    "particle_substeps_per_cpu_s": 100.0,
    "wall_per_simulated_s": 1.0,
    "simulated_to_real": 0.1,
    "peak_particles": 10,
    "bytes_per_particle": 900.0,
    "peak_memory_MiB": 1.0,
}
HEADING = {
    "scenario": "line_bead",
    "device": "cpu",
    "backend": "warp",
    "threads": 1,
    "repeat": 0,
    "key": "k",
    "seed": 0,
    "spacing_m": 1e-3,
    "code": {},
}


def finished(method="mpm", verdict="completed", measures=None, *, spacing=1e-3, folder="nowhere", **more):
    """A run that ended so; further keywords are costs where COST has them, and else entries of the record."""
    cost = {key: value for key, value in more.items() if key in COST}
    entries = {key: value for key, value in more.items() if key not in COST}
    table = HEADING | {"method": method, "verdict": verdict, "spacing_m": spacing, "measures": measures or {}} | entries
    return Run(Record(**table, cost=Cost(**COST | cost) if verdict == "completed" else None), Path(folder))


def change(run, cost=None, **entries):
    """The same run with other entries of its record and of its cost."""
    if cost is not None:
        entries["cost"] = run.cost.model_copy(update=cost)
    object.__setattr__(run, "record", run.record.model_copy(update=entries))
    return run


SILENT = Hooks(*[lambda *_: None] * 3, lambda _: None)


class Call(list):
    """Work that was asked for at once, and by how many workers."""

    workers = 1


def working(monkeypatch, answer=lambda work: finished(work.method)):
    """From here on studies get `answer(work)` for every piece of work, in a folder of theirs, instead of running it;
    yields their calls, as they grow."""
    calls = []

    def execute(planned, store, hooks, workers=1, executor=None, gpus=()):
        calls.append(Call(planned))
        calls[-1].workers = workers
        made = [answer(work) for work in planned]
        for run in made:
            if isinstance(run, Run):
                object.__setattr__(run, "folder", store.root / "runs" / "x")
                object.__setattr__(run, "keeper", store.keeper)
        return made

    monkeypatch.setattr(workplace, "execute", execute)
    return calls


def workplace_in(root, workers=2, wall_limit=7.0, **more):
    """A workplace with this folder, for `working` studies."""
    return Workplace(Target(), Store(root), workers, wall_limit, **more)


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
    return {
        m: [
            finished(
                m,
                repeat=r,
                cpu_s=p,
                wall_s=p,
                mean_dt_s=1e-3 / p,
                bytes_per_particle=100 * p,
            )
            for r in range(counts)
        ]
        for m, p in paces.items()
    }


def pool_of(*scenarios, capacity=40):
    return Pool(Scene(list(scenarios) or scenario()), capacity)


def place(pool, n=2, velocity=(0.0, 0.0, 0.0), volume=1e-6, birth=0.0):
    x = np.full((n, 3), 0.1) + 0.01 * np.arange(n)[:, None]
    pool.place(x, np.tile(velocity, (n, 1)), np.full(n, volume), int(FREE), np.arange(n) + 7, birth)
    return x


# A print of three layers at 0.1 m/s.
DIAMETER, RISE, D = 0.0128, 0.009, 1.5e-3
RATE = 0.1 * math.pi * DIAMETER**2 / 4  # at 0.1 m/s
PASTE = {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 200.0}


def tower_of(toolpath, material=PASTE, spacing=D, **more):
    base = {"speed": 0.1, "layers": 3, "layer_height": RISE, "pause": 0.1}
    return scenario(
        domain={"lower": [-0.6, -0.6, -0.01], "upper": [1.6, 0.6, 0.06]},
        bodies=[],
        material=material,
        nozzle={"diameter": DIAMETER, "exit_speed": 0.1, "standoff": 0.01},
        toolpath={**base, **toolpath},
        spacing=spacing,
        duration=20.0,
        **more,
    )


def wall(length=0.2, **more):
    return tower_of({"kind": "wall", "start": [0.0, 0.0], "end": [length, 0.0]}, **more)


RING = tower_of({"kind": "ring", "center": [0.1, -0.2], "radius": 0.05})
