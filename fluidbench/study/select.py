"""`select`: which method and spacing meet a tolerance at least cost on this machine, and on what evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Unpack

from ..errors import UserError
from ..runs.job import Job
from ..scenario import Scenario
from ..scenario.measured import Measured
from .afford import afford, spacings
from .result import Result
from .select_report import report
from .selection import ENOUGH, FACTORS, FINEST, Selection, assess
from .workplace import Options, Workplace, as_scenario, cores, measured_of, methods_of, require_number

WALL_LIMIT = 900.0  # s


@dataclass
class Planned:
    """The runs of a selection, and a line for each method that there is no time to try, or not as finely."""

    jobs: list[Job]
    untried: list[str]


@dataclass(repr=False)
class Selected(Result):
    """A recommendation with its evidence: `table` has a row for every candidate; `found` is all that it rests on."""

    found: Selection = field(default_factory=lambda: Selection([], {}, {}, []))


def select(
    scenario: Scenario | str | Path,
    methods: Sequence[str] | None = None,
    *,
    tolerance: float = 0.05,
    budget: float = math.inf,
    pace: float = math.inf,
    within: float = math.inf,
    called: str = "",
    measured: str | Path | Sequence[Measured] = (),
    **options: Unpack[Options],
) -> Selected:
    """Recommend a method, spacing and time step: least cost within a `tolerance` (largest relative error of any
    length), within a `budget` of time [s] and a `pace` (s per simulated s), on this machine.

    Runs every method at four spacings, on a GPU at five. `scenario` is one, a shipped name or a TOML file; `methods`
    are names, default all. `called` is the scenario's name in the command that it recommends. `measured`: a table of
    what was measured on a real print (CSV), which errors are then counted from, beside what the scenario has of it.
    `within`: time [s] that the study may take on a CPU, as estimated: spacings are so much finer or coarser, method by
    method. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is.
    """
    require_number(tolerance, "tolerance", 1e-6)
    resolved, names = as_scenario(scenario), methods_of(methods, options)
    place = Workplace.of(options, WALL_LIMIT, names)
    beside = measured_of(resolved, measured)
    (planned,) = candidates({resolved.name: resolved}, names, place, within).values()
    runs = place.run(planned.jobs, "select", together=shares_cores(place))
    found = assess(resolved, names, runs, beside, planned.untried)
    made = report(resolved, called or resolved.name, found, tolerance, budget, pace, place.store.root)
    missing = found.missing()
    ok = bool(found.candidates) and not missing
    return Selected(made, place.store.root, found.runs, missing, ok, place.keeper, found)


def shares_cores(place: Workplace) -> bool:
    """Whether runs may go side by side: where what they cost is the CPU time of one core."""
    return place.target.device == "cpu" and place.target.threads == 1


def candidates(
    subjects: Mapping[str, Scenario], methods: Sequence[str], place: Workplace, within: float = math.inf
) -> dict[str, Planned]:
    """For each subject every method at the spacings that its scenario can have; finer or coarser where the whole study
    has so much time [s]. Raises UserError for a scenario that cannot be tried at ENOUGH, where the time is not enough
    for any, and for a time on a GPU."""
    if within != math.inf:
        require_number(within, "within", 1.0)
    factors = FACTORS if place.target.device == "cpu" else (*FACTORS, FINEST)
    for name, scenario in subjects.items():
        if not spacings(scenario, factors):
            raise UserError(f"{name}: it cannot have {ENOUGH} spacings near {scenario.spacing:g} m, which are needed")
    wanted = [(scenario, method) for scenario in subjects.values() for method in methods]
    if math.isinf(within):
        made = [spacings(scenario, factors) for scenario, _ in wanted]
    else:
        if place.target.device != "cpu":
            raise UserError("within: time is estimated for a CPU alone")
        busy = min(place.workers, cores()) if shares_cores(place) else place.target.threads
        made = afford(wanted, factors, within * busy)
        place = replace(place, wall_limit=max(place.wall_limit, within))
        if not any(made):
            raise UserError(f"within {within:g} s no method can compute {ENOUGH} spacings of {' or '.join(subjects)}")
    found = {name: Planned([], []) for name in subjects}
    names = [name for name in subjects for _ in methods]
    for name, (scenario, method), scenarios in zip(names, wanted, made, strict=True):
        found[name].jobs += [_job(s, method, place) for s in scenarios]
        found[name].untried += _untried(scenario, method, factors, scenarios)
    return found


def _untried(scenario: Scenario, method: str, factors: Sequence[float], found: Sequence[Scenario]) -> list[str]:
    """What there is no time for, in a line."""
    if not found:
        return [f"{method}: left out: {ENOUGH} spacings take longer than its share of the time"]
    if found[-1].spacing > (1.0 + 1e-9) * factors[-1] * scenario.spacing:
        return [f"{method}: no finer than {1e3 * found[-1].spacing:.3g} mm, for want of time"]
    return []


def _job(scenario: Scenario, method: str, place: Workplace) -> Job:
    return Job(scenario.model_dump(mode="json"), method, place.target, wall_limit=place.wall_limit)
