"""The commands that make the runs of a study again, one by one."""

from __future__ import annotations

from ..study.again import command_of
from .evidence import Evidence

VALIDATE = "fluidbench validate "


def commands(e: Evidence) -> dict[str, str]:
    """A command for every run that one can be given for, by the run's folder."""
    found = {run.folder.name: command_of(run) for run in e.sweeps()}
    seed = f" --seed {e.seed}" * (e.seed > 0)
    for t in [*e.trials, *e.other_trials]:
        for run in t.runs.values():
            options = run.target.options
            line = f"{VALIDATE}{t.case.name} --solvers {t.method} --levels {t.level}{seed}{options}"
            found[run.folder.name] = line
    return {name: line for name, line in found.items() if line}
