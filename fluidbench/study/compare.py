"""`compare`: one scenario through several methods, fidelity beside cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..run import Job
from ..scenario import Scenario
from ..solver import check_backend, configure, get_solver
from ..store import write_atomically
from ..target import Target
from .execute import Finished

if TYPE_CHECKING:
    import pandas as pd


def jobs(
    scenario: Scenario, methods: Sequence[str], repeats: int, targets: Sequence[Target], wall_limit: float | None,
    keep_frames: bool, film_every: float | None = None,
) -> list[Job]:  # fmt: skip
    """All runs of a comparison; raises UserError for an unknown method or setting before anything has run."""
    for name in methods:
        configure(get_solver(name), scenario)
        for target in targets:
            check_backend(get_solver(name), target)
    table = scenario.model_dump(mode="json")
    return [
        Job(table, name, target, repeat, wall_limit, keep_frames, film_every)
        for name in methods
        for target in targets
        for repeat in range(repeats)
    ]


def tidy(results: Sequence[Finished]) -> pd.DataFrame:
    """One row a run: what it was, how it ended, what it measured, how far off it was and what it cost."""
    import pandas as pd

    rows = []
    for result in results:
        record = result.record
        row = {
            k: record.get(k)
            for k in ("scenario", "method", "device", "backend", "threads", "repeat", "seed", "spacing_m")
        }
        row |= {"verdict": record["verdict"], "reason": record.get("reason", "")}
        row |= record.get("measures", {})
        row |= {f"error: {a['quantity']}": a["error"] for a in record.get("answers", [])}
        row |= record.get("cost", {})
        row["binding_bound"] = binding(record)
        row |= {f"machine_{k}": v for k, v in record.get("machine", {}).items()}
        rows.append(row)
    return pd.DataFrame(rows)


def lengths_of(record: dict[str, Any]) -> dict[str, float]:
    """The lengths, areas and slumps of a finished run: what a printer cares about."""
    wanted = ("bead_width_m", "bead_height_m", "bead_area_m2", "slump", "spread_radius_m", "front_x_m", "height_m")
    measures = record.get("measures", {})
    layers = [key for key in measures if key.startswith("layer_") and key.endswith(("height_m", "width_m", "radius_m"))]
    return {key: float(measures[key]) for key in (*wanted, *layers) if math.isfinite(measures.get(key, math.nan))}


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
