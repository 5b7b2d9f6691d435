"""The sentences of the paper's text that a measurement can test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import mean

from ..study.lengths import lengths_of
from ..study.trials import Trial
from . import definitions as words
from .cells import Cell, all_runs, figures, paces, runs_of
from .definitions import APART, CONFIRMED, FEWEST, METHODS, OPEN, REFUTED
from .elsewhere import MOST_EXPENSIVE, SMALL_STEPS, cost_place, small_steps
from .evidence import SHIPPED, Evidence
from .verdicts import answers_to, high, sensitivity, share_is, told, within

STRUCTURE = "predicts structural response more reliably"
SURFACE, STRUGGLES = "captures free-surface flow well", "struggles with curing and elasticity"
UNTOLD = "not every method has a result"
WIDTH, DEFORMATION = "cannot predict bead width", "cannot predict deformation under load"
COLLAPSE = "cannot predict collapse"


def claims(e: Evidence) -> list[Cell]:
    return [
        structural(e),
        *steps_and_cost(e),
        free_surface(e),
        struggles(e),
        bead_width(e),
        prediction(e, DEFORMATION, words.DEFORMATION),
        prediction(e, COLLAPSE, words.COLLAPSING),
    ]


def steps_and_cost(e: Evidence) -> list[Cell]:
    """What SPH would need in this setting."""
    runs, dts, walls = all_runs(e), figures(e.repeats, "mean_dt_s"), paces(e.repeats)
    steps = costs = measured = UNTOLD
    if {"mpm", "sph"} <= set(dts):
        steps = f"dt is 1 / {mean(dts['mpm']) / mean(dts['sph']):.2f} of MPM's"
    if len(walls) == 3:
        measured = "s for a simulated second: " + ", ".join(f"{m} {mean(v):.3g}" for m, v in walls.items())
        costs = ", ".join(f"x {mean(walls['sph']) / mean(walls[m]):.2g} {m}'s" for m in ("mpm", "pbd"))
    dear = cost_place(e.repeats, "sph", "highest")
    return [
        _claim("sph", SMALL_STEPS, steps, steps, "compare", "collapse", small_steps(e.repeats), runs),
        _claim("sph", MOST_EXPENSIVE, costs, measured, "compare", "cost", dear, runs),
    ]


def _claim(method: str, aspect: str, brief: str, measured: str, experiment: str, rule: str, verdict: str, runs) -> Cell:
    return Cell("claims", aspect, method, aspect, brief, measured, experiment, rule, verdict, runs)


def structural(e: Evidence) -> Cell:
    """MPM's share of known answers on structures beside the others'."""
    own = [t for m in METHODS for t in answers_to(e.trials, words.STRUCTURE, m)]

    def judge(trials: Sequence[Trial], factor: float) -> str:
        tallies = [within([t for t in trials if t.method == m], factor) for m in METHODS]
        if min(judged for _, judged in tallies) < FEWEST or not told(trials):
            return OPEN
        mpm, *others = (passed / judged for passed, judged in tallies)
        return CONFIRMED if mpm > max(others) else REFUTED

    shares = {m: within([t for t in own if t.method == m]) for m in METHODS}
    brief = ", ".join(f"{m} {passed}/{judged}" for m, (passed, judged) in shares.items())
    measured = f"known answers on structures within tolerance: {brief}{_shipped(own)}"
    cell = _claim("mpm", STRUCTURE, brief, measured, "validate", "reliable", judge(own, 1.0), runs_of(own))
    cell.sensitivity = sensitivity(own, judge)
    return cell


def free_surface(e: Evidence) -> Cell:
    own = answers_to(e.trials, words.SURFACES, "sph")

    def judge(trials: Sequence[Trial], factor: float) -> str:
        return share_is(trials, high, factor)

    brief = "{} of {} known answers".format(*within(own))
    measured = f"{_errors(own)}; coalescence: no known answer"
    cell = _claim("sph", SURFACE, brief, measured, "validate", "fidelity", judge(own, 1.0), runs_of(own))
    cell.sensitivity = sensitivity(own, judge)
    return cell


def struggles(e: Evidence) -> Cell:
    """SPH where matter cures, and where it is elastic."""
    sets = {"curing": words.CURING, "elasticity": words.ELASTIC}
    own = answers_to(e.trials, (*words.CURING, *words.ELASTIC), "sph")

    def judge(trials: Sequence[Trial], factor: float) -> str:
        groups = [[t for t in trials if t.case.name in names] for names in sets.values()]
        verdicts = [share_is(group, lambda share: not high(share), factor) for group in groups]
        return OPEN if OPEN in verdicts else CONFIRMED if CONFIRMED in verdicts else REFUTED

    shares = {name: within([t for t in own if t.case.name in names]) for name, names in sets.items()}
    brief = ", ".join(f"{name} {passed}/{judged}" for name, (passed, judged) in shares.items())
    cell = _claim("sph", STRUGGLES, brief, _errors(own), "validate", "struggles", judge(own, 1.0), runs_of(own))
    cell.sensitivity = sensitivity(own, judge)
    return cell


def prediction(e: Evidence, aspect: str, names: Sequence[str]) -> Cell:
    """PBD's known answers on a set of cases."""
    own = answers_to(e.trials, names, "pbd")

    def judge(trials: Sequence[Trial], factor: float) -> str:
        return share_is(trials, lambda share: share < 0.5, factor)

    brief = "{} of {} known answers".format(*within(own))
    cell = _claim("pbd", aspect, brief, _errors(own), "validate", "prediction", judge(own, 1.0), runs_of(own))
    cell.sensitivity = sensitivity(own, judge)
    return cell


