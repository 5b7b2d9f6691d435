"""`validate`: cases with known answers through every method at several spacings: error, observed order, cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

from ..errors import UserError
from ..method.verdict import lacking
from .case import Case, select
from .result import Result
from .trials import LAST_SEED, Trial, plan, run
from .validate_report import report
from .workplace import Options, Workplace, methods_of, names_of, require_number

WALL_LIMIT = 1800.0  # s


@dataclass(repr=False)
class Validation(Result):
    """Cases with known answers through methods: `table` has a row for each of `trials`."""

    trials: list[Trial] = field(default_factory=list)


def validate(
    cases: Sequence[str | Path | Case] | None = None,
    methods: Sequence[str] | None = None,
    *,
    levels: Sequence[str] = ("coarse",),
    quick: bool = False,
    seed: int = 0,
    **options: Unpack[Options],
) -> Validation:
    """Run cases with known answers through every method: error, observed order and cost beside the tolerance.

    `cases` are names of shipped ones, Python files that define CASE, or cases; default all. `levels` are spacings:
    rough, coarse, medium, fine (1.5, 1, 2/3 and 1/2 of a case's own [m]). `methods`: their names; default all. `quick`:
    a few minutes, every physics. `seed`: where it is not 0, what bodies begin with is shifted at random, by up to a
    twentieth of a spacing. `options` are those of every verb, see Options.

    Raises UserError for what is not known, before anything is run.
    """
    names = methods_of(methods, options)
    require_number(seed, "seed", 0, whole=True, high=LAST_SEED)
    place = Workplace.of(options, WALL_LIMIT, names)
    cases, levels = names_of(cases, "cases"), names_of(levels, "levels") or ()
    if not levels:
        raise UserError("levels: none is named")
    if cases is not None and not cases:
        raise UserError("cases: none is named; leave them out for all")
    chosen = select(cases or [])
    if cases and quick and (long := [case.name for case in chosen if case.quick is None]):
        raise UserError(f"{', '.join(long)}: too dear to have a quick version; leave quick out")
    trials = plan(chosen, names, levels, quick, place.target, place.wall_limit, seed)
    run(trials, place)
    return result_of(trials, place)


def result_of(trials: list[Trial], place: Workplace) -> Validation:
    root = place.store.root
    runs = [found for t in trials for found in t.runs.values()]
    judged = [t for t in trials if t.judged]
    ok = all(t.held for t in judged) and bool(judged)
    return Validation(report(trials, root), root, runs, lacking(judged), ok, keeper=place.keeper, trials=trials)
