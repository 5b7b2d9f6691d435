"""Tables for people: the same rows in the terminal and on the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import mean, stdev
from typing import TYPE_CHECKING, Any

from ..measure.tower import Print
from ..study.compare import binding, lengths_of
from ..study.execute import Finished
from ..verdict import Evidence, evidence_of

if TYPE_CHECKING:
    from rich.console import Console


class Link(str):
    """A cell that leads somewhere on the page."""

    def __new__(cls, text: str, href: str) -> Link:
        made = super().__new__(cls, text)
        made.href = href
        return made

    href: str


@dataclass(frozen=True)
class Table:
    """Rows of formatted cells under a head; the first column names the row."""

    title: str
    head: list[str]
    rows: list[list[str]] = field(default_factory=list)
    note: str = ""


def show(console: Console, table: Table) -> None:
    """Print a table to the terminal."""
    from rich.markup import escape
    from rich.table import Table as RichTable

    wide = console.width >= 100  # on a narrow screen even names must fold
    shown = RichTable(title=table.title, title_justify="left", title_style="bold")
    for i, head in enumerate(table.head):
        shown.add_column(escape(head), justify="left" if i == 0 else "right", overflow="fold", no_wrap=i == 0 and wide)
    for row in table.rows:
        shown.add_row(*map(escape, row))
    console.print(shown)
    if table.note:
        console.print(table.note, markup=False, highlight=False)


def number(value: float) -> str:
    """Four significant digits."""
    return f"{value:.4g}"


def spread(values: Sequence[float]) -> str:
    """A mean, with its standard deviation when there are several values."""
    return number(mean(values)) if len(values) < 2 else f"{number(mean(values))} ± {stdev(values):.1g}"


def by_method(results: Sequence[Finished]) -> dict[str, list[dict[str, Any]]]:
    """Records of each method, in the order of the runs."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for result in results:
        groups.setdefault(result.label, []).append(result.record)
    return groups


def fidelity(results: Sequence[Finished]) -> Table:
    """Verdict and measures, one column a method; only completed runs have numbers."""
    groups = by_method(results)
    table = Table("Fidelity", ["", *groups])
    table.rows.append(["verdict", *[", ".join(sorted({r["verdict"] for r in g})) for g in groups.values()]])
    done = {name: [r for r in g if evidence_of(r["verdict"]) is Evidence.RESULT] for name, g in groups.items()}
    if any(r.get("print") for g in done.values() for r in g):
        prints = [", ".join(sorted({r["print"] for r in g if r.get("print")})) or "-" for g in done.values()]
        table.rows.append(["print", *prints])
    hidden = ("momentum", "angular", "center", "potential", "particles")
    keys = dict.fromkeys(k for g in done.values() for r in g for k in r["measures"] if not k.startswith(hidden))
    for key in keys:
        values = [[r["measures"][key] for r in g if key in r["measures"]] for g in done.values()]
        table.rows.append([label(key), *[spread(v) if v else "-" for v in values]])
    return table


def against_reference(results: Sequence[Finished]) -> Table | None:
    """Measured value, reference and error of every answer; None when the scenario has none."""
    table = Table("Against references", ["", "method", "measured", "reference", "error", "measure", "source"])
    reasons = dict.fromkeys(line for r in results for line in r.record.get("not_compared", []))
    for result in results:
        if result.record["repeat"] == 0:
            for a in result.record.get("answers", []):
                percent = not a["measure"].startswith(("absolute", "in discs"))
                error = f"{100 * a['error']:.2f} %" if percent else f"{a['error']:.4f}"
                table.rows.append([a["quantity"], result.label, number(a["measured"]), number(a["reference"]), error,
                                   a["measure"], a["source"]])  # fmt: skip
    table = replace(table, note="\n".join(f"not compared: {line}" for line in reasons))
    return table if table.rows or reasons else None


