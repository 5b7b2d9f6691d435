"""`compare`: one scenario through several methods, fidelity beside cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..run import Job, launch
from ..scenario import Scenario
from ..solver import configure, get_solver
from ..store import Store, write_atomically

if TYPE_CHECKING:
    import pandas as pd

ADVICE = {
    "diverged": "its results are left out of every comparison",
    "out_of_capacity": "see the reason for the setting to raise",
    "timeout": "raise --wall-limit, or use a larger --spacing",
    "error": "see log.txt in the run's folder",
}


@dataclass(frozen=True)
class Finished:
    """A run's record and the folder that holds its files; `reused` when an earlier call had finished it."""

    record: dict[str, Any]
    folder: Path
    reused: bool

    @property
    def ok(self) -> bool:
        return self.record["verdict"] == "completed"

    @property
    def label(self) -> str:
        return str(self.record["method"])


def jobs(
    scenario: Scenario, methods: Sequence[str], repeats: int, device: str, backend: str, wall_limit: float | None,
    keep_frames: bool,
) -> list[Job]:  # fmt: skip
    """All runs of a comparison; raises UserError for an unknown method or setting before anything has run."""
    for name in methods:
        configure(get_solver(name), scenario)
    table = scenario.model_dump(mode="json")
    return [
        Job(table, name, device, backend, repeat, wall_limit, keep_frames)
        for name in methods
        for repeat in range(repeats)
    ]


def compare(
    planned: Sequence[Job], store: Store, started: Callable[[int, Job, bool], None],
    progress: Callable[[int, dict[str, Any]], None], ended: Callable[[int, Finished], None],
) -> list[Finished]:  # fmt: skip
    """Run what is not finished yet, one run at a time so that timings mean something."""
    results = []
    for i, job in enumerate(planned):
        folder = store.folder(f"{job.scenario['name']}-{job.method}", job.inputs())
        record = store.record(folder)
        reused = record is not None
        started(i, job, reused)
        if record is None:
            record = _refused(job, folder) or launch(job, folder, lambda state, i=i: progress(i, state))
        results.append(Finished(record, folder, reused))
        ended(i, results[-1])
    return results


def _refused(job: Job, folder: Path) -> dict[str, Any] | None:
    """The record of a method that will not run the scenario."""
    import json

    scenario = Scenario.model_validate(job.scenario)
    solver = get_solver(job.method)
    reason = solver.refuses(scenario, configure(solver, scenario))
    if reason is None:
        return None
    record = {
        "scenario": scenario.name, "method": job.method, "device": job.device, "backend": job.backend,
        "repeat": job.repeat, "verdict": "refused", "reason": reason,
    }  # fmt: skip
    write_atomically(folder / "record.json", json.dumps(record, indent=1))
    return record


def tidy(results: Sequence[Finished]) -> pd.DataFrame:
    """One row a run: what it was, how it ended, what it measured, how far off it was and what it cost."""
    import pandas as pd

    rows = []
    for result in results:
        record = result.record
        row = {k: record.get(k) for k in ("scenario", "method", "device", "backend", "repeat", "seed", "spacing_m")}
        row |= {"verdict": record["verdict"], "reason": record.get("reason", "")}
        row |= record.get("measures", {})
        row |= {f"error: {a['quantity']}": a["error"] for a in record.get("answers", [])}
        row |= record.get("cost", {})
        row["binding_bound"] = binding(record)
        row |= {f"machine_{k}": v for k, v in record.get("machine", {}).items()}
        rows.append(row)
    return pd.DataFrame(rows)


def binding(record: dict[str, Any]) -> str:
    """The bound that held the step back for most of the simulated time."""
    held = record.get("binding_s") or {}
    return max(held, key=held.__getitem__) if held else ""


def write_tables(table: pd.DataFrame, root: Path) -> list[Path]:
    """The table as parquet and CSV."""
    import io

    buffer = io.BytesIO()
    table.to_parquet(buffer)
    write_atomically(root / "compare.parquet", buffer.getvalue())
    write_atomically(root / "compare.csv", table.to_csv(index=False))
    return [root / "compare.parquet", root / "compare.csv"]
