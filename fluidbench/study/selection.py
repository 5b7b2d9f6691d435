"""What `select` rests on: every candidate with its estimated error, and what is known of each method.

A scenario without an exact answer gets its error estimated in three parts, all relative to a length:

- discretisation: each length is extrapolated within a method to zero spacing by least squares over all spacings run,
  the finer ones counting more: at first or at second order, or not at all, whichever foretells each spacing best from
  the others (where it is not at all, a slope would be noise, and the mean is the limit); the error at a spacing is the
  distance to that limit, or the scatter about the fit from there down if that is larger;
- bias: the distance of a method's limit from the consensus, the mean limit of the trusted methods;
- trust: a method is trusted when it passes most known answers of the scenario's own physics
  (scenarios/reference/known_answers.csv, made by `fluidbench validate`).

A length with an exact answer (a bead's area) is judged against that alone, and one that was measured on a real print
against the measurement alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..measure.order import departures
from ..measure.reference import table as reference
from ..method.verdict import lacking
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.measured import Measured
from .fit import NOISE, Fit, extrapolate
from .lengths import lengths_of
from .remarks import excluded, scattered, unconverged

FACTORS = (2.0, 1.5, 1.0, 0.75)  # spacings tried, over the scenario's
FINEST = 0.5  # and on a GPU

ENOUGH = 3  # spacings needed for an extrapolation

FALLS = 0.5  # observed order from which an error counts as falling


@dataclass(frozen=True)
class Trust:
    """How a method did on the known answers of the scenario's physics."""

    passed: int
    judged: int

    @property
    def trusted(self) -> bool:
        return self.passed > 0.5 * self.judged


@dataclass
class Candidate:
    """One method at one spacing: its cost, its estimated error and the parts of it."""

    method: str
    spacing: float
    dt: float
    seconds: float  # what it cost, see Record.seconds
    pace: float  # seconds per simulated s
    discretisation: float
    bias: float
    unbiased: float  # the largest discretisation of any length: the error, if its own limits were right
    run: Run

    @property
    def error(self) -> float:
        return self.discretisation + self.bias


@dataclass
class Selection:
    """Everything that the choice rests on; `scenario` is at any of its spacings."""

    candidates: list[Candidate]
    trust: dict[str, Trust]
    limits: dict[str, dict[str, float]]
    runs: list[Run]
    notes: list[str] = field(default_factory=list)
    untried: list[str] = field(default_factory=list)  # what there was no time for
    scenario: Scenario | None = None
    erratic: dict[str, str] = field(default_factory=dict)  # methods with a length that no fit explains: which, and why

    @property
    def remarks(self) -> list[str]:
        """What there was no time for, and what was noted of the rest."""
        return [*self.untried, *self.notes]

    def missing(self) -> list[str]:
        """Runs that it wanted and has nothing of; that a method refuses is an answer."""
        return lacking(self.runs, refusals=False)

    def witnesses(self) -> list[str]:
        """Trusted methods whose limits are known here."""
        return [m for m in self.limits if self.trust[m].trusted and self.limits[m]]

    def order(self, method: str) -> float:
        """Least-squares slope of log error over log spacing of a method's candidates; NaN below ENOUGH of them."""
        own = [c for c in self.candidates if c.method == method and c.discretisation > 0]
        if len(own) < ENOUGH:
            return math.nan
        return float(np.polyfit(np.log([c.spacing for c in own]), np.log([c.discretisation for c in own]), 1)[0])

    def slack(self, method: str) -> str:
        """What a method's error does where it does not fall as it is refined: in all, and at the finest spacing once
        more, where it is more than noise; nothing where it falls, or was never more than noise."""
        own = sorted((c for c in self.candidates if c.method == method), key=lambda c: c.spacing)
        if len(own) < ENOUGH:
            return f"is known at fewer than {ENOUGH} spacings"
        finest = own[0].discretisation
        if finest == 0 or all(c.discretisation <= NOISE for c in own):
            return ""
        if not (order := self.order(method)) > 0:
            return "does not fall with the spacing"
        if order <= FALLS:
            return f"hardly falls with the spacing: by an order of {order:.3g}, and {FALLS:g} is wanted"
        if finest > max(NOISE, own[1].discretisation * (1.0 + 1e-9)):
            return "does not fall any more at the finest spacing"
        return ""

    def converges(self, method: str) -> bool:
        """Whether every length of a method goes with the spacing or has settled, and its error falls."""
        return method not in self.erratic and not self.slack(method)

    def front(self) -> list[Candidate]:
        """The candidates that none beats in both cost and error, cheapest first."""
        best, kept = math.inf, []
        for c in sorted(self.candidates, key=lambda c: (c.seconds, c.error)):
            if c.error < best:
                best = c.error
                kept.append(c)
        return kept

    def recommend(self, tolerance: float, budget: float, pace: float) -> tuple[Candidate | None, str]:
        """The cheapest within tolerance, time [s] and pace (s per simulated s); or the nearest, and why."""
        good = [c for c in self.candidates if c.error <= tolerance]
        affordable = [c for c in good if c.seconds <= budget and c.pace <= pace]
        if affordable:
            return min(affordable, key=lambda c: c.seconds), ""
        if good:
            return min(
                good, key=lambda c: c.seconds
            ), "nothing within the tolerance meets the budget; this is the fastest"
        if self.candidates:
            return min(self.candidates, key=lambda c: c.error), "nothing tried meets the tolerance; this is the nearest"
        return None, "no method completed at three spacings"


