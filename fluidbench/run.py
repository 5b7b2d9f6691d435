"""One run in one child process: scenario and method in, record out.

The child gets clean peak memory and a wall limit; a crash of the child becomes a verdict. It reports progress as lines
of JSON on its standard output, and ends itself when its parent is gone (its standard input closes).
"""

import json
import os
import platform
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from . import __version__
from .scenario import Scenario
from .store import RECORD, write_atomically
from .target import BACKENDS, HERE, Target

PROGRESS = "@progress "
GRACE = 120.0  # seconds beyond the wall limit for compiling, measuring and writing


@dataclass(frozen=True)
class Job:
    """Everything that determines a run."""

    scenario: dict[str, Any]
    method: str
    target: Target = HERE
    repeat: int = 0
    wall_limit: float | None = None
    keep_frames: bool = False
    film_every: float | None = None

    def inputs(self) -> dict[str, Any]:
        """What names the run; how long it may take does not."""
        unused = {"film_every"} if self.film_every is None else set()
        return {k: v for k, v in asdict(self).items() if k not in {"wall_limit", *unused}}


def launch(job: Job, folder: Path, progress: Callable[[dict[str, Any]], None] | None = None) -> dict[str, Any]:
    """Run a job in a child process and return its record; whatever happens to the child, there is a record."""
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / "job.json", json.dumps(asdict(job), indent=1))
    (folder / RECORD).unlink(missing_ok=True)
    limit = None if job.wall_limit is None else job.wall_limit + GRACE
    with (folder / "log.txt").open("w") as log:
        child = subprocess.Popen(
            [sys.executable, "-m", "fluidbench.run", str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True,
        )  # fmt: skip
        killer = threading.Timer(limit, child.kill) if limit is not None else None
        if killer is not None:
            killer.start()
        try:
            assert child.stdout is not None
            for line in child.stdout:
                if line.startswith(PROGRESS):
                    if progress is not None:
                        progress(json.loads(line[len(PROGRESS) :]))
                else:
                    log.write(line)
            child.wait()
        except BaseException:
            child.kill()
            child.wait()
            raise
        finally:
            if killer is not None:
                killer.cancel()
    path = folder / RECORD
    if path.is_file():
        return json.loads(path.read_text())
    return _post_mortem(job, folder, child.returncode, killer is not None and killer.finished.is_set())


def _post_mortem(job: Job, folder: Path, code: int, timed: bool) -> dict[str, Any]:
    """The record of a child that left none."""
    lines = (folder / "log.txt").read_text(errors="replace").strip().splitlines()
    last = lines[-1] if lines else "no message"
    reason = f"the run's process ended with code {code}: {last}"
    record = {
        "scenario": job.scenario["name"], "method": job.method, **asdict(job.target),
        "repeat": job.repeat, "verdict": "timeout" if timed and code < 0 else "error", "reason": reason,
    }  # fmt: skip
    write_atomically(folder / RECORD, json.dumps(record, indent=1))
    return record


def perform(job: Job, folder: Path, report: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Run a job in this process; writes the series, the last snapshot and the record into the folder."""
    import pandas as pd

    from .device import quiet_warp

    quiet_warp()
    from .measure.ledger import final_lengths, ledger, lengths
    from .measure.reference import answers
    from .measure.tower import is_tower, success
    from .simulation import Simulation, Verdict
    from .solver import approximations, get_solver

    scenario = Scenario.model_validate(job.scenario)
    solver = get_solver(job.method)
    about = machine(job.target)
    start = time.perf_counter()
    simulation = Simulation(scenario, solver, job.target)
    rows: list[dict[str, float]] = []

    def observe(sim: Simulation, vital: Any) -> None:
        frame = sim.frame()
        rows.append(
            {"time_s": sim.now, "top_speed_m_s": vital.speed, **ledger(frame, scenario), **lengths(frame, scenario)}
        )
        if job.keep_frames:
            save(folder / f"frame_{len(rows) - 1:04d}.npz", frame, sim.now)
        report({"time": sim.now, "until": scenario.duration, "speed": vital.speed})

    if job.film_every is not None:
        from .report.film import Film

        simulation.film = Film(folder / "film", job.scenario, job.film_every)
    outcome = simulation.run(observe, job.wall_limit)
    if simulation.film is not None:
        simulation.film.close()
    frame = simulation.frame()
    series = pd.DataFrame(rows)
    series.to_parquet(folder / "series.parquet")
    save(folder / "final.npz", frame, simulation.now)
    complete = outcome.verdict is Verdict.COMPLETED
    final = {**ledger(frame, scenario), **final_lengths(frame, scenario)} if complete else {}
    record = {
        "scenario": scenario.name, "method": job.method, **asdict(job.target),
        "repeat": job.repeat, "seed": scenario.seed, "spacing_m": scenario.spacing,
        "verdict": str(outcome.verdict), "reason": outcome.reason,
        "measures": final,
        "answers": [asdict(a) for a in answers(scenario, series, final)] if complete else [],
        "success": success(scenario, final, series) if complete and is_tower(scenario) else [],
        "cost": cost(outcome, simulation, time.perf_counter() - start),
        "launches": {
            "per_substep": simulation.substep_launches.count,
            "process_per_tick": simulation.process_launches.count / max(outcome.ticks, 1),
        },
        "bytes": simulation.footprint(),
        "bounds_s": {b.name: b.dt for b in simulation.bounds()},
        "binding_s": outcome.binding,
        "approximations": approximations(solver, scenario, simulation.config),
        "warnings": scenario.warnings(),
        "config": simulation.config.model_dump(), "input": scenario.model_dump(mode="json"),
        "machine": about,
    }  # fmt: skip
    write_atomically(folder / RECORD, json.dumps(record, indent=1))
    return record


def save(path: Path, frame: dict[str, Any], time: float) -> None:
    """A snapshot and its time, written atomically."""
    import io

    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, time=time, **frame)
    write_atomically(path, buffer.getvalue())


def cost(outcome: Any, simulation: Any, total: float) -> dict[str, float]:
    """What a run cost, compilation apart; rates are of the loop alone, measurements and output not included."""
    wall, cpu = max(outcome.wall, 1e-9), max(outcome.cpu, 1e-9)
    bytes_used = sum(simulation.footprint().values())
    row = {
        "simulated_s": outcome.time,
        "wall_s": outcome.wall,
        "cpu_s": outcome.cpu,
        "prepare_s": outcome.prepare_wall,
        "total_s": total,
        "substeps": outcome.substeps,
        "mean_dt_s": outcome.time / max(outcome.substeps, 1),
        "steps_per_s": outcome.substeps / wall,
        "particle_substeps_per_s": outcome.particle_substeps / wall,
        "particle_substeps_per_cpu_s": outcome.particle_substeps / cpu,
        "wall_per_simulated_s": wall / max(outcome.time, 1e-12),
        "simulated_to_real": outcome.time / wall,
        "peak_particles": outcome.peak_particles,
        "bytes_per_particle": bytes_used / max(simulation.pool.size, 1),
        "peak_memory_MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    if not simulation.scene.device.is_cpu:
        import warp as wp

        row["peak_device_MiB"] = wp.get_mempool_used_mem_high(simulation.scene.device) / 2**20
    return row


def machine(target: Target) -> dict[str, str]:
    """What it ran on."""
    import numpy as np
    import warp as wp

    device = wp.get_device(target.device)
    arch = platform.machine() if device.is_cpu else f"sm_{device.arch}"
    return {
        "fluidbench": __version__, "python": platform.python_version(), "warp": str(wp.config.version),
        "backend_version": version(BACKENDS[target.backend]), "arch": arch,
        "numpy": np.__version__, "platform": platform.platform(), "cores": str(os.cpu_count()),
        "device": device.name or platform.processor(), "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }  # fmt: skip


def _end_with_parent() -> None:
    """Leave as soon as the parent is gone: its end of our standard input closes."""

    def wait() -> None:
        sys.stdin.read()
        os._exit(3)

    threading.Thread(target=wait, daemon=True).start()


def main(folder: Path) -> None:
    """The child's entry point."""
    _end_with_parent()
    table = json.loads((folder / "job.json").read_text())
    job = Job(**table | {"target": Target(**table["target"])})

    def report(state: dict[str, Any]) -> None:
        print(PROGRESS + json.dumps(state), flush=True)

    perform(job, folder, report)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
