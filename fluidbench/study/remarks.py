"""What a selection notes of a method: why it is out, and why its limit may be anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..method.verdict import Verdict
from ..report.table import number, readable
from ..runs.record import Run
from .fit import NOISE, SURE, Fit
from .lengths import lengths_of

if TYPE_CHECKING:
    from .selection import Selection


def excluded(method: str, runs: Sequence[Run], completed: int, enough: int) -> list[str]:
    """Why a method has too few of its `runs` `completed` to be judged: refusals and instabilities with the reason of
    the first, once each; other ends are lacking, and told as such."""
    own = [run for run in runs if run.method == method]
    lines = []
    for verdict in (Verdict.REFUSED, Verdict.DIVERGED):
        ended = sorted((run for run in own if run.verdict == verdict), key=lambda run: -run.record.spacing_m)
        if ended:
            where = "" if len(ended) == len(own) else f" at {_spacings([run.record.spacing_m for run in ended])}"
            lines.append(f"{method}: {verdict}{where}: {ended[0].reason}")
    if own and all(run.verdict == Verdict.REFUSED for run in own):
        return lines  # that none completed goes without saying
    return [*lines, f"{method}: only {completed} spacings completed with their volume, {enough} are needed"]


def scattered(fits: Mapping[str, Fit], runs: Sequence[Run]) -> str:
    """Of the lengths that neither go with the spacing nor have settled, the one that is the furthest off, with its
    values at all spacings; nothing where there is none. `fits` by length are of these `runs`."""
    loose = {key: fit for key, fit in fits.items() if not fit.explains}
    if not loose:
        return ""
    key = max(loose, key=lambda key: loose[key].unrest)
    own = sorted(runs, key=lambda run: -run.record.spacing_m)
    values = [lengths_of(run.record)[key] for run in own]
    title, factor = readable(key, values)
    name, _, unit = title.rstrip("]").partition(" [")
    told = ", ".join(number(factor * value) for value in values)
    more = len(loose) - 1
    others = f"; so {more} more of its lengths" if more else ""
    return (
        f"its {name} neither goes with the spacing beyond chance ({100 * SURE:.0f} % sure) nor settles to "
        f"{100 * NOISE:.0f} %: {' '.join((told, unit)).rstrip()} at {_spacings([run.record.spacing_m for run in own])}"
        f"{others}"
    )


def unconverged(result: Selection, method: str) -> str:
    """Why a method's limit may be anything, with the numbers that say so."""
    if method in result.erratic:
        return f"{method}: not converged: {result.erratic[method]}"
    own = sorted((c for c in result.candidates if c.method == method), key=lambda c: -c.spacing)
    errors = ", ".join(f"{100 * c.discretisation:.1f}" for c in own)
    why = f"its error {result.slack(method)} ({errors} % at {_spacings([c.spacing for c in own])})"
    return f"{method}: not converged: {why}"


def _spacings(values: Sequence[float]) -> str:
    """In millimetres, as given."""
    return f"{', '.join(f'{1e3 * d:.3g}' for d in values)} mm"
