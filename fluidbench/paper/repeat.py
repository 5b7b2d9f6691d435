"""The commands that make the runs of a study again, one by one."""

from __future__ import annotations

from ..runs.record import Run
from ..study.again import settings_of
from .evidence import Evidence

VALIDATE = "fluidbench validate "


def commands(e: Evidence) -> dict[str, str]:
    """A command for every run that one can be given for, by the run's folder."""
    found = {run.folder.name: of_scenario(run) for run in e.sweeps()}
    seed = f" --seed {e.seed}" * (e.seed > 0)
    for t in [*e.trials, *e.other_trials]:
        for run in t.runs.values():
            options = run.target.options
            line = f"{VALIDATE}{t.case.name} --solvers {t.method} --levels {t.level}{seed}{options}"
            found[run.folder.name] = line
    return {name: line for name, line in found.items() if line}


def of_scenario(run: Run) -> str:
    """The command for a run of a shipped scenario, varied; nothing for any other."""
    settings = settings_of(run.record)
    if settings is None:
        return ""
    return f"fluidbench run {run.record.scenario} --solver {run.method}{settings}{run.target.alone}"
