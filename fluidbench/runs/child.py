"""What a run's own process does: simulate, measure, and leave series, last snapshot and record in its folder."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import write_npz, write_parquet
from ..method.contract import Session
from ..method.frame import Frame
from ..method.suitability import approximations
from ..method.verdict import FINAL, Verdict
from ..method.vitals import Vital
from ..registry import get_method
from ..scenario import Scenario
from ..scenario.numerics import configure
from .checkpoint import Checkpoints
from .drive import Drive, Outcome
from .film import Film
from .job import Job
from .provenance import HARDWARE, machine
from .record import FINAL_FRAME, SERIES, Cost, Record, frame_name, keep

if TYPE_CHECKING:
    import pandas as pd


def perform(job: Job, folder: Path, report: Callable[[dict[str, Any]], None]) -> Record:
    """Run a job in this process; writes the series, the last snapshot and the record into the folder."""
    import pandas as pd

    from ..measure.rest import at_rest

    scenario = Scenario.model_validate(job.scenario)
    method = get_method(job.method)
    heading, about = job.heading(), machine(job.target)
    start = time.perf_counter()
    session = method.start(scenario, configure(method, scenario), job.target)
    rows: list[dict[str, float]] = []
    film = None if job.film_every is None else Film(folder / "film", job.scenario, job.film_every)
    identity = heading | {name: about[name] for name in HARDWARE} | job.watched()
    every = job.checkpoint_every if session.resumable else 0.0
    checkpoints = Checkpoints(folder, every, identity, session, rows, film)

    def observe(session: Session, vital: Vital) -> None:
        frame = session.frame()
        rows.append(row_of(frame, scenario, vital))
        if job.keep_frames:
            write_npz(folder / frame_name(len(rows) - 1), frame)
        report({"time": session.now, "until": scenario.duration, "speed": vital.speed})

    def rests() -> bool:
        return at_rest(pd.DataFrame(rows), scenario)

    awaited = rests if scenario.until == "rest" else None
    outcome = Drive(session, scenario, observe, job.wall_limit, checkpoints, film, awaited).run()
    undrawn = [] if film is None else [text for text in [film.close()] if text]
    frame, series = session.frame(), pd.DataFrame(rows)
    write_parquet(folder / SERIES, series)
    write_npz(folder / FINAL_FRAME, frame)
    frames = [frame_name(i) for i in range(len(rows))] if job.keep_frames else []
    found = results(scenario, frame, series) if outcome.verdict is Verdict.COMPLETED else {}
    told = session.statistics()
    warnings = scenario.warnings() + undrawn + found.pop("warnings", []) + _unconverged(told.get("solves", {}))
    record = Record(
        **heading,
        verdict=outcome.verdict,
        reason=outcome.reason,
        **found,
        cost=cost(outcome, session, time.perf_counter() - start),
        **told,
        bytes=session.footprint(),
        bounds_s={b.name: b.dt for b in session.bounds()},
        binding_s=outcome.binding,
        approximations=tuple(approximations(method, scenario, session.config)),
        warnings=tuple(warnings),
        config=session.config.model_dump(),
        input=scenario.model_dump(mode="json"),
        machine=about,
        film_every=job.film_every,
        resumed=checkpoints.resumed,
    )
    record = keep(folder, record, [SERIES, FINAL_FRAME, *frames])
    if outcome.verdict in FINAL:
        checkpoints.discard()
    session.close()
    return record


def row_of(frame: Frame, scenario: Scenario, vital: Vital) -> dict[str, float]:
    """A row of a run's series: what is measured at an output."""
    from ..measure.ledger import ledger, lengths

    measured = ledger(frame, scenario) | lengths(frame, scenario)
    return {"time_s": float(frame["time"]), "top_speed_m_s": vital.speed, **measured}


def results(scenario: Scenario, frame: Frame, series: pd.DataFrame) -> dict[str, Any]:
    """What a completed run comes to, by the names that its record has for it."""
    from ..measure.feed import fed
    from ..measure.ledger import final_lengths, ledger
    from ..measure.order import departures, order
    from ..measure.reference import answers
    from ..measure.rest import at_rest, creep, moving
    from ..measure.tower import Print, is_tower, is_wall, success, verdict_of, wall_collapse

    final = ledger(frame, scenario) | final_lengths(frame, scenario) | fed(series)
    final |= order(frame, scenario) | creep(series, scenario)
    compared, not_compared = answers(scenario, series, final)
    criteria = success(scenario, final, series) if is_tower(scenario) else []
    printed = verdict_of(criteria) if criteria else None
    fell = printed is Print.COLLAPSED and is_wall(scenario)
    restless = scenario.until == "rest" and not at_rest(series, scenario)
    unrest = [f"still moves after {scenario.duration:g} s, and was to be at rest"] if restless else []
    return {
        "measures": final,
        "moving": moving(series, scenario),
        "answers": tuple(compared),
        "not_compared": tuple(not_compared),
        "success": tuple(criteria),
        "print": printed,
        "collapse": wall_collapse(scenario, series) if fell else None,
        "warnings": _numberless(final) + departures(final) + unrest,
    }


def _unconverged(solves: dict[str, float]) -> list[str]:
    if not solves.get("unconverged"):
        return []
    share, worst = solves["unconverged"], solves["residual"]
    return [f"{share:.2g} of its viscous solves ended too early, with residuals up to {worst:.2g} of velocity and dt g"]


def _numberless(measures: dict[str, float]) -> list[str]:
    return [f"{name} is no number" for name, value in measures.items() if not math.isfinite(value)]


def cost(outcome: Outcome, session: Session, total: float) -> Cost:
    """What a run cost, compilation apart; rates are of the loop alone, measurements and output not included."""
    wall, cpu = max(outcome.wall, 1e-9), max(outcome.cpu, 1e-9)
    bytes_used = sum(session.footprint().values())
    device = session.peak_device_bytes()
    return Cost(
        simulated_s=outcome.simulated,
        wall_s=outcome.wall,
        cpu_s=outcome.cpu,
        prepare_s=outcome.prepare_wall,
        total_s=total,
        substeps=outcome.substeps,
        mean_dt_s=outcome.simulated / max(outcome.substeps, 1),
        steps_per_s=outcome.substeps / wall,
        particle_substeps_per_s=outcome.particle_substeps / wall,
        particle_substeps_per_cpu_s=outcome.particle_substeps / cpu,
        wall_per_simulated_s=wall / max(outcome.simulated, 1e-12),
        simulated_to_real=outcome.simulated / wall,
        peak_particles=outcome.peak_particles,
        bytes_per_particle=bytes_used / max(session.capacity, 1),
        peak_memory_MiB=peak_memory() / 2**20,
        peak_device_MiB=None if device is None else device / 2**20,
    )


def peak_memory() -> float:
    """Most memory that this process has held at once [bytes]."""
    import psutil

    info = psutil.Process().memory_info()
    if hasattr(info, "peak_wset"):  # Windows
        return float(info.peak_wset)
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)
