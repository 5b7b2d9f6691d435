"""What `table2` shows: the paper's rows with its figures beside ours, and its claims as verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from ..report.report import Report, machine_of, record_link
from ..report.table import Table
from ..runs.archive import of_other_code
from ..study.again import command_of
from . import PAPER as TITLE
from .rows import Row, claims, printed, spread

NOTE = (
    "wall seconds a simulated second, mean ± standard deviation of the repeats; steps/s: steps of the method's own "
    "length; paper: MPM in Genesis on one RTX 5090, steps of 0.1 ms, five repeats, in pools of 17,000 (the first row) "
    "and 298,000 particles"
)


def report(rows: Sequence[Row], root: Path) -> Report:
    import pandas as pd

    shown, told = _timing(rows), claims(rows)
    verdicts = Table("The paper's claims", ["method", "claim", "measured", "verdict"], [list(claim) for claim in told])
    findings = [f"{m}: '{claim}': {verdict}. {measured}." for m, claim, measured, verdict in told]
    runs = {_name(row): [record_link(r, root) for r in [*row.bare, *row.filmed]] for row in rows}
    machines = [f"{m}: {machine_of(r for row in rows if row.machine == m for r in row.bare)}" for m in _machines(rows)]
    methods = dict.fromkeys(row.method for row in rows)
    mixed = of_other_code({m: [r for row in rows if row.method == m for r in row.bare] for m in methods})
    return Report(
        "table2",
        "fluidbench table2: the printed tower, feature by feature",
        f'The timing of "{TITLE}", beside the same towers here.',
        findings + [f"{line}." for line in mixed],
        [shown, verdicts],
        pd.DataFrame([_row(row) for row in rows]),
        [],
        runs,
        "; ".join(machines),
        files={"table2.md": _markdown(rows, shown, verdicts, [*machines, *mixed])},
    )


def _machines(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.machine for row in rows))


def _name(row: Row) -> str:
    return f"{row.variant}, {row.method}, pool {row.pool or 'as needed'}, {row.machine}"


def _timing(rows: Sequence[Row]) -> Table:
    """A row each: ours without and with pictures, and the paper's beside each."""
    several = len(_machines(rows)) > 1
    head = ["", *(["machine"] if several else []), "method", "pool", "s / sim. s", "paper", "with pictures", "paper"]
    table = Table("Table II", [*head, "particles", "dt [ms]", "steps/s"], note=NOTE)
    for row in rows:
        done = [r for r in row.bare if r.ok]
        cost = done[0].cost if done else None
        told = printed(row.variant, row.pool)
        begins = [row.variant, *([row.machine] if several else []), row.method, str(row.pool or "as needed")]
        size = ["-", "-"] if cost is None else [str(cost.peak_particles), f"{1e3 * cost.mean_dt_s:.3g}"]
        own = spread(row.pace()) if row.pace() else _verdicts(row)
        theirs = ("-", "-") if row.method != "mpm" else (_given(told.bare), _given(told.filmed))
        figures = [own, theirs[0], spread(row.pace(True)), theirs[1]]
        table.rows.append([*begins, *figures, *size, spread(row.speed())])
    return table


def _given(figure: tuple[float, float]) -> str:
    return f"{figure[0]:.4g} ± {figure[1]:.2g}"


def _verdicts(row: Row) -> str:
    """How the runs that are no results ended."""
    return ", ".join(sorted({r.verdict for r in [*row.bare, *row.filmed] if not r.ok})) or "-"


def _row(row: Row) -> dict[str, Any]:
    done = [r for r in row.bare if r.ok]
    told = printed(row.variant, row.pool) if row.method == "mpm" else None
    return {
        "variant": row.variant,
        "machine": row.machine,
        "method": row.method,
        "pool": row.pool,
        "verdicts": "" if _verdicts(row) == "-" else _verdicts(row),
        "steps_per_s": mean(row.speed()) if row.speed() else None,
        "wall_per_simulated_s": mean(row.pace()) if row.pace() else None,
        "wall_per_simulated_s_pictures": mean(row.pace(True)) if row.pace(True) else None,
        "paper_wall_per_simulated_s": told.bare[0] if told else None,
        "paper_wall_per_simulated_s_pictures": told.filmed[0] if told else None,
        "repeats": len(done),
        "launches_per_substep": done[0].record.launches.get("per_substep") if done else None,
        "bytes": sum(done[0].record.bytes.values()) if done else None,
    }


def _markdown(rows: Sequence[Row], shown: Table, verdicts: Table, notes: Sequence[str]) -> str:
    """A page of its own, with the commands that make its runs again."""
    import pandas as pd

    def table(t: Table) -> str:
        return pd.DataFrame(t.rows, columns=pd.RangeIndex(len(t.head))).to_markdown(
            index=False, disable_numparse=True, headers=t.head
        )

    again = dict.fromkeys(command_of(row.bare[0]) or "" for row in rows if row.bare)
    return "\n".join(
        [
            "# Table II, by measurement",
            "",
            f'The printed tower of "{TITLE}", feature by feature.',
            "",
            table(shown),
            "",
            f"{shown.note[0].upper()}{shown.note[1:]}.",
            "",
            table(verdicts),
            "",
            *(f"- {note}" for note in notes),
            "",
            "```sh",
            *(line for line in again if line),
            "```",
            "",
        ]
    )
