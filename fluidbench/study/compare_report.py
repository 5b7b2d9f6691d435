"""What `compare` and `run` show."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..method.verdict import Verdict
from ..report.report import Report, machine_of, record_link
from ..runs.record import Run
from ..scenario.measured import Measured
from .again import settings_of
from .compare_measured import against_measured, measured_plot, values_of
from .compare_plots import plots
from .compare_tables import against_reference, backends, costs, failed_prints, fidelity, successes
from .compare_views import clouds, views
from .headline import headline
from .sketch import sketch

ADVICE = {
    Verdict.DIVERGED: "its results are left out of every comparison",
    Verdict.OUT_OF_CAPACITY: "see the reason for the setting to raise",
    Verdict.TIMEOUT: "raise --wall-limit, or use a larger --spacing",
    Verdict.ERROR: "see log.txt in the run's folder",
    Verdict.REFUSED: "change what it refuses, or leave the method out",
}
BESIDE = "Some ran beside others (--jobs): on a core of its own a run took up to a quarter longer so, else more."


def report(runs: Sequence[Run], root: Path, verb: str, measured: Sequence[Measured] = ()) -> Report:
    """Tables, plots and views of finished runs, beside what was `measured`. `compare` has the folder's report.html;
    any other verb in the same folder has files of its own, under its name."""
    import pandas as pd

    values = values_of(runs, measured)
    beside = against_measured(values, measured)
    made = (fidelity(runs), successes(runs), beside, against_reference(runs), costs(runs), backends(runs))
    first = next((run for run in runs if run.record.input is not None), None)
    expected = first.scenario.warnings() if first else []
    met = [f"{run.label}: {line}" for run in runs for line in run.record.warnings if line not in expected]
    return Report(
        verb,
        f"fluidbench {verb.partition('-')[0]}: {runs[0].record.scenario}",
        _opening(first, runs, verb) if first else "",
        headline(runs) if len({run.label for run in runs}) > 1 else [],
        [table for table in made if table is not None],
        pd.DataFrame([{**run.record.row(), "reused": run.reused} for run in runs]),
        [*measured_plot(values, measured), *plots(runs, measured)],
        {"records": [record_link(run, root, f"{run.label} #{run.record.repeat + 1}") for run in runs]},
        machine_of(runs),
        alarms=[*failed_prints(runs), *met],
        failures=[f"{run.label}: {run.verdict}: {run.reason}; {ADVICE[run.verdict]}" for run in runs if not run.ok],
        notes=[
            *expected,
            *([BESIDE] if any(run.record.at_a_time > 1 for run in runs) else []),
            *(f"{run.label}: {line}" for run in runs if run.record.repeat == 0 for line in run.record.approximations),
        ],
        images=[*([sketch(first.scenario)] if first else []), *views(runs)],
        clouds=clouds(runs),
        prefix="" if verb == "compare" else f"{verb}-",
    )


def _opening(first: Run, runs: Sequence[Run], verb: str) -> str:
    """What was run: the scenario's title, and the command where it is a shipped one."""
    title, settings = first.scenario.title, settings_of(first.record)
    plain = all(run.record.repeat == 0 and run.target == first.target and not run.record.film_every for run in runs)
    if settings is None or verb != "compare" or not plain:
        return title
    methods = ",".join(dict.fromkeys(run.method for run in runs))
    command = f"fluidbench compare {first.record.scenario} --solvers {methods}{settings}{first.target.options}"
    return f"{title[:1].upper()}{title[1:]}. Made by: {command}"
