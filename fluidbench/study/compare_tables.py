"""Tables for people: the same rows in the terminal and on the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import mean

from ..measure.rest import LAST, STILL
from ..measure.tower import Print
from ..method.verdict import Evidence, evidence_of
from ..report.table import Table, in_millimetres, label, number, readable, spread
from ..runs.record import Record, Run
from .lengths import lengths_of

MOVES = " ~"  # beside a length that was read from what still moved
MOVED = f"by more than {STILL:g} spacings over the last {100 * LAST:g} % of the run"


def by_method(results: Sequence[Run]) -> dict[str, list[Record]]:
    """Records of each method, in the order of the runs."""
    groups: dict[str, list[Record]] = {}
    for result in results:
        groups.setdefault(result.label, []).append(result.record)
    return groups


def fidelity(results: Sequence[Run]) -> Table:
    """Verdict and measures, one column a method; only completed runs have numbers."""
    groups = by_method(results)
    table = Table("Fidelity", ["", *groups])
    table.rows.append(["verdict", *[", ".join(sorted({str(r.verdict) for r in g})) for g in groups.values()]])
    done = {name: [r for r in g if evidence_of(r.verdict) is Evidence.RESULT] for name, g in groups.items()}
    if any(r.print for g in done.values() for r in g):
        prints = [", ".join(sorted({str(r.print) for r in g if r.print})) or "-" for g in done.values()]
        table.rows.append(["print", *prints])
    hidden = ("momentum", "angular", "center", "potential", "particles")
    keys = dict.fromkeys(k for g in done.values() for r in g for k in r.measures if not k.startswith(hidden))
    for key in keys:
        values = [[r.measures[key] for r in g if key in r.measures] for g in done.values()]
        marks = [MOVES if any(key in r.moving for r in g) else "" for g in done.values()]
        name, factor = readable(key, [value for own in values for value in own])
        cells = [spread([factor * value for value in own]) if own else "-" for own in values]
        table.rows.append([name, *[cell + mark for cell, mark in zip(cells, marks, strict=True)]])
    moving = any(r.moving for g in done.values() for r in g)
    return replace(table, note=f"{MOVES.strip()} still moves: {MOVED}") if moving else table


def against_reference(results: Sequence[Run]) -> Table | None:
    """Measured value, reference and error of every answer; None when the scenario has none."""
    table = Table("Against references", ["", "method", "computed", "reference", "error", "measure", "source"])
    reasons = dict.fromkeys(line for r in results for line in r.record.not_compared)
    for result in results:
        if result.record.repeat == 0:
            for a in result.record.answers:
                title, factor = in_millimetres(a.quantity, [a.measured, a.reference])
                measured = number(factor * a.measured) + (MOVES if a.reads in result.record.moving else "")
                percent = not a.measure.startswith(("absolute", "in discs"))
                error = f"{100 * a.error:.2f} %" if percent else f"{a.error:.4f}"
                wanted = number(factor * a.reference)
                table.rows.append([title, result.label, measured, wanted, error, a.measure, a.source])
    table = replace(table, note="\n".join(f"not compared: {line}" for line in reasons))
    return table if table.rows or reasons else None


def successes(results: Sequence[Run]) -> Table | None:
    """The criteria of a print, one row each, a column a method; None where the scenario has none."""
    done = [r for r in results if r.record.success and r.record.repeat == 0]
    if not done:
        return None
    table = Table("Success, each criterion alone", ["", "wanted", *[r.label for r in done]])
    for i, first in enumerate(done[0].record.success):
        cells = [r.record.success[i] for r in done]
        shown = [f"{number(c.measured)} {'yes' if c.met else 'NO'}" for c in cells]
        table.rows.append([first.name, first.wanted, *shown])
    return table


def failed_prints(results: Sequence[Run]) -> list[str]:
    """One line a print that is not sound: what became of it, and what it did not meet."""
    lines = []
    for result in results:
        if result.ok and result.record.print not in (None, Print.SOUND):
            unmet = [f"{c.name} {number(c.measured)} (wanted {c.wanted})" for c in result.record.success if not c.met]
            fall = result.record.collapse
            how = f"by {fall.mode} at {number(fall.time)} s, {fall.layers} layers whole; " if fall is not None else ""
            lines.append(f"{result.label}: print {result.record.print}: {how}{'; '.join(unmet)}")
    return lines


def costs(results: Sequence[Run]) -> Table:
    """What it cost, compilation apart."""
    sound = {n: [r for r in g if evidence_of(r.verdict) is Evidence.RESULT] for n, g in by_method(results).items()}
    groups = {n: [r.counted for r in g if r.counted is not None] for n, g in sound.items()}
    table = Table("Cost (without compilation)", ["", *groups])
    for key in (
        "wall_s",
        "cpu_s",
        "wall_per_simulated_s",
        "simulated_to_real",
        "substeps",
        "mean_dt_s",
        "steps_per_s",
        "particle_substeps_per_s",
        "particle_substeps_per_cpu_s",
        "peak_particles",
        "bytes_per_particle",
        "peak_memory_MiB",
        "prepare_s",
    ):
        known = [
            g if key != "bytes_per_particle" or any(c.bytes_per_particle for c in g) else [] for g in groups.values()
        ]
        table.rows.append([label(key), *[spread([getattr(c, key) for c in g]) if g else "-" for g in known]])
    for key in dict.fromkeys(key for g in sound.values() for r in g for key in r.solves):
        known = [[r.solves[key] for r in g if key in r.solves] for g in sound.values()]
        table.rows.append([f"viscous solve: {key}", *[spread(values) if values else "-" for values in known]])
    table.rows.append(["binding bound", *[g[0].binding or "-" if g else "-" for g in sound.values()]])
    beside = [max((r.at_a_time for r in g), default=1) for g in sound.values()]
    if max(beside, default=1) > 1:
        table.rows.append(["runs at a time", *map(str, beside)])
    return table


def backends(results: Sequence[Run]) -> Table | None:
    """The same method through two backends: cost of both with the ratio, and how far apart their lengths are; None
    where nothing ran in two."""
    table = Table("Backends", ["", "first", "second", "second / first"])
    groups: dict[str, dict[str, list[Run]]] = {}
    for result in results:
        if result.ok:
            pair = groups.setdefault(result.method, {})
            pair.setdefault(result.record.backend, []).append(result)
    for method, pair in groups.items():
        if len(pair) != 2:
            continue
        table.head[1:3] = pair
        for key in ("particle_substeps_per_s", "particle_substeps_per_cpu_s", "wall_s", "prepare_s"):
            a, b = ([getattr(r.cost, key) for r in runs] for runs in pair.values())
            table.rows.append([f"{method}: {label(key)}", spread(a), spread(b), number(mean(b) / mean(a))])
        first, second = (runs[0].record for runs in pair.values())
        before, after = lengths_of(first), lengths_of(second)
        apart = {key: abs(after[key] - value) for key, value in before.items() if key.endswith("_m") and key in after}
        if apart:
            key, resolution = max(apart, key=lambda k: apart[k]), first.measures["resolution_m"]
            within = f"{apart[key] / resolution:.2g} of the resolution"
            table.rows.append([f"{method}: {label(key)}, apart most", number(before[key]), number(after[key]), within])
    return table if table.rows else None
