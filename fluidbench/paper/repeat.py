"""The commands that make the runs of a study again, one by one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from ..runs.record import Run
from ..scenario.library import load, shipped
from .evidence import Evidence


def commands(e: Evidence) -> dict[str, str]:
    """A command for every run that one can be given for, by the run's folder."""
    found = {run.folder.name: of_scenario(run) for run in e.sweeps()}
    seed = f" --seed {e.seed}" * (e.seed > 0)
    for t in [*e.trials, *e.other_trials]:
        for run in t.runs.values():
            options = run.target.options
            line = f"fluidbench validate {t.case.name} --solvers {t.method} --levels {t.level}{seed}{options}"
            found[run.folder.name] = line
    return {name: line for name, line in found.items() if line}


def of_scenario(run: Run) -> str:
    """The command for a run of a shipped scenario, varied; nothing for any other."""
    if run.record.scenario not in shipped() or run.record.input is None:
        return ""
    base, own = _flat(_shipped(run.record.scenario)), _flat(run.record.input)
    changed = {key: value for key, value in own.items() if base.get(key) != value}
    settings = "".join(f" --set {key}={value}" for key, value in changed.items())
    return f"fluidbench run {run.record.scenario} --solver {run.method}{settings}{run.target.alone}"


@cache
def _shipped(name: str) -> dict[str, Any]:
    return load(name).model_dump(mode="json")


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Dotted keys and their values."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= _flat(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return found
