"""Rows of the published timing of a printed tower: a variant in a pool through a method; and the claims on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import mean, stdev

from ..errors import UserError, quoted, suggestion
from ..measure.reference import table
from ..method.verdict import lacking
from ..runs.job import Job
from ..runs.record import Run
from ..scenario.layout import capacity_of
from ..scenario.library import load
from ..study.workplace import Workplace
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

SAME, BOTTLENECK = 1.2, 0.5


@dataclass
class Row:
    """A variant in a pool, through one method: its repeats without and with pictures, all on one machine."""

    variant: str
    pool: int | None
    method: str
    bare: list[Run] = field(default_factory=list)
    filmed: list[Run] = field(default_factory=list)
    machine: str = ""  # in a word or two, see archive.where

    def jobs(self, repeats: int, quick: bool, place: Workplace) -> list[Job]:
        """Its runs: without pictures first, then with."""
        scenario = load(VARIANTS[self.variant], {} if self.pool is None else {"pool": self.pool}, quick)
        table = scenario.model_dump(mode="json")
        return [
            Job(table, self.method, place.target, r, variant, place.wall_limit, film_every=every)
            for variant, every in (("", None), ("pictures", PICTURE))
            for r in range(repeats)
        ]

    @property
    def duration(self) -> float | None:
        """What was simulated [s]; None where nothing was run."""
        return next((run.record.input["duration"] for run in self.bare if run.record.input), None)

    def speed(self, filmed: bool = False) -> list[float]:
        """Steps a second of every repeat; none where one is not a result."""
        return self._costs("steps_per_s", filmed)

    def pace(self, filmed: bool = False) -> list[float]:
        """Wall seconds a simulated second of every repeat; none where one is not a result."""
        return self._costs("wall_per_simulated_s", filmed)

    def _costs(self, key: str, filmed: bool) -> list[float]:
        return figures({"": self.filmed if filmed else self.bare}, key).get("", [])

    def missing(self) -> list[str]:
        """Runs that the row needs and has nothing of."""
        return lacking([*self.bare, *self.filmed])


def variants_of(names: Sequence[str] | None) -> list[str]:
    """Variants in the paper's order, None is all; raises UserError for a name that is none of theirs."""
    for name in names or ():
        if name not in VARIANTS:
            raise UserError(f"variants: no {quoted(name)}{suggestion(name, VARIANTS)}")
    return [name for name in VARIANTS if names is None or name in names]


def rows_of(
    methods: Sequence[str], pools: Sequence[int | None], variants: Sequence[str] = tuple(VARIANTS)
) -> list[Row]:
    """As the paper has them: the plain tower in every pool, each other variant in the largest."""
    sizes = sorted(set(pools), key=lambda pool: pool or 0)
    return [
        Row(variant, pool, method)
        for method in methods
        for pool in sizes
        for variant in variants
        if variant == "plain" or pool == sizes[-1]
    ]


@dataclass(frozen=True)
class Printed:
    """What the paper has of a row: wall seconds a simulated second, mean and standard deviation of five repeats."""

    particles: int
    bare: tuple[float, float]
    filmed: tuple[float, float]


def printed(variant: str, pool: int | None) -> Printed:
    """The paper's row of a variant, in the pool that is nearest to this one: 17,000 where it is as small as can be."""
    found = table("table2_published").to_dict("records")
    own = [row for row in found if row["variant"] == variant.replace(" + ", "_")]
    near = min(own, key=lambda row: abs(row["particles"] - (pool or 0)))
    bare, filmed = (
        (float(near[f"sim_real_{kind}"]), float(near[f"sim_real_{kind}_sd"])) for kind in ("headless", "rendering")
    )
    return Printed(int(near["particles"]), bare, filmed)


def check_pools(pools: Sequence[int | None], quick: bool) -> None:
    """Raise UserError for a pool that a variant cannot be run in."""
    for name in VARIANTS.values():
        for pool in pools:
            capacity_of(load(name, {} if pool is None else {"pool": pool}, quick))


def claims(rows: Sequence[Row]) -> list[tuple[str, str, str, str]]:
    """(method, claim, measured, verdict) of what the paper says of its own table; a verdict needs two repeats."""
    found = []
    for machine, name in dict.fromkeys((row.machine, row.method) for row in rows):
        own = [row for row in rows if (row.machine, row.method) == (machine, name)]
        method = f"{name}, {machine}" if len({row.machine for row in rows}) > 1 else name
        speed = {(r.variant, r.pool): r.speed() for r in own}
        pools = sorted({r.pool for r in own}, key=lambda pool: pool or 0)
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
