"""The runs that a choice of method rests on: every method at several spacings, as fine as there is time for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from ..errors import Obstacle, UserError
from ..registry import get_method
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Scenario
from .afford import afford, expected, spacings
from .estimate import estimate
from .selection import ENOUGH, FACTORS, FINEST
from .workplace import Workplace, cores, require_number

WALL_LIMIT = 900.0  # s
TRIAL = 1  # which run of a method, coarsest first, shows how fast it goes here


@dataclass
class Candidates:
    """The runs of one scenario, planned or done, and a line for each method that there is no time to try, or not as
    finely."""

    jobs: list[Job]
    untried: list[str]
    runs: list[Run]

    def of(self, method: str) -> list[Job]:
        return [job for job in self.jobs if job.method == method]


def run_candidates(
    subjects: Mapping[str, Scenario], methods: Sequence[str], place: Workplace, title: str, within: float = math.inf
) -> dict[str, Candidates]:
    """For each subject every method at the spacings that its scenario can have, run; where the whole study has so much
    time [s], finer or coarser, by what one run of each method takes here.

    Raises UserError, before anything is run, for a scenario that cannot be tried at ENOUGH spacings, for a time on a
    GPU, and for one that is not enough for any method by the estimate; Obstacle where it is not by what a run took.
    """
    together = shares_cores(place)
    found = candidates(subjects, methods, place, within)
    if within != math.inf:
        trials = {(name, m): own.of(m)[TRIAL] for name, own in found.items() for m in methods if own.of(m)}
        took = place.run(list(trials.values()), f"{title}: how fast", together)
        found = candidates(subjects, methods, place, within, dict(zip(trials, took, strict=True)))
        for (name, method), job in trials.items():
            if (own := found[name]).of(method) and job not in own.jobs:
                own.jobs.append(job)
    jobs = [job for own in found.values() for job in own.jobs]
    order = sorted(range(len(jobs)), key=lambda i: -expected_of(jobs[i]))  # the longest last would be waited for alone
    runs = dict(zip(order, place.run([jobs[i] for i in order], title, together), strict=True))
    ordered = iter(runs[i] for i in range(len(jobs)))
    for own in found.values():
        own.runs = [next(ordered) for _ in own.jobs]
    return found


def candidates(
    subjects: Mapping[str, Scenario],
    methods: Sequence[str],
    place: Workplace,
    within: float = math.inf,
    trials: Mapping[tuple[str, str], Run] | None = None,
) -> dict[str, Candidates]:
    """The plan of `run_candidates`: as estimated, or by the `trials` of (subject, method), whose time is spent."""
    factors = FACTORS if place.target.device == "cpu" else (*FACTORS, FINEST)
    for name, scenario in subjects.items():
        if not spacings(scenario, factors):
            raise UserError(f"{name}: it cannot have {ENOUGH} spacings near {scenario.spacing:g} m, which are needed")
    wanted = [(name, method) for name in subjects for method in methods]
    pairs = [(subjects[name], method) for name, method in wanted]
    if math.isinf(within):
        made = [spacings(scenario, factors) for scenario, _ in pairs]
    else:
        seconds, paces = _time(place, within, trials or {}), _paces(trials or {})
        usual = median(paces.values()) if paces else 1.0
        made = afford(pairs, factors, seconds, [paces.get(one, usual) for one in wanted])
        if not any(made):
            told = f"within {within:g} s no method can compute {ENOUGH} spacings of {' or '.join(subjects)}"
            if trials:
                raise Obstacle(f"{told}: they take {usual:.2g} times as long here as estimated; ask for more time")
            raise UserError(told)
    found = {name: Candidates([], [], []) for name in subjects}
    for (name, method), (scenario, _), finer in zip(wanted, pairs, made, strict=True):
        found[name].jobs += [_job(s, method, place) for s in finer]
        found[name].untried += _untried(scenario, method, factors, finer)
    return found


def limit_within(within: float) -> float:
    """How long a run may take where nothing else is said [s]. Raises UserError for a study's time that is none."""
    require_number(within, "within", 1.0, high=math.inf)
    return WALL_LIMIT if math.isinf(within) else max(WALL_LIMIT, within)


def shares_cores(place: Workplace) -> bool:
    """Whether runs may go side by side: where what they cost is the CPU time of one core."""
    return place.target.device == "cpu" and place.target.threads == 1


def pace_of(run: Run) -> float:
    """How many times as long as estimated a run takes here, by what of it was run; NaN where that says nothing."""
    cost = run.record.cost
    if cost is None or not cost.simulated_s or not (estimated := expected(run.scenario, run.method)):
        return math.nan
    return cost.wall_s * run.scenario.duration / (cost.simulated_s * estimated)


def expected_of(job: Job) -> float:
    """What a run is estimated to take on one core [s]."""
    return expected(Scenario.model_validate(job.scenario), job.method)


def _time(place: Workplace, within: float, trials: Mapping[tuple[str, str], Run]) -> float:
    """Time of cores [s] that is left of a study's."""
    if place.target.device != "cpu":
        raise UserError("within: time is estimated for a CPU alone")
    busy = min(place.workers, cores()) if shares_cores(place) else place.target.threads
    return within * busy - sum(run.record.cost.total_s for run in trials.values() if run.record.cost is not None)


def _paces(trials: Mapping[tuple[str, str], Run]) -> dict[tuple[str, str], float]:
    return {one: pace for one, run in trials.items() if not math.isnan(pace := pace_of(run))}


def _untried(scenario: Scenario, method: str, factors: Sequence[float], found: Sequence[Scenario]) -> list[str]:
    """What there is no time for, in a line."""
    if not found:
        return [f"{method}: left out: {ENOUGH} spacings take longer than its share of the time"]
    if estimate(found[-1], get_method(method)).refusal:
        return []  # it takes no time, and the selection says why
    if found[-1].spacing > (1.0 + 1e-9) * factors[-1] * scenario.spacing:
        return [f"{method}: no finer than {1e3 * found[-1].spacing:.3g} mm, for want of time"]
    return []


def _job(scenario: Scenario, method: str, place: Workplace) -> Job:
    return Job(scenario.model_dump(mode="json"), method, place.target, wall_limit=place.wall_limit)
