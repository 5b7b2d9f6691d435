"""`table2`: the published timing of a printed tower, feature by feature, with and without pictures taken on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean, stdev
from typing import Unpack

from ..measure.reference import table
from ..method.verdict import lacking
from ..runs.job import Job
from ..runs.record import Run
from ..scenario.layout import capacity_of
from ..scenario.library import load
from ..study.result import Result
from ..study.workplace import Options, Workplace, methods_of
from .cells import figures
from .verdicts import CONFIRMED, EFFECT, OPEN, REFUTED

VARIANTS = {
    "plain": "ring_tower",
    "curing": "ring_tower_curing",
    "expansion": "ring_tower_expansion",
    "expansion + curing": "ring_tower_expansion_curing",
    "expansion + curing + drone": "ring_tower_drone",
}
PICTURE = 0.033  # simulated time between pictures [s]
WALL_LIMIT = 1800.0  # s
SAME, BOTTLENECK = 1.2, 0.5


@dataclass
class Row:
    """A variant in a pool, through one method: its repeats without and with pictures."""

    variant: str
    pool: int | None
    method: str
    bare: list[Run] = field(default_factory=list)
    filmed: list[Run] = field(default_factory=list)

    def jobs(self, repeats: int, quick: bool, place: Workplace) -> list[Job]:
        """Its runs: without pictures first, then with."""
        scenario = load(VARIANTS[self.variant], {} if self.pool is None else {"pool": self.pool}, quick)
        table = scenario.model_dump(mode="json")
        return [
            Job(table, self.method, place.target, r, variant, place.wall_limit, film_every=every)
            for variant, every in (("", None), ("pictures", PICTURE))
            for r in range(repeats)
        ]

    def speed(self, filmed: bool = False) -> list[float]:
        """Steps a second of every repeat; none where one is not a result."""
        return self._costs("steps_per_s", filmed)

    def pace(self, filmed: bool = False) -> list[float]:
        """Simulated over real time of every repeat; none where one is not a result."""
        return self._costs("simulated_to_real", filmed)

    def _costs(self, key: str, filmed: bool) -> list[float]:
        return figures({"": self.filmed if filmed else self.bare}, key).get("", [])

    def missing(self) -> list[str]:
        """Runs that the row needs and has nothing of."""
        return lacking([*self.bare, *self.filmed])


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
    from .table2_report import report

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


def published() -> dict[tuple[str, int], float]:
    """(variant, particles) -> whole steps a second without pictures, as printed: steps of 1 ms, of 10 substeps each."""
    rows = table("table2_published").to_dict("records")
    names = {name.replace(" + ", "_"): name for name in VARIANTS}
    return {(names[row["variant"]], int(row["particles"])): float(row["fps_headless"]) for row in rows}


def check_pools(pools: Sequence[int | None], quick: bool) -> None:
    """Raise UserError for a pool that a variant cannot be run in."""
    for name in VARIANTS.values():
        for pool in pools:
            capacity_of(load(name, {} if pool is None else {"pool": pool}, quick))


def claims(rows: Sequence[Row]) -> list[tuple[str, str, str, str]]:
    """(method, claim, measured, verdict) of what the paper says of its own table; a verdict needs two repeats."""
    found = []
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        speed = {(r.variant, r.pool): r.speed() for r in own}
        pools = list(dict.fromkeys(r.pool for r in own))
        last = pools[-1]
        found.append((method, "cost insensitive to the pool's size", *_insensitive(speed, pools)))
        if enough := [v for v in VARIANTS if len(speed.get((v, last), [])) > 1]:
            s = {v: mean(speed[v, last]) for v in enough}
            if {"plain", "curing", "expansion"} <= set(s):
                cure, grow = s["plain"] / s["curing"], s["plain"] / s["expansion"]
                ok = cure < 2.0 and grow > EFFECT * cure
                text = f"steps/s fall {cure:.2f}-fold with curing, {grow:.2f}-fold with expansion"
                found.append((method, "curing a modest overhead, expansion a stronger one", text, _word(ok)))
            if len(s) == len(VARIANTS):
                slowest = min(s, key=lambda v: s[v])
                text = ", ".join(f"{v} {x:.0f}" for v, x in s.items())
                found.append(
                    (
                        method,
                        "both with the drone the most",
                        f"steps/s: {text}",
                        _word(slowest == "expansion + curing + drone"),
                    )
                )
        heavy = [r for r in own if r.variant == "expansion + curing + drone" and len(r.speed(True)) > 1]
        if heavy and len(heavy[-1].speed()) > 1:
            share = mean(heavy[-1].speed(True)) / mean(heavy[-1].speed())
            text = f"with pictures {share:.0%} of the steps/s without"
            found.append((method, "rendering the bottleneck", text, _word(share < BOTTLENECK)))
    return found


def _insensitive(speed: dict, pools: Sequence[int | None]) -> tuple[str, str]:
    small, large = (speed.get(("plain", pool), []) for pool in (pools[0], pools[-1]))
    if len(pools) < 2 or min(len(small), len(large)) < 2:
        return "one pool, or one repeat", OPEN
    factor = mean(small) / mean(large)
    return f"{factor:.2f}-fold from the small to the large pool", _word(1 / SAME < factor < SAME)


def _word(holds: bool) -> str:
    return CONFIRMED if holds else REFUTED


def spread(values: Sequence[float]) -> str:
    """Mean and standard deviation."""
    if not values:
        return "-"
    return f"{mean(values):.4g}" + (f" ± {stdev(values):.2g}" if len(values) > 1 else "")
