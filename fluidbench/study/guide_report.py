"""What `guide` shows: one chart and one table of choices, and behind each job every setting that was tried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..report.report import Detail, Image, Report, machine_of
from ..report.table import Table
from ..runs.archive import of_other_code
from .again import command_of
from .choice import Choice, choices, setting, time_of
from .guide_chart import SURE, chart
from .selection import Selection

Studies = Mapping[str, Mapping[str, Selection]]
CHART = "guide"
RULE = (
    "The cheapest setting whose error, that of the worst length, is within the tolerance: what is left of its spacing, "
    "and how far its method's limit at zero spacing lies from the mean of the methods that pass most known answers of "
    "the job's physics; against the exact answer where there is one, or what was measured. Time is CPU time on one "
    "core, wall time on several and on a GPU."
)


def report(studies: Studies, tolerances: Sequence[float], root: Path, missing: Sequence[str] = ()) -> Report:
    """`studies` by machine and job; `missing` are runs that it has nothing of."""
    import pandas as pd

    found = choices(studies, tolerances)
    shown = _table(found, list(studies), tolerances)
    findings = [sentence(studies, found, job) for job in dict.fromkeys(c.job for c in found)]
    findings += of_other_code({m: [r for s in jobs.values() for r in s.runs] for m, jobs in studies.items()})
    details = [_detail(studies, found, job, root) for job in dict.fromkeys(c.job for c in found)]
    made = [f"{machine}: {machine_of(r for s in jobs.values() for r in s.runs)}" for machine, jobs in studies.items()]
    title = "Which method for what, by tolerance"
    return Report(
        "guide",
        "fluidbench guide: which method for what",
        f"The cheapest method and spacing within a tolerance, on {' and '.join(studies)}. {RULE}",
        findings,
        [shown],
        pd.DataFrame([_row(c) for c in found]),
        failures=list(missing),
        images=[Image(CHART, title, "; ".join(findings), partial(chart, found), opens=True)],
        details=details,
        machine="; ".join(made),
        files={"guide.md": _markdown(shown, findings, details, [*made, *missing])},
    )


def sentence(studies: Studies, found: Sequence[Choice], job: str) -> str:
    """A job's choices in words, machines with the same one together."""
    told: dict[str, list[str]] = {}
    for machine in studies:
        own = [c for c in found if (c.job, c.machine) == (job, machine)]
        if own:
            told.setdefault(_words(own), []).append(machine)
    return f"{job}: " + "; ".join(f"{', '.join(machines)}: {words}" for words, machines in told.items())


def _words(own: Sequence[Choice]) -> str:
    """One machine's choices from the widest tolerance to the narrowest, equal ones together."""
    groups: dict[str, list[Choice]] = {}
    for c in reversed(own):
        groups.setdefault(_taken(c), []).append(c)
    return ", ".join(f"{taken} at {_percents(cs)}" for taken, cs in groups.items())


def _percents(cs: Sequence[Choice]) -> str:
    return " and ".join(f"{100 * c.tolerance:.3g} %" for c in cs)


def _taken(c: Choice) -> str:
    if c.best is None:
        return f"no choice ({c.why})"
    return setting(c.best) if c.met else f"nothing (nearest: {setting(c.best)}, {c.best.error:.1%} off)"


def _table(found: Sequence[Choice], machines: Sequence[str], tolerances: Sequence[float]) -> Table:
    head = ["", "tolerance", *machines, "what would change it"]
    table = Table("Which method for what", head, note="confidence: " + ", ".join(f"{s} {w}" for w, s in SURE.items()))
    by_place = {(c.job, c.tolerance, c.machine): c for c in found}
    for job in dict.fromkeys(c.job for c in found):
        for i, tolerance in enumerate(reversed(tolerances)):
            own = [by_place.get((job, tolerance, machine)) for machine in machines]
            cells = ["-" if c is None else _cell(c) for c in own]
            change = [
                f"{m}: {c.change}" if len(machines) > 1 else c.change for m, c in zip(machines, own, strict=True) if c
            ]
            table.rows.append(["" if i else job, f"{100 * tolerance:.3g} %", *cells, change])
    return Table(table.title, table.head, table.rows, table.note, text=True)


def _cell(c: Choice) -> list[str]:
    if c.best is None:
        return [f"none: {c.why}"]
    cost = f"{time_of(c.best.seconds)}, {c.best.error:.1%} off"
    return [f"{setting(c.best)} {SURE[c.confidence]}", cost] if c.met else ["none", f"{setting(c.best)}: {cost}"]


def _row(c: Choice) -> dict[str, Any]:
    best = c.best
    return {
        "job": c.job,
        "machine": c.machine,
        "tolerance": c.tolerance,
        "met": c.met,
        "method": best and best.method,
        "spacing_m": best and best.spacing,
        "time_s": best and best.seconds,
        "time_per_simulated_s": best and best.pace,
        "error": best and best.error,
        "confidence": c.confidence,
        "why_confidence": c.sure,
        "change": c.change,
    }


def _detail(studies: Studies, found: Sequence[Choice], job: str, root: Path) -> Detail:
    """What stands behind a job's choices: per machine how sure they are, every setting, and the runs."""
    made = Detail(job, f"job-{job.replace(' ', '-')}")
    for machine, jobs in studies.items():
        if job not in jobs:
            continue
        sure: dict[str, list[Choice]] = {}
        for c in found:
            if (c.job, c.machine) == (job, machine):
                sure.setdefault(c.sure, []).append(c)
        made.lines += [f"{machine}, within {_percents(cs)}: confidence {line}." for line, cs in sure.items()]
        own = sorted(jobs[job].candidates, key=lambda c: c.seconds)
        tried = (f"{setting(c)}: {c.error:.1%}, {time_of(c.seconds)}" for c in own)
        made.lines += [f"{machine}: error and time of everything tried: {'; '.join(tried)}."] if own else []
        made.lines += [f"{machine}: {note}." for note in jobs[job].remarks]
        for run in jobs[job].runs:
            made.add_run(run, root, command_of(run) or "")
    return made


def _markdown(table: Table, findings: Sequence[str], details: Sequence[Detail], machines: Sequence[str]) -> str:
    """A page of its own: chart, table, and what stands behind each job."""
    import pandas as pd

    rows = [[cell if isinstance(cell, str) else "<br>".join(cell) for cell in row] for row in table.rows]
    lines = [
        "# Which method for what",
        "",
        f"![Which method for what, by tolerance]({CHART}.png)",
        "",
        *(f"- {line}." for line in findings),
        "",
        RULE,
        "",
        pd.DataFrame(rows, columns=pd.Index(table.head)).to_markdown(index=False, disable_numparse=True),
        "",
        f"{table.note[0].upper()}{table.note[1:]}.",
        "",
        *(f"- {machine}" for machine in machines),
        "",
        "## Evidence",
        "",
    ]
    for detail in details:
        again = [command for _, _, command in detail.runs if command]
        lines += [f"### {detail.name}", "", *(f"- {line}" for line in detail.lines), ""]
        lines += ["```sh", *dict.fromkeys(again), "```", ""] if again else []
    return "\n".join(lines)
