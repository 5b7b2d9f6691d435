"""What `validate` runs: a case through a method at a spacing, its jobs, and what came out of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UserError, quoted, suggestion
from ..method.target import Target
from ..method.verdict import Evidence, Verdict, evidence_of
from ..registry import get_method
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.numerics import configure
from .case import METHOD_OF_LAW, Case, Finding, check_finding, scenarios_of
from .workplace import Workplace

if TYPE_CHECKING:
    import pandas as pd


LEVELS = {"rough": 1.5, "coarse": 1.0, "medium": 1 / 1.5, "fine": 0.5}  # factors on a case's coarse spacing

SHAKE = 0.05  # of a spacing
LAST_SEED = 2**32 - 1

PASS, MISS, EXEMPT, SKIPPED = "pass", "MISS", "exempt", "skipped"


@dataclass
class Trial:
    """One case through one method at one spacing: its jobs and, once they have ended, what came out."""

    case: Case
    method: str
    level: str
    spacing: float
    jobs: dict[str, Job] = field(default_factory=dict)
    verdict: str = ""
    note: str = ""
    finding: Finding | None = None
    cost: dict[str, float] = field(default_factory=dict)
    runs: dict[str, Run] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The trial in words."""
        return f"{self.case.name}, {self.method}, d = {1e3 * self.spacing:.3g} mm"

    @property
    def reason(self) -> str:
        return self.note

    @property
    def judged(self) -> bool:
        """Whether it was to be run at all."""
        return self.verdict != SKIPPED

    @property
    def held(self) -> bool:
        """Whether nothing speaks against its method: within tolerance, exempt from it, or not to be run."""
        return self.verdict in (PASS, EXEMPT, SKIPPED)

    @property
    def evidence(self) -> Evidence:
        """What it says of its method: a finding is a result, whatever became of the tolerance."""
        if self.finding is not None:
            return Evidence.RESULT
        return evidence_of(self.verdict) if self.judged else Evidence.NOTHING

    @property
    def error(self) -> float:
        return math.nan if self.finding is None else self.finding.error

    @property
    def tolerance(self) -> float:
        return self.case.limit(self.method, self.spacing / self.case.spacing)


def plan(
    chosen: Sequence[Case],
    methods: Sequence[str],
    levels: Sequence[str],
    quick: bool,
    target: Target,
    wall_limit: float | None,
    seed: int = 0,
) -> list[Trial]:
    """Every trial with its jobs; a method that is skipped has none and says why. A `seed` shakes what bodies begin
    with."""
    trials = []
    levels = list(levels)
    for case in chosen:
        if quick and case.quick is None:
            continue
        steps = {"quick": case.quick or case.spacing} if quick else {n: case.spacing * _factor(n) for n in levels}
        for level, spacing in steps.items():
            if case.drive is not None:
                trials.append(Trial(case, METHOD_OF_LAW, level, spacing))
                continue
            for method in methods:
                if quick and (case.skips(method) or method in case.exempt):
                    continue
                trial = Trial(case, method, level, spacing)
                if reason := case.skips(method):
                    trial.verdict, trial.note = SKIPPED, reason
                else:
                    made = {label: shaken(s, seed) for label, s in scenarios_of(case, spacing).items()}
                    trial.jobs = _jobs(made, method, target, wall_limit)
                trials.append(trial)
    return trials


def shaken(scenario: Scenario, seed: int) -> Scenario:
    """The scenario with its bodies' particles shifted at random, by a twentieth of a spacing where it says nothing; as
    it is for a seed of 0."""
    return scenario.replace(seed=seed, jitter=scenario.jitter or SHAKE) if seed else scenario


def _factor(level: str) -> float:
    if level not in LEVELS:
        raise UserError(f"no level {quoted(level)}{suggestion(level, LEVELS)}")
    return LEVELS[level]


def _jobs(scenarios: dict[str, Scenario], method: str, target: Target, wall_limit: float | None) -> dict[str, Job]:
    for scenario in scenarios.values():
        configure(get_method(method), scenario)
    return {
        label: Job(scenario.model_dump(mode="json"), method, target, wall_limit=wall_limit, keep_frames=True)
        for label, scenario in scenarios.items()
    }


