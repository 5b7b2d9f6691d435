"""`compare`: one scenario through several methods, fidelity beside cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..job import Job
from ..scenario import Scenario
from ..solver import check_backend, configure, get_solver
from ..target import Target
from .execute import Finished

if TYPE_CHECKING:
    import pandas as pd


def jobs(
    scenario: Scenario, methods: Sequence[str], repeats: int, targets: Sequence[Target], **watched: Any
) -> list[Job]:
    """All runs of a comparison, `watched` as a Job says; raises UserError for an unknown method or setting, and for a
    scenario that this machine cannot hold, before anything has run."""
    for name in methods:
        configure(get_solver(name), scenario)
        for target in targets:
            check_backend(get_solver(name), target)
    table = scenario.model_dump(mode="json")
    return [
        Job(table, name, target, repeat, **watched)
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
        row |= {"verdict": result.verdict, "reason": result.reason, "reused": result.reused}
        row |= {"print": record.get("print", "")} | record.get("measures", {})
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
