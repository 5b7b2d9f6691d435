"""`table2`: the published timing of a printed tower, feature by feature, with and without pictures taken on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

from ..errors import UserError
from ..runs import archive
from ..study.result import Result
from ..study.workplace import Options, Workplace, methods_of
from .rows import Row, check_pools, printed, rows_of, variants_of
from .table2_report import report

WALL_LIMIT = 1800.0  # s
NAME = "timings"  # of what is kept


@dataclass(repr=False)
class Table2(Result):
    """The printed tower timed: `table` has a row for each variant in each pool, see `rows` for the runs."""

    rows: list[Row] = field(default_factory=list)

    def keep(self, folder: Path) -> None:
        keep(self.rows, folder)


def table2(
    methods: Sequence[str] | None = ("mpm",),
    *,
    pools: Sequence[int | None] = (None, 298_000),
    variants: Sequence[str] | None = None,
    repeats: int = 5,
    quick: bool = False,
    **options: Unpack[Options],
) -> Table2:
    """Time the printed tower, feature by feature, with and without pictures; the paper's claims as verdicts.

    `methods` are names, None is all. `pools`: particles to preallocate; None is as many as needed. As in the paper, the
    plain tower is run in all of them and every other in the largest. `variants`: those of VARIANTS that are wanted,
    None is all. `repeats`: runs of each row, for the spread.
    `quick`: shorter towers. One run at a time, so that times [s] mean something. `options` are those of every verb, see
    Options.

    Raises UserError for what cannot be run, before anything is.
    """
    names = methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    check_pools(pools, quick)
    rows = rows_of(names, pools, variants_of(variants))
    planned = [work for row in rows for work in row.jobs(repeats, quick, place)]
    made = iter(place.run(planned, "table2"))
    for row in rows:
        row.bare, row.filmed = ([next(made) for _ in range(repeats)] for _ in range(2))
    machine = archive.where(run for row in rows for run in row.bare)
    for row in rows:
        row.machine = machine
    return _told(rows, place.store.root, keeper=place.keeper)


def published(folder: str | Path, out: str | Path | None = None) -> Table2:
    """The table again from what studies have kept in a `folder`, or in folders inside it: nothing is run.

    Raises UserError where there is none, for one that was changed since, and for studies that cannot stand side
    by side.
    """
    rows: list[Row] = []
    for place in archive.places(Path(folder).expanduser(), NAME, "table2"):
        _add(rows, restore(place), place)
    return _told(rows, Path(folder if out is None else out).expanduser().absolute(), kept=True)


def _add(rows: list[Row], more: Sequence[Row], place: Path) -> None:
    """Put the rows of one more study beside those of others; raises UserError for a second one of a method on the same
    machine, and for one of other towers."""
    for machine, method in {(row.machine, row.method) for row in rows} & {(row.machine, row.method) for row in more}:
        raise UserError(f"{archive.shown(place)}: a second study of {method} on {machine}; each is shown once")
    if rows and more and rows[0].duration != more[0].duration:
        raise UserError(f"{archive.shown(place)}: its towers are not those of the other studies")
    rows += more


def _told(rows: list[Row], root: Path, **more: Any) -> Table2:
    missing = [line for row in rows for line in row.missing()]
    runs = [found for row in rows for found in (*row.bare, *row.filmed)]
    return Table2(report(rows, root), root, runs, missing, not missing, rows=rows, **more)


def keep(rows: Sequence[Row], folder: Path) -> None:
    """Write the records of all runs, and which row they are of, into a folder."""
    told = [
        {
            "variant": row.variant,
            "pool": row.pool,
            "method": row.method,
            "bare": [run.folder.name for run in row.bare],
            "filmed": [run.folder.name for run in row.filmed],
        }
        for row in rows
    ]
    archive.keep(folder, NAME, {"rows": told}, (run for row in rows for run in (*row.bare, *row.filmed)))


def restore(folder: Path) -> list[Row]:
    """The rows that a folder keeps."""
    index, runs = archive.restore(folder, NAME)
    try:
        rows, machine = [], archive.where(runs.values())
        for told in index["rows"]:
            bare, filmed = ([runs[name] for name in told[kind]] for kind in ("bare", "filmed"))
            rows.append(Row(told["variant"], told["pool"], told["method"], bare, filmed, machine))
            printed(told["variant"], told["pool"])
        return rows
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(archive.another_edition(folder, error)) from None