def _errors(own: Sequence[Trial]) -> str:
    """Each answer's error beside its tolerance."""
    shown = (
        f"{t.case.name}: " + (f"error {t.error:.2g} of {t.tolerance:g}" if t.finding is not None else str(t.verdict))
        for t in own
    )
    return (", ".join(shown) or "not run") + _shipped(own)


def _shipped(own: Sequence[Trial]) -> str:
    return f" ({SHIPPED})" if any(t.note == SHIPPED for t in own) else ""


def bead_width(e: Evidence) -> Cell:
    """PBD's bead against the mean of the others, at two spacings, where those two agree; and its pressed strands."""
    off, lines = [], []
    agree = True
    for level in (e.repeats, e.second):
        widths = {m: lengths_of(runs[0].record).get("bead_width_m", math.nan) for m, runs in level.items() if runs}
        if len(widths) < 3 or not all(map(math.isfinite, widths.values())):
            agree = False
            continue
        others = mean([widths["mpm"], widths["sph"]])
        off.append(abs(widths["pbd"] / others - 1.0))
        agree = agree and abs(widths["mpm"] - widths["sph"]) <= APART * others
        lines.append(", ".join(f"{m} {1e3 * w:.1f} mm" for m, w in widths.items()) + f": off by {off[-1]:.0%}")
    agree = agree and len({x > APART for x in off}) == 1  # no verdict may hang on one resolution
    strands = answers_to(e.trials, (words.STRANDS,), "pbd")
    for n in (n for t in strands if t.finding for n in t.finding.numbers if n.quantity.startswith("width")):
        off.append(abs(n.measured / n.reference - 1.0))
        lines.append(f"{n.quantity}: {n.measured:.3g} of {n.reference:.3g}: off by {off[-1]:.0%}")
    verdict = OPEN
    whole = all(t.finding is not None for t in strands) and all(map(math.isfinite, off))
    if agree and off and whole:
        verdict = CONFIRMED if sum(x > APART for x in off) > len(off) / 2 else REFUTED
    runs = [runs[0] for level in (e.repeats, e.second) for runs in level.values() if runs] + runs_of(strands)
    measured = "; ".join(lines) or "a method did not lay a bead"
    brief = "off by " + ", ".join(f"{100 * x:.0f}" for x in off) + " %" if off else "not laid"
    return _claim("pbd", WIDTH, brief, measured, "compare, two spacings; validate", "prediction", verdict, runs)
