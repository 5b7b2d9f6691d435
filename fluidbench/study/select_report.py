"""What `select` shows: the recommendation, every candidate, and the front of error against cost."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from ..report.plot import Plot, Trace, colour
from ..report.report import Report, machine_of, record_link
from ..report.table import Table, number, readable
from ..scenario import Scenario
from .again import settings_of
from .selection import FALLS, Candidate, Selection, confidence, physics_of


def report(
    scenario: Scenario, name: str, chosen: Selection, tolerance: float, budget: float, pace: float, root: Path
) -> Report:
    import pandas as pd

    front = chosen.front()
    rows = [_row(c, c in front) for c in chosen.candidates]
    runs = {"every method at every spacing": [record_link(r, root) for r in chosen.runs]}
    return Report(
        "select",
        f"fluidbench select: {scenario.name}",
        f"Tolerance {100 * tolerance:.3g} % of every length; budget: {_budget(budget, pace)}.",
        _findings(scenario, name, chosen, tolerance, budget, pace),
        [_candidates(chosen, front), _evidence(chosen)],
        pd.DataFrame(rows),
        [_plot(chosen, front)] if chosen.candidates else [],  # axes alone say nothing
        runs,
        machine_of(chosen.runs),
    )


def _budget(budget: float, pace: float) -> str:
    parts = [f"{budget:g} s"] if math.isfinite(budget) else []
    parts += [f"{pace:g} s per simulated s"] if math.isfinite(pace) else []
    return " and ".join(parts) or "none"


def _words(c: Candidate) -> str:
    return (
        f"{c.method} at spacing {1e3 * c.spacing:.4g} mm (mean dt {c.dt:.3g} s): error {c.error:.1%} (discretisation "
        f"{c.discretisation:.1%}, bias {c.bias:.1%}), {c.seconds:.3g} s, {c.pace:.3g} s per simulated s"
    )


def _findings(
    scenario: Scenario, name: str, chosen: Selection, tolerance: float, budget: float, pace: float
) -> list[str]:
    best, why = chosen.recommend(tolerance, budget, pace)
    if best is None:
        return [f"No recommendation: {why}.", *chosen.remarks]
    lines = [f"Tolerance {100 * tolerance:.3g} %; budget of a run: {_budget(budget, pace)}."]
    lines.append(f"{f'{why[0].upper()}{why[1:]}' if why else 'Recommended'}: {_words(best)}.")
    trust = chosen.trust.get(best.method)
    if trust is not None and not trust.trusted:
        lines.append(f"Beware: {best.method} passes {trust.passed} of {trust.judged} known answers of this physics.")
    lines.append(f"Run it: {_command(name, best)}")
    finer = [c for c in chosen.candidates if c.error <= best.error / 2]
    faster = [c for c in chosen.candidates if c.seconds <= best.seconds / 2]
    if finer:
        lines.append(f"Twice as accurate: {_words(min(finer, key=lambda c: c.seconds))}.")
    else:
        lines.append(f"Twice as accurate: nothing tried; {_further(chosen, best)}.")
    if faster:
        lines.append(f"Twice as fast: {_words(min(faster, key=lambda c: c.error))}.")
    else:
        lines.append("Twice as fast: nothing tried.")
    sure = confidence(chosen, tolerance, best)
    lines.append(f"How sure: {sure} (judged by known answers on {', '.join(sorted(physics_of(scenario)))}).")
    if sure.startswith("low"):
        lines.append("A length measured on a print settles it: --measured FILE.csv counts errors from that.")
    return [*lines, *chosen.remarks]


def _command(name: str, best: Candidate) -> str:
    """The command that runs a setting of the scenario called so; in Python where no command line says it."""
    settings = settings_of(best.run.record, name, apart=("spacing",))
    if settings is None:
        return f"fluidbench.run(scenario.replace(spacing={best.spacing:.6g}), {best.method!r}) of the scenario given"
    how = f"--solver {best.method} --spacing {1e3 * best.spacing:.6g}mm{settings}{best.run.target.alone}"
    return f"fluidbench run {shlex.quote(name)} {how}"


def _further(chosen: Selection, best: Candidate) -> str:
    """What half the error would take, where the errors tried say so."""
    if best.method in chosen.erratic:
        return f"a length of {best.method} scatters (see below): what a finer spacing gains is not known"
    if why := chosen.slack(best.method):
        return f"the error of {best.method} {why}; a finer one promises little"
    order = chosen.order(best.method)
    if not order > FALLS:  # too small to fall
        return f"the error of {best.method} is nothing but what cannot be measured"
    factor = 2.0 ** (1.0 / order)
    return (
        f"at its observed order of {order:.2g} it takes {1 / factor:.2g} of the spacing, {factor**4:.0f} times the work"
    )


def _row(c: Candidate, best: bool) -> dict[str, float | str | bool]:
    return {
        "method": c.method,
        "spacing_m": c.spacing,
        "mean_dt_s": c.dt,
        "time_s": c.seconds,
        "time_per_simulated_s": c.pace,
        "error": c.error,
        "discretisation": c.discretisation,
        "bias": c.bias,
        "on_front": best,
    }


def _candidates(chosen: Selection, front: Sequence[Candidate]) -> Table:
    table = Table(
        "Every setting tried",
        [
            "method",
            "spacing [mm]",
            "mean dt [s]",
            "time [s]",
            "s / sim. s",
            "error",
            "discretisation",
            "bias",
            "front",
        ],
        note="error: of the worst length, relative; time: CPU time on one core, else wall time; front: nothing tried "
        "is both faster and more accurate",
    )
    for c in sorted(chosen.candidates, key=lambda c: c.seconds):
        table.rows.append(
            [
                c.method,
                number(1e3 * c.spacing),
                number(c.dt),
                number(c.seconds),
                number(c.pace),
                f"{c.error:.1%}",
                f"{c.discretisation:.1%}",
                f"{c.bias:.1%}",
                "yes" if c in front else "-",
            ]
        )
    return table


def _evidence(chosen: Selection) -> Table:
    keys = sorted({key for limits in chosen.limits.values() for key in limits})
    known = {key: [limits[key] for limits in chosen.limits.values() if key in limits] for key in keys}
    words = {key: readable(key, values) for key, values in known.items()}
    table = Table(
        "Limits at zero spacing, and trust",
        ["method", *(title for title, _ in words.values()), "known answers passed", "trusted"],
        note="known answers of this physics: docs/validation.md",
    )
    for method, trust in chosen.trust.items():
        own = chosen.limits.get(method, {})
        cells = [number(factor * own.get(key, math.nan)) for key, (_, factor) in words.items()]
        table.rows.append([method, *cells, f"{trust.passed} of {trust.judged}", "yes" if trust.trusted else "no"])
    return table


def _plot(chosen: Selection, front: Sequence[Candidate]) -> Plot:
    """Error against cost, a colour a method; what is dominated is faded."""
    plot = Plot("pareto", "error against cost (faded: dominated)", "time [s]", "estimated error [%]", log=True)
    for method in dict.fromkeys(c.method for c in [*front, *chosen.candidates]):
        for faded in (False, True):
            own = [
                c for c in (chosen.candidates if faded else front) if c.method == method and (c in front) is not faded
            ]
            if own:
                label = "" if any(t.colour == colour(method) for t in plot.traces) else method
                xs, ys = [c.seconds for c in own], [100 * c.error for c in own]
                style = "points" if faded else "line+points"
                plot.traces.append(Trace(label, xs, ys, style, colour(method), faded=faded))
    return plot
