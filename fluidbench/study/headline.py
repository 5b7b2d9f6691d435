"""What a comparison comes to, in a few sentences made by rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import mean

from ..measure.tower import Print
from ..report.table import number, readable
from ..runs.record import Run
from .lengths import lengths_of

AGREE = 0.05  # lengths that differ by less of their mean agree
MOST = 3  # lengths that are told of


def headline(runs: Sequence[Run]) -> list[str]:
    """Who has no result; which prints did not stand; where methods agree on a length; and who was cheapest."""
    first = [run for run in runs if run.record.repeat == 0]
    done = {run.label: run for run in first if run.ok}
    lines = [f"{run.label} has no result: {run.verdict}." for run in first if not run.ok]
    lines += [f"{label}'s print: {run.record.print}." for label, run in done.items() if _fell(run)]
    lengths = {label: lengths_of(run.record) for label, run in done.items()}
    shared = [name for name in next(iter(lengths.values()), {}) if sum(name in own for own in lengths.values()) > 1]
    for name in shared[:MOST]:
        lines.append(agreement(name, {label: own[name] for label, own in lengths.items() if name in own}))
    return lines + cheapest(runs)


def _fell(run: Run) -> bool:
    return run.record.print not in (None, Print.SOUND)


def agreement(name: str, values: Mapping[str, float]) -> str:
    """The most methods that agree on a length, and how far off the others are."""
    title, factor = readable(name, list(values.values()))
    title, _, unit = title.rstrip("]").partition(" [")
    ranked = sorted(values, key=lambda label: values[label])
    groups = [ranked[i:j] for i in range(len(ranked)) for j in range(i + 1, len(ranked) + 1)]
    together = max((g for g in groups if _spread(g, values) <= AGREE), key=lambda g: (len(g), -_spread(g, values)))
    if len(together) < 2:
        shown = ", ".join(f"{label} {number(factor * values[label])}" for label in ranked)
        return f"No two agree on {title} within {AGREE:.0%}: {shown} {unit}.".replace(" .", ".")
    middle = mean(values[label] for label in together)
    said = f"{_listed(together)} agree on {title} within {_spread(together, values):.1%}"
    others = [
        f"{label} is {_off(values[label], middle)} {'above' if values[label] > middle else 'below'}"
        for label in ranked
        if label not in together
    ]
    return "; ".join([f"{said} ({number(factor * middle)} {unit})".replace(" )", ")"), *others]) + "."


def _off(value: float, middle: float) -> str:
    """A share of the middle; or the distance, where that is nothing."""
    return f"{abs(value / middle - 1.0):.0%}" if middle else number(abs(value))


def _spread(labels: Sequence[str], values: Mapping[str, float]) -> float:
    own = [values[label] for label in labels]
    return (max(own) - min(own)) / max(abs(mean(own)), 1e-300)


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def cheapest(runs: Sequence[Run]) -> list[str]:
    """Who took least time for a simulated second, and how many times as much the others took."""
    paces: dict[str, list[float]] = {}
    for run in runs:
        if run.ok:
            paces.setdefault(run.label, []).append(run.cost.wall_per_simulated_s)
    if len(paces) < 2:
        return []
    means = {label: mean(own) for label, own in paces.items()}
    least = min(means, key=lambda label: means[label])
    others = [f"{label} {means[label] / means[least]:.2g} times as long" for label in means if label != least]
    return [f"{least} took least time, {number(means[least])} s for a simulated second; {', '.join(others)}."]
