"""Runs kept without their particles: an index of what they were made for, sealed, and their records; enough to conclude
again, elsewhere and later."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import UserError, quoted
from ..files import write_parquet
from ..method.target import DEFAULT_BACKEND
from .record import Record, Run
from .store import read_record, write_record


def keep(folder: Path, name: str, index: dict[str, Any], runs: Iterable[Run]) -> None:
    """Write NAME.json, the index, and NAME.parquet, the records of the runs that it names by their folders."""
    import pandas as pd

    records = {run.folder.name: json.dumps(run.record.model_dump(mode="python")) for run in runs}
    path = folder / f"{name}.parquet"
    write_parquet(path, pd.DataFrame({"run": list(records), "record": list(records.values())}))
    write_record(folder, index, [path], f"{name}.json")


def restore(folder: Path, name: str) -> tuple[dict[str, Any], dict[str, Run]]:
    """(index, runs by the names of their folders), which are elsewhere. Raises UserError where it is not whole."""
    import pandas as pd

    index, why = read_record(folder, f"{name}.json")
    if index is None:
        raise UserError(f"{shown(folder)}: {why or f'no {name}.json here'}")
    table = pd.read_parquet(folder / f"{name}.parquet")
    try:
        records = {
            run: Record.model_validate(json.loads(text)) for run, text in zip(table.run, table.record, strict=True)
        }
    except ValidationError as error:
        raise UserError(another_edition(folder, error)) from None
    return index, {run: Run(record, folder / "runs" / run) for run, record in records.items()}


def another_edition(folder: Path, error: Exception) -> str:
    """That what a folder keeps cannot be understood."""
    return f"{shown(folder)}: of another edition of fluidbench ({type(error).__name__}: {error})"


def shown(folder: Path) -> str:
    """A folder as a message names it."""
    return quoted(str(folder))[1:-1]


def where(runs: Iterable[Run]) -> str:
    """The machine in a word or two: its GPU without its memory (as it was asked for, where nothing was run), or CPU;
    and what wrote its kernels, where that is not the default."""
    records = [run.record for run in runs]
    asked = next((r.device for r in records if r.device != "cpu"), "CPU")
    device = next((r.machine["device"] for r in records if "device" in r.machine), asked)
    backend = next((r.backend for r in records), DEFAULT_BACKEND)
    return re.sub(r" \d+GB.*", "", device) + f", {backend}" * (backend != DEFAULT_BACKEND)


def of_other_code(studies: Mapping[str, Iterable[Run]]) -> list[str]:
    """A line for each study, by its label, of which other sources than those of the newest run made something: where
    they differ, that may be why."""
    made = {label: [r for run in runs if "sources" in (r := run.record).code] for label, runs in studies.items()}
    records = [r for own in made.values() for r in own]
    if not records:
        return []
    newest = max(records, key=_time)
    lines = []
    for label, own in made.items():
        other = [r for r in own if r.code["sources"] != newest.code["sources"]]
        if other:
            share = "was" if len(other) == len(own) else "was in part"
            then, now = _time(max(other, key=_time)), _time(newest)
            long = len("2026-11-25") if then[:10] != now[:10] else len("2026-11-25 14:11")
            lines.append(f"{label} {share} made by other code ({then[:long]}) than the newest here ({now[:long]})")
    return lines


def _time(record: Record) -> str:
    return record.machine.get("time", "").replace("T", " ")


def places(folder: Path, name: str, verb: str) -> list[Path]:
    """The folders that keep an index of this name: this one, or folders inside it. Raises UserError for none; `verb` is
    what writes it."""
    index = f"{name}.json"
    try:
        found = [folder] if (folder / index).exists() else sorted(path.parent for path in folder.glob(f"*/{index}"))
    except (OSError, ValueError) as error:
        raise UserError(f"{shown(folder)}: {getattr(error, 'strerror', None) or error}") from None
    if not found:
        raise UserError(
            f"{shown(folder)}: no {index}, here or one folder down: give one that `fluidbench {verb}` wrote"
        )
    return found
