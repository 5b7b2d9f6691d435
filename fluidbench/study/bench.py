"""`bench`: what a machine does, method by method, beside what its memory allows and what others have published."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

from ..errors import UserError
from ..method.target import Target
from ..runs.experiment import CRASH, Experiment
from .bench_report import report
from .result import Result
from .speed import speed_tasks
from .workplace import Options, Workplace, methods_of, names_of, require_number

WALL_LIMIT = 600.0  # s
SIDES = {"cpu": (13, 26), "cuda": (26, 67)}  # particles along an edge of a block
SECONDS, QUICK = 5.0, 1.0  # wall time that a block is measured for
LARGEST = 200_000_000


@dataclass(repr=False)
class Bench(Result):
    """Speeds: `table` has a row for every method, material and size."""


def bench(
    methods: Sequence[str] | None = None,
    *,
    particles: Sequence[int] | None = None,
    quick: bool = False,
    **options: Unpack[Options],
) -> Bench:
    """Measure the substep of every method alone: blocks of liquid and of paste at rest, one at a time, always anew.

    `methods` are names, default all. `particles` are sizes, rounded to cubes; default 2,197 and 17,576 on the CPU,
    17,576 and 300,763 on a GPU. `quick`: for 1 instead of 5 [s] each. `options` are those of every verb, see Options.

    Raises UserError for what is not known, before anything is run.
    """
    names = methods_of(methods, options)
    place = Workplace.of(options | {"fresh": True}, WALL_LIMIT, names)
    tasks = speed_tasks(names, sides_of(particles, place.target), QUICK if quick else SECONDS, place.target)
    work = [
        Experiment(
            "fluidbench.study.speed:measure_speed",
            label,
            task["method"],
            task,
            Target(**task["target"]),
            place.wall_limit,
        )
        for label, task in tasks
    ]
    found = place.run(work, "blocks")
    rows = [
        {"method": t["method"], "material": t["material"], "particles": t["side"] ** 3, "reason": r[CRASH]}
        if CRASH in r
        else r
        for (_, t), r in zip(tasks, found, strict=True)
    ]
    missing = [
        f"{r['method']}, {r['material']}, {r['particles']}: {r['reason']}"
        for r in rows
        if "reason" in r and not r.get("refused")
    ]
    return Bench(report(rows, place.target), place.store.root, missing=missing, ok=not missing, keeper=place.keeper)


def sides_of(particles: Sequence[int] | None, target: Target) -> list[int]:
    """Particles along an edge of each block; raises UserError for a number that is none."""
    if particles is None:
        return list(SIDES["cpu" if target.device == "cpu" else "cuda"])
    for number in names_of(particles, "particles") or []:
        require_number(number, "particles", 216, whole=True)
        if number > LARGEST:
            raise UserError(f"particles: at most {LARGEST} (got {number})")
    return list(dict.fromkeys(round(number ** (1.0 / 3.0)) for number in particles))
