"""What a run's own process does: simulate, measure, and leave series, last snapshot and record in its folder."""

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .checkpoint import Checkpoints
from .job import Job
from .provenance import HARDWARE, machine
from .scenario import Scenario
from .store import write_atomically, write_parquet, write_record
from .verdict import FINAL, Verdict


def perform(job: Job, folder: Path, report: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    """Run a job in this process; writes the series, the last snapshot and the record into the folder."""
    import pandas as pd

    from .device import quiet_warp

    quiet_warp()
    from .measure.ledger import final_lengths, ledger, lengths
    from .measure.reference import answers
    from .measure.tower import is_tower, success, verdict_of
    from .simulation import Simulation
    from .solver import approximations, get_solver

    scenario = Scenario.model_validate(job.scenario)
    solver = get_solver(job.method)
    heading, about = job.heading(), machine(job.target)
    start = time.perf_counter()
    simulation = Simulation(scenario, solver, job.target)
    rows: list[dict[str, float]] = []
    frames: list[Path] = []
    identity = heading | {name: about[name] for name in HARDWARE} | job.watched()
    checkpoints = Checkpoints(folder, job.checkpoint_every, identity, simulation, rows)

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
    outcome = simulation.run(observe, job.wall_limit, checkpoints)
    undrawn = [] if simulation.film is None else [text for text in [simulation.film.close()] if text]
    frame = simulation.frame()
    series = pd.DataFrame(rows)
    write_parquet(folder / "series.parquet", series)
    save(folder / "final.npz", frame, simulation.now)
    if job.keep_frames:
        frames = [folder / f"frame_{i:04d}.npz" for i in range(len(rows))]
    complete = outcome.verdict is Verdict.COMPLETED
    final = {**ledger(frame, scenario), **final_lengths(frame, scenario)} if complete else {}
    compared, not_compared = answers(scenario, series, final) if complete else ([], [])
    criteria = success(scenario, final, series) if complete and is_tower(scenario) else []
    record = heading | {
        "verdict": str(outcome.verdict), "reason": outcome.reason,
        "measures": final,
        "answers": [asdict(a) for a in compared], "not_compared": not_compared,
        "success": criteria, "print": str(verdict_of(criteria)) if criteria else "",
        "cost": cost(outcome, simulation, time.perf_counter() - start),
        "launches": {
            "per_substep": simulation.substep_launches.count,
            "process_per_tick": simulation.process_launches.count / max(outcome.ticks, 1),
        },
        "bytes": simulation.footprint(),
        "bounds_s": {b.name: b.dt for b in simulation.bounds()},
        "binding_s": outcome.binding,
        "approximations": approximations(solver, scenario, simulation.config),
        "warnings": scenario.warnings() + undrawn,
        "config": simulation.config.model_dump(), "input": scenario.model_dump(mode="json"),
        "machine": about, "film_every": job.film_every, "resumed": checkpoints.resumed,
    }  # fmt: skip
    record = write_record(folder, record, [folder / "series.parquet", folder / "final.npz", *frames])
    if outcome.verdict in FINAL:
        checkpoints.discard()
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
        "peak_memory_MiB": peak_memory() / 2**20,
    }
    if not simulation.scene.device.is_cpu:
        import warp as wp

        row["peak_device_MiB"] = wp.get_mempool_used_mem_high(simulation.scene.device) / 2**20
    return row


def peak_memory() -> float:
    """Most memory that this process has held at once [bytes]."""
    import resource
    import sys

    unit = 1 if sys.platform == "darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)
