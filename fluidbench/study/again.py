"""The command line that would ask for a finished run again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from functools import cache
from typing import Any

from ..errors import UserError
from ..runs.record import Record, Run
from ..scenario.library import load, shipped


def command_of(run: Run) -> str | None:
    """The command for a run of a shipped scenario, varied; None for any other."""
    settings = settings_of(run.record)
    if settings is None:
        return None
    return f"fluidbench run {run.record.scenario} --solver {run.method}{settings}{run.target.alone}"


def settings_of(record: Record, called: str = "", apart: tuple[str, ...] = ()) -> str | None:
    """What the scenario of a run has otherwise than the one that is `called` so, a shipped name or a file (default the
    shipped one of its own name), as ` --set key=value ...`, some keys `apart`; None where there is no such scenario, or
    no words for it."""
    base = _whole(called or record.scenario)
    if base is None or record.input is None:
        return None
    own = _flat(record.input)
    changed = {key: own.get(key) for key in {**base, **own} if base.get(key) != own.get(key) and key not in apart}
    if any(isinstance(value, list) and any(isinstance(v, dict) for v in value) for value in changed.values()):
        return None  # a list of tables has no words on a command line
    return "".join(f" --set {key}={_written(value)}" for key, value in changed.items())


def _written(value: Any) -> str:
    """A value as the command line takes it."""
    return shlex.quote("none" if value is None else str(value))


def _whole(called: str) -> dict[str, Any] | None:
    """Dotted keys and values of a scenario, not of its quick version; None where there is none."""
    if called in shipped():
        return _shipped(called)
    try:
        return _flat(load(called).model_dump(mode="json"))
    except UserError:
        return None


@cache
def _shipped(name: str) -> dict[str, Any]:
    return _flat(load(name).model_dump(mode="json"))


def _flat(table: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Dotted keys and their values."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= _flat(value, f"{before}{key}.") if isinstance(value, dict) else {f"{before}{key}": value}
    return found
