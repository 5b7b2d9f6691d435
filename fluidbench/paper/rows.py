"""Rows of the published timing of a printed tower: a variant in a pool through a method; and the claims on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, hypot, log10
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

ALL = "expansion + curing + drone"
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
    """(method, claim, measured, verdict) of what the paper says of its own table, by wall seconds a simulated second:
    steps a second would flatter whoever needs more of them. A verdict needs two repeats."""
    found = []
    for machine, name in dict.fromkeys((row.machine, row.method) for row in rows):
        own = [row for row in rows if (row.machine, row.method) == (machine, name)]
        method = f"{name}, {machine}" if len({row.machine for row in rows}) > 1 else name
        pace = {(r.variant, r.pool): r.pace() for r in own}
        pools = sorted({r.pool for r in own}, key=lambda pool: pool or 0)
        last = {v: pace[v, pools[-1]] for v in VARIANTS if len(pace.get((v, pools[-1]), [])) > 1}
        if len(pools) > 1:
            found.append((method, "cost insensitive to the pool's size", *_insensitive(pace, pools)))
        if {"plain", "curing", "expansion"} <= set(last):
            found.append((method, "curing a modest overhead, expansion a stronger one", *_stronger(last)))
        if len(last) == len(VARIANTS):
            found.append((method, "both with the drone the most", *_dearest(last)))
        heavy = [r for r in own if r.variant == ALL and len(r.pace(True)) > 1 and len(r.pace()) > 1]
        if heavy:
            share = mean(heavy[-1].pace()) / mean(heavy[-1].pace(True))
            text = f"with pictures {share:.0%} of the speed without"
            found.append((method, "rendering the bottleneck", text, _word(share < BOTTLENECK)))
    return found


def _insensitive(pace: dict, pools: Sequence[int | None]) -> tuple[str, str]:
    small, large = (pace.get(("plain", pool), []) for pool in (pools[0], pools[-1]))
    if min(len(small), len(large)) < 2:
        return "one repeat", OPEN
    factor = mean(large) / mean(small)
    return f"{factor:.2f} times the cost in the large pool", _word(1 / SAME < factor < SAME)


def _stronger(pace: dict[str, list[float]]) -> tuple[str, str]:
    curing, expansion = (mean(pace[variant]) / mean(pace["plain"]) for variant in ("curing", "expansion"))
    text = f"{curing:.2f} times the cost with curing, {expansion:.2f} times with expansion"
    return text, _word(curing < 2.0 and expansion > EFFECT * curing)


def _dearest(pace: dict[str, list[float]]) -> tuple[str, str]:
    """Whether everything together costs the most; open where that and what comes next, or first, are as near as their
    repeats are to one another."""
    text = "s a simulated s: " + ", ".join(f"{variant} {mean(values):.3g}" for variant, values in pace.items())
    rival = max((variant for variant in pace if variant != ALL), key=lambda variant: mean(pace[variant]))
    margin = mean(pace[ALL]) - mean(pace[rival])
    if abs(margin) <= hypot(stdev(pace[ALL]), stdev(pace[rival])):
        return f"{text}: within the spread", OPEN
    return text, _word(margin > 0)


def _word(holds: bool) -> str:
    return CONFIRMED if holds else REFUTED


def spread(values: Sequence[float]) -> str:
    """Mean and standard deviation, to four digits of the mean."""
    if not values:
        return "-"
    places = max(0, 3 - floor(log10(max(abs(mean(values)), 1e-9))))
    return " ± ".join(f"{figure:,.{places}f}" for figure in (mean(values), *([stdev(values)] if values[1:] else [])))
