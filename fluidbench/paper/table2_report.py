"""What `table2` shows: the paper's rows with its figure beside ours, and its claims as verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import mean

from ..report.report import Report, machine_of, record_link
from ..report.table import Table
from . import PAPER as TITLE
from .rows import Row, claims, published, spread


def report(rows: Sequence[Row], root: Path) -> Report:
    import pandas as pd

    table = Table(
        "Table II",
        [
            "variant",
            "method",
            "pool",
            "particles",
            "dt [ms]",
            "steps/s",
            "simulated/real",
            "steps/s, pictures",
            "simulated/real, pictures",
            "paper: steps of 1 ms / s",
        ],
    )
    data, runs = [], {}
    for row in rows:
        done = [r for r in row.bare if r.ok]
        verdicts = ", ".join(sorted({r.verdict for r in [*row.bare, *row.filmed] if not r.ok}))
        cost = done[0].cost if done else None
        pool = str(row.pool or "as needed")
        table.rows.append(
            [
                row.variant,
                row.method,
                pool,
                str(cost.peak_particles) if cost else "-",
                f"{1e3 * cost.mean_dt_s:.3g}" if cost else "-",
                spread(row.speed()) if done else verdicts,
                spread(row.pace()),
                spread(row.speed(True)),
                spread(row.pace(True)),
                _printed(row),
            ]
        )
        data.append(
            {
                "variant": row.variant,
                "method": row.method,
                "pool": row.pool,
                "verdicts": verdicts,
                "steps_per_s": mean(row.speed()) if done else None,
                "simulated_to_real": mean(row.pace()) if done else None,
                "steps_per_s_pictures": mean(row.speed(True)) if row.speed(True) else None,
                "repeats": len(done),
                "launches_per_substep": done[0].record.launches.get("per_substep") if done else None,
                "bytes": sum(done[0].record.bytes.values()) if done else None,
            }
        )
        runs[f"{row.variant}, {row.method}, pool {pool}"] = [record_link(r, root) for r in [*row.bare, *row.filmed]]
    verdicts = Table("The paper's claims", ["method", "claim", "measured", "verdict"])
    verdicts.rows.extend(list(claim) for claim in claims(rows))
    findings = [f"{m}: '{claim}': {verdict}. {measured}." for m, claim, measured, verdict in claims(rows)]
    return Report(
        "table2",
        "fluidbench table2: the printed tower, feature by feature",
        f'The timing of "{TITLE}": steps a second and simulated over real time, mean ± standard deviation of the '
        "repeats.",
        findings,
        [table, verdicts],
        pd.DataFrame(data),
        [],
        runs,
        machine_of(r for row in rows for r in row.bare),
    )


def _printed(row: Row) -> str:
    """The paper's figure for the variant, in the pool that is nearest to the row's."""
    found = {particles: fps for (variant, particles), fps in published().items() if variant == row.variant}
    return f"{found[min(found, key=lambda n: abs(n - (row.pool or 0)))]:g}"
