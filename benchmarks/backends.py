"""Every method in both languages: throughput and cold compile time, each in a process of its own.

A cylinder of paste slumps on a rough floor (the scenario column_slump, at the spacing that gives about the wanted
number of particles). Prints the table of docs/backends.md:

    python benchmarks/backends.py --device cpu --particles 25000
    python benchmarks/backends.py --device cuda:0 --particles 300000
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time

from fluidbench.method.target import BACKENDS, Target
from fluidbench.native.solver import Solver
from fluidbench.registry import get_method, method_names
from fluidbench.scenario.library import load

WARMUP_TICKS = 3


def measure(method: str, target: Target, particles: int, seconds: float) -> dict[str, float]:
    """Particle-substeps a second of wall and CPU time over whole ticks, and the seconds to compile."""
    from fluidbench.native.device import quiet_warp
    from fluidbench.native.simulation import Simulation

    quiet_warp()
    base = load("column_slump", {})
    spacing = (base.bodies[0].volume / 4 / particles) ** (1 / 3)  # a quarter lies inside the domain
    sim = Simulation(load("column_slump", {"spacing": spacing}), method, target)
    start = time.perf_counter()
    sim.prepare()
    compiled = time.perf_counter() - start
    for _ in range(WARMUP_TICKS):
        sim.advance_tick()
    sim.look()
    wall, cpu, substeps = time.perf_counter(), time.process_time(), 0
    while time.perf_counter() - wall < seconds:
        substeps += sim.advance_tick().substeps
        vital = sim.look()
        assert not vital.complaint, vital.complaint
    wall, cpu, active = time.perf_counter() - wall, time.process_time() - cpu, sum(sim.pool.counts)
    return {
        "particles": active,
        "compile_s": compiled,
        "substeps_per_s": substeps / wall,
        "per_wall_s": substeps * active / wall,
        "per_cpu_s": substeps * active / cpu,
    }


def apart(method: str, target: Target, particles: int, seconds: float) -> dict[str, float]:
    """`measure` in a new process with empty kernel caches."""
    with tempfile.TemporaryDirectory() as cache:
        env = os.environ | {"WARP_CACHE_PATH": cache, "TI_OFFLINE_CACHE_FILE_PATH": cache}
        one = json.dumps([method, vars(target), particles, seconds])
        done = subprocess.run([sys.executable, __file__, "--one", one], env=env, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--particles", type=int, default=25_000)
    parser.add_argument("--seconds", type=float, default=5.0)
    native = [name for name in method_names() if issubclass(get_method(name), Solver)]
    parser.add_argument("--solvers", default=",".join(native))
    parser.add_argument("--one", help=argparse.SUPPRESS)
    a = parser.parse_args()
    if a.one:
        method, target, particles, seconds = json.loads(a.one)
        print(json.dumps(measure(method, Target(**target), particles, seconds)))
        return
    threads = sorted({1, os.cpu_count() or 1}) if a.device == "cpu" else [1]
    targets = [Target(a.device, b, n) for b in BACKENDS for n in threads if b != "warp" or n == 1]
    head = [
        "method",
        "backend",
        "device",
        "threads",
        "particles",
        "particle-substeps/s",
        "the same per CPU s",
        "substeps/s",
        "compile s",
    ]
    print(f"| {' | '.join(head)} |\n{'| --- ' * len(head)}|")
    for method in a.solvers.split(","):
        for t in targets:
            r = apart(method, t, a.particles, a.seconds)
            threads = t.threads if t.device == "cpu" else "-"
            cells = [
                method,
                t.backend,
                t.device,
                threads,
                r["particles"],
                f"{r['per_wall_s']:.3g}",
                f"{r['per_cpu_s']:.3g}",
                f"{r['substeps_per_s']:.4g}",
                f"{r['compile_s']:.3g}",
            ]
            print(f"| {' | '.join(map(str, cells))} |", flush=True)


if __name__ == "__main__":
    main()
