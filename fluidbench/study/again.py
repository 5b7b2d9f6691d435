"""The command line that would ask for a finished run again."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from ..runs.record import Record, Run
from ..scenario.library import load, shipped


def command_of(run: Run) -> str | None:
    """The command for a run of a shipped scenario, varied; None for any other."""
    settings = settings_of(run.record)
    if settings is None:
        return None
    return f"fluidbench run {run.record.scenario} --solver {run.method}{settings}{run.target.alone}"


def settings_of(record: Record) -> str | None:
    """What the scenario of a run has otherwise than the shipped one of its name, as ` --set key=value ...`; None where
    there is none of that name, or no words for it."""
    if record.scenario not in shipped() or record.input is None:
        return None
    base, own = _flat(_shipped(record.scenario)), _flat(record.input)
    changed = {key: own.get(key) for key in {**base, **own} if base.get(key) != own.get(key)}
    if any(isinstance(value, list) and any(isinstance(v, dict) for v in value) for value in changed.values()):
        return None  # a list of tables has no words on a command line
    return "".join(f" --set {key}={_written(value)}" for key, value in changed.items())


def _written(value: Any) -> str:
    """A value as the command line takes it."""
    text = "none" if value is None else str(value)
    return f"'{text}'" if " " in text else text


@cache
def _shipped(name: str) -> dict[str, Any]:
    return load(name).model_dump(mode="json")


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Dotted keys and their values."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= _flat(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return found
