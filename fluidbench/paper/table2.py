"""`table2`: the published timing of a printed tower, feature by feature, with and without pictures taken on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Unpack

from ..study.result import Result
from ..study.workplace import Options, Workplace, methods_of
from .rows import VARIANTS, Row, check_pools
from .table2_report import report

WALL_LIMIT = 1800.0  # s


@dataclass(repr=False)
class Table2(Result):
    """The printed tower timed: `table` has a row for each variant in each pool, see `rows` for the runs."""

    rows: list[Row] = field(default_factory=list)


def table2(
    methods: Sequence[str] | None = ("mpm",),
    *,
    pools: Sequence[int | None] = (None, 298_000),
    repeats: int = 5,
    quick: bool = False,
    **options: Unpack[Options],
) -> Table2:
    """Time the printed tower, feature by feature, with and without pictures; the paper's claims as verdicts.

    `methods` are names, None is all. `pools`: particles to preallocate; None is as many as needed. `repeats`: runs of
    each row, for the spread. `quick`: shorter towers. One run at a time, so that times [s] mean something. `options`
    are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    names = methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    check_pools(pools, quick)
    rows = [Row(variant, pool, method) for method in names for pool in pools for variant in VARIANTS]
    planned = [work for row in rows for work in row.jobs(repeats, quick, place)]
    made = iter(place.run(planned, "table2"))
    for row in rows:
        row.bare, row.filmed = ([next(made) for _ in range(repeats)] for _ in range(2))
    missing = [line for row in rows for line in row.missing()]
    runs = [found for row in rows for found in (*row.bare, *row.filmed)]
    return Table2(report(rows, place.store.root), place.store.root, runs, missing, not missing, place.keeper, rows)