def physics_of(scenario: Scenario) -> set[str]:
    """The classes of known answers that the scenario's material and process belong to."""
    m = scenario.material
    classes = {"emission"} if scenario.nozzle is not None else set()
    classes |= {"process"} if m.expansion is not None or m.cure is not None else set()
    if m.relaxation_time is not None:
        return classes | {"viscoelastic"}
    if m.is_solid:
        return classes | {"elastic"}
    if m.yield_stress:
        return classes | {"yield stress"}
    return classes | ({"viscous"} if m.viscosity > 0 else {"liquid"})


def trust_of(scenario: Scenario, methods: Sequence[str]) -> dict[str, Trust]:
    """From the shipped table of known answers: cases of this physics within their tolerance."""
    rows = reference("known_answers")
    near = [row for row in rows.to_dict("records") if row["physics"] in physics_of(scenario)]
    found = {}
    for method in methods:
        own = [row["error"] <= row["tolerance"] for row in near if row["method"] == method]
        found[method] = Trust(sum(own), len(own))
    return found


def assess(
    scenario: Scenario,
    methods: Sequence[str],
    runs: Sequence[Run],
    measured: Sequence[Measured] = (),
    untried: Sequence[str] = (),
    trust: dict[str, Trust] | None = None,
) -> Selection:
    """Errors of all candidates from finished runs, against what was `measured` where that is known; `untried` is what
    there was no time for. Runs of an earlier edition bring the `trust` of its known answers along."""
    told = averages(measured)
    done = [run for run in runs if run.ok and not departures(run.record.measures)]
    known = trust or trust_of(scenario, methods)
    result = Selection([], known, {}, list(runs), untried=list(untried), scenario=scenario)
    fits: dict[str, dict[str, Fit]] = {}
    for method in methods:
        own = [r for r in done if r.method == method]
        if len(own) < ENOUGH:
            result.notes += excluded(method, runs, len(own), ENOUGH)
            continue
        every = [lengths_of(r.record) for r in own]
        shared = [key for key in every[0] if all(key in lengths for lengths in every)]
        if left := sorted({key for lengths in every for key in lengths} - set(shared)):
            result.notes.append(f"{method}: left out, for want of it at some spacing: {', '.join(left)}")
        fits[method] = {key: extrapolate(own, key) for key in shared}
        result.limits[method] = {key: fit.limit for key, fit in fits[method].items()}
        estimated = {key: fit for key, fit in fits[method].items() if key not in exact_lengths(own[0]) | told}
        if why := scattered(estimated, own):
            result.erratic[method] = why
    for run in runs:
        result.notes += [f"{run.name}: left out: {line}" for line in departures(run.record.measures) if run.ok]
        if restless := [key for key in run.record.moving if key in lengths_of(run.record)]:
            still = f"at spacing {run.record.spacing_m:.4g} m"
            result.notes.append(f"{run.method} {still}: not at rest at the end: {', '.join(restless)}")
    found = {key for run in runs if run.ok for key in lengths_of(run.record)}
    for one in measured:
        if one.place is not None or one.key not in told or one.key not in found:
            result.notes.append(f"{one.words}: measured, but no length that is judged here")
    for key in told.keys() & found:
        own = [one for one in measured if one.key == key and one.place is None]
        doubt = max((one.uncertainty or 0.0) / abs(told[key]) for one in own)
        spread = f", known to {doubt:.1%}" if doubt else ""
        mean = f" (mean of {len(own)})" if len(own) > 1 else ""
        result.notes.append(f"{own[0].words}: errors are from the measured {told[key]:.4g}{mean}{spread}")
    consensus, judged = _consensus(result), result.witnesses()
    if not judged and result.limits:
        result.notes.append(f"{_nobody(result)}: the consensus is the mean of all")
    if len(judged) == 1:
        result.notes.append(
            f"the consensus is {judged[0]}'s own limit: it has no second witness, and its bias is not known"
        )
    for run in done:
        if run.method in fits:
            made = _candidate(run, fits[run.method], consensus, told)
            result.candidates += [made] if made else []
            result.notes += [] if made else [f"{run.name}: has no length to be judged by"]
    result.notes += [unconverged(result, method) for method in fits if not result.converges(method)]
    return result