def run(trials: Sequence[Trial], place: Workplace, title: str = "known answers", together: bool = True) -> None:
    """Run all jobs, side by side unless told otherwise, and evaluate each trial as soon as its last job has ended."""
    for trial in trials:
        if trial.case.drive is not None:
            evaluate_law(trial)
    flat = [(trial, label) for trial in trials for label in trial.jobs]

    def ended(i: int, finished: Run) -> str:
        trial, label = flat[i]
        trial.runs[label] = finished
        if len(trial.runs) < len(trial.jobs):
            return ""
        evaluate(trial)
        return line(trial)

    place.run([trial.jobs[label] for trial, label in flat], title, together=together, line=ended)


def evaluate(trial: Trial) -> None:
    """Judge a trial whose runs have all ended; where one has no result the trial has no cost, but for its particles."""
    runs = list(trial.runs.values())
    failed = [run for run in runs if not run.ok]
    costs = [run.record.cost for run in runs if run.record.cost is not None]
    particles = {"particles": max((cost.peak_particles for cost in costs), default=0)}
    if failed:
        first = min(failed, key=lambda run: run.evidence is Evidence.INSTABILITY)
        trial.verdict, trial.note, trial.cost = first.verdict, first.reason, particles
        return
    simulated = sum(cost.simulated_s for cost in costs)
    trial.cost = particles | {
        "substeps": sum(cost.substeps for cost in costs),
        "wall_s": sum(cost.wall_s for cost in costs),
        "cpu_s": sum(cost.cpu_s for cost in costs),
        "wall_per_simulated_s": sum(cost.wall_s for cost in costs) / simulated if simulated else math.nan,
    }
    judge(trial, lambda case: case.evaluate({label: trial.runs[label] for label in trial.jobs}))


def evaluate_law(trial: Trial) -> None:
    """Drive a law at one point, in this process."""
    start = time.perf_counter()
    judge(trial, lambda case: case.drive(trial.spacing))
    trial.cost = {"particles": 1, "wall_s": time.perf_counter() - start}


def judge(trial: Trial, found: Callable[[Any], Any]) -> None:
    """Take a case's finding and judge it. One case's mistake must not end the others: it is shown as what it is."""
    try:
        finding = found(trial.case)
        trial.finding = check_finding(finding)
    except (Exception, SystemExit) as error:
        trial.verdict, trial.note = Verdict.ERROR, f"its evaluation failed: {type(error).__name__}: {error}"
        return
    _judge(trial)


def _judge(trial: Trial) -> None:
    if trial.error <= trial.tolerance:
        trial.verdict = PASS
    elif trial.method in trial.case.exempt:
        trial.verdict, trial.note = EXEMPT, trial.case.exempt[trial.method]
    else:
        trial.verdict, trial.note = MISS, trial.case.causes.get(trial.method, "no cause known")


def orders(trials: Sequence[Trial]) -> dict[tuple[str, str], tuple[float, int]]:
    """(case, method) -> (observed order, number of spacings): least-squares slope of log error over log spacing."""
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in trials:
        if trial.finding is not None and trial.error > 0:
            groups.setdefault((trial.case.name, trial.method), []).append(trial)
    return {
        key: (float(np.polyfit(np.log([t.spacing for t in g]), np.log([t.error for t in g]), 1)[0]), len(g))
        for key, g in groups.items()
        if len(g) > 1
    }


def tidy(trials: Sequence[Trial]) -> pd.DataFrame:
    """One row a trial."""
    import pandas as pd

    slopes = orders(trials)
    rows = []
    for t in trials:
        slope, spacings = slopes.get((t.case.name, t.method), (math.nan, 1))
        row = {
            "case": t.case.name,
            "physics": t.case.physics,
            "method": t.method,
            "level": t.level,
            "spacing_m": t.spacing,
            "error": t.error,
            "tolerance": t.tolerance,
            "measure": t.case.measure,
            "order": slope,
            "order_spacings": spacings,
            "verdict": t.verdict,
            "note": t.note,
            "source": t.case.source,
        }
        rows.append(row | t.cost)
    return pd.DataFrame(rows)


def line(trial: Trial) -> str:
    """One trial in a line."""
    note = f"  ({trial.note})" if trial.note else ""
    return (
        f"{trial.case.name:<20} {trial.method:<4} d = {trial.spacing:<9.3g} error {shown_error(trial.error):>9} of "
        f"{trial.tolerance:<7.3g} {trial.verdict}{note}"
    )


def shown_error(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"
