"""Throughput of MPM alone: a static block on the floor of a 1 m^3 domain, 64 cells/m, 7 mm particles.

A step is 10 substeps of 0.1 ms of the elasto-viscoplastic law, captured as a whole. Prints one JSON line a size:

    python benchmarks/mpm_block.py --device cuda:0 --particles 17000 298000
    python benchmarks/mpm_block.py --device cpu --particles 17000 --steps 20
"""

import argparse
import json
import math
import time

import warp as wp

from fluidbench.method.target import Target
from fluidbench.native.device import quiet_warp
from fluidbench.native.simulation import Simulation
from fluidbench.scenario import Domain, Scenario
from fluidbench.scenario.body import Body
from fluidbench.scenario.material import Material

SPACING, CELLS, DT, SUBSTEPS = 7e-3, 64, 1e-4, 10


def block(particles: int) -> Scenario:
    """A cube of at least this many particles standing on a rough floor."""
    side = math.ceil(particles ** (1 / 3)) * SPACING
    return Scenario(
        name="block",
        domain=Domain(lower=(-0.5, -0.5, 0.0), upper=(0.5, 0.5, 1.0)),
        material=Material(density=1000, youngs_modulus=1e6, poisson_ratio=0.3, yield_stress=5e3, plastic_viscosity=10),
        bodies=(Body(kind="box", center=(0.0, 0.0, side / 2), size=(side, side, side)),),
        duration=10.0,
        spacing=SPACING,
        numerics={"mpm": {"grid_ratio": 1.0 / CELLS / SPACING}},
    )


def measure(particles: int, device: str, steps: int, warmup: int) -> dict[str, object]:
    """Steps a second, and particle-substeps per wall and CPU second, of the replayed graph alone."""
    simulation = Simulation(block(particles), "mpm", Target(device))
    simulation.prepare()
    simulation.begin()
    for _ in range(warmup):
        simulation.march(DT, SUBSTEPS)  # records it
    wp.synchronize_device(device)
    wall, cpu = time.perf_counter(), time.process_time()
    for _ in range(steps):
        simulation.march(DT, SUBSTEPS)
    wp.synchronize_device(device)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    n = simulation.pool.counts[0]
    vital = simulation.look()
    return {
        "benchmark": "mpm_block",
        "device": device,
        "particles": n,
        "steps": steps,
        "steps_per_s": steps / wall,
        "particle_substeps_per_s": n * steps * SUBSTEPS / wall,
        "particle_substeps_per_cpu_s": n * steps * SUBSTEPS / cpu,
        "microseconds_a_substep": 1e6 * wall / (steps * SUBSTEPS),
        "top_speed_m_s": vital.speed,
        "complaint": vital.complaint,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--particles", type=int, nargs="+", default=[17_000])
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--warmup", type=int, default=5)
    a = parser.parse_args()
    quiet_warp()
    for particles in a.particles:
        print(json.dumps(measure(particles, a.device, a.steps, a.warmup)), flush=True)


if __name__ == "__main__":
    main()