def successes(results: Sequence[Finished]) -> Table | None:
    """The criteria of a print, one row each, a column a method; None where the scenario has none."""
    done = [r for r in results if r.record.get("success") and r.record["repeat"] == 0]
    if not done:
        return None
    table = Table("Success, each criterion alone", ["", "wanted", *[r.label for r in done]])
    for i, first in enumerate(done[0].record["success"]):
        cells = [r.record["success"][i] for r in done]
        shown = [f"{number(c['measured'])} {'yes' if c['met'] else 'NO'}" for c in cells]
        table.rows.append([first["name"], first["wanted"], *shown])
    return table


def failed_prints(results: Sequence[Finished]) -> list[str]:
    """One line a print that is not sound: what became of it, and what it did not meet."""
    lines = []
    for result in results:
        if result.ok and result.record.get("print", "") not in ("", Print.SOUND):
            unmet = [f"{c['name']} {number(c['measured'])} (wanted {c['wanted']})"
                     for c in result.record["success"] if not c["met"]]  # fmt: skip
            lines.append(f"{result.label}: print {result.record['print']}: {'; '.join(unmet)}")
    return lines


def costs(results: Sequence[Finished]) -> Table:
    """What it cost, compilation apart."""
    groups = {n: [r for r in g if "cost" in r] for n, g in by_method(results).items()}
    table = Table("Cost (without compilation)", ["", *groups])
    for key in (
        "wall_s", "cpu_s", "wall_per_simulated_s", "simulated_to_real", "substeps", "mean_dt_s", "steps_per_s",
        "particle_substeps_per_s", "particle_substeps_per_cpu_s", "peak_particles", "bytes_per_particle",
        "peak_memory_MiB", "prepare_s",
    ):  # fmt: skip
        table.rows.append([label(key), *[spread([r["cost"][key] for r in g]) if g else "-" for g in groups.values()]])
    table.rows.append(["binding bound", *[binding(g[0]) if g else "-" for g in groups.values()]])
    return table


def backends(results: Sequence[Finished]) -> Table | None:
    """The same method through two backends: cost of both with the ratio, and how far apart their lengths are; None
    where nothing ran in two."""
    table = Table("Backends", ["", "first", "second", "second / first"])
    groups: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for result in results:
        if result.ok:
            pair = groups.setdefault(result.record["method"], {})
            pair.setdefault(result.record["backend"], []).append(result.record)
    for method, pair in groups.items():
        if len(pair) != 2:
            continue
        table.head[1:3] = pair
        for key in ("particle_substeps_per_s", "particle_substeps_per_cpu_s", "wall_s", "prepare_s"):
            a, b = ([r["cost"][key] for r in records] for records in pair.values())
            table.rows.append([f"{method}: {label(key)}", spread(a), spread(b), number(mean(b) / mean(a))])
        first, second = (records[0] for records in pair.values())
        before, after = lengths_of(first), lengths_of(second)
        apart = {key: abs(after[key] - value) for key, value in before.items() if key.endswith("_m") and key in after}
        if apart:
            key, resolution = max(apart, key=lambda k: apart[k]), first["measures"]["resolution_m"]
            within = f"{apart[key] / resolution:.2g} of the resolution"
            table.rows.append([f"{method}: {label(key)}, apart most", number(before[key]), number(after[key]), within])
    return table if table.rows else None


UNITS = {"m": "m", "m2": "m²", "kg": "kg", "J": "J", "s": "s", "MiB": "MiB"}


def label(key: str) -> str:
    """'bead_width_m' -> 'bead width [m]'."""
    words = key.split("_")
    if words[-2:] == ["per", "s"] or words[-3:] == ["per", "cpu", "s"] or words[-3:] == ["per", "simulated", "s"]:
        return " ".join(words)
    if words[-1] in UNITS and len(words) > 1:
        return f"{' '.join(words[:-1])} [{UNITS[words[-1]]}]"
    return " ".join(words)