def averages(measured: Sequence[Measured]) -> dict[str, float]:
    """Key of a length -> what was measured of it along the whole path, the mean of several; 0 is no length."""
    values: dict[str, list[float]] = {}
    for one in measured:
        if one.place is None:
            values.setdefault(one.key, []).append(one.value)
    return {key: mean for key, own in values.items() if (mean := float(np.mean(own)))}


def exact_lengths(run: Run) -> dict[str, float]:
    """Lengths with an exact answer in a record."""
    names = {"bead area [m^2]": "bead_area_m2"}
    return {names[a.quantity]: a.reference for a in run.record.answers if a.quantity in names}


def _consensus(result: Selection) -> dict[str, float]:
    """Mean limit of the trusted methods (of all, if none is) for each length."""
    voters = result.witnesses() or list(result.limits)
    keys = {key for m in voters for key in result.limits[m]}
    return {k: float(np.mean([result.limits[m][k] for m in voters if k in result.limits[m]])) for k in keys}


def _candidate(run: Run, fits: dict[str, Fit], consensus: dict[str, float], told: dict[str, float]) -> Candidate | None:
    """The worst length decides; `told` are those that were measured. None where there is no length."""
    record = run.record
    parts: list[tuple[float, float]] = []
    exact = exact_lengths(run) | told
    for key, value in lengths_of(record).items():
        if key in exact:
            parts.append((abs(value / exact[key] - 1.0), 0.0))
            continue
        if key not in fits:
            continue
        limit, scatter = fits[key].limit, fits[key].scatter(record.spacing_m)
        scale = abs(consensus.get(key, limit)) or 1.0
        bias = abs(limit - consensus.get(key, limit)) / scale
        parts.append((max(abs(value - limit), scatter) / scale, bias))
    if not parts:
        return None
    discretisation, bias = max(parts, key=sum)
    cost = run.cost
    return Candidate(
        record.method,
        record.spacing_m,
        cost.mean_dt_s,
        record.seconds,
        record.seconds / cost.simulated_s,
        discretisation,
        bias,
        max(own for own, _ in parts),
        run,
    )


def confidence(result: Selection, tolerance: float, best: Candidate | None) -> str:
    """How sure the estimate of the setting chosen is: high when two or more trusted methods converge and agree within
    the tolerance, medium when they converge but do not agree, or when it is another method's; otherwise low: a limit
    that is not converged, or that nobody else confirms, may be anything."""
    judged = result.witnesses()
    if not judged:
        return f"low: {_nobody(result)}"
    if len(judged) == 1:
        others = [m for m, trust in result.trust.items() if trust.trusted and m not in judged]
        why = f" ({' and '.join(others)}: not judged here)" if others else ""
        known = "passes most known answers of this physics"
        return f"low: only {judged[0]} {known}{why}, and nothing else confirms its limit"
    keys = set.intersection(*(set(result.limits[m]) for m in judged))
    if not keys:
        return f"low: {' and '.join(judged)} have no length in common"
    widest = max(float(np.ptp(v) / abs(np.mean(v))) for k in keys if (v := [result.limits[m][k] for m in judged]))
    words = f"the limits of {' and '.join(judged)} differ by at most {widest:.1%}"
    taken = {best.method} if best is not None else set()
    if loose := [m for m in dict.fromkeys([*judged, *taken]) if not result.converges(m)]:
        return f"low: {words}; not converged: {' and '.join(loose)}"
    if taken <= set(judged):
        return f"{'high' if widest <= tolerance else 'medium'}: {words}"
    (method,) = taken
    own = result.trust[method]
    return f"medium: {words}; {method} passes {own.passed} of {own.judged} known answers of this physics"


def _nobody(result: Selection) -> str:
    """Why there is no limit to trust."""
    trusted = [m for m, trust in result.trust.items() if trust.trusted]
    if not trusted:
        return "no method passes most known answers of this physics"
    return f"{' and '.join(trusted)}, which pass most known answers of this physics, were not judged here"
