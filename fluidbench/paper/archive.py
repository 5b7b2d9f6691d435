"""The evidence of a study without its particles: an index of what every run was made for, and the runs' records; enough
to judge the table again, elsewhere and later."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import UserError, quoted
from ..files import write_parquet
from ..runs.record import Record, Run
from ..runs.store import read_record, write_record
from ..scenario import Scenario
from ..study.case import Finding, Number, cases
from ..study.trials import Trial
from .evidence import GROUPS, Evidence

INDEX, RECORDS = "evidence.json", "records.parquet"
TRIALS = ("trials", "other_trials")
OWN = ("method", "level", "spacing", "verdict", "note")  # of a trial


def keep(e: Evidence, folder: Path) -> None:
    """Write index and records into a folder; the index is sealed, and so are the records by it."""
    import pandas as pd

    records = {run.folder.name: json.dumps(run.record.model_dump(mode="python")) for run in e.runs()}
    table = pd.DataFrame({"run": list(records), "record": list(records.values())})
    write_parquet(folder / RECORDS, table)
    index = {
        "scenario": e.scenario.model_dump(mode="json"),
        "seed": e.seed,
        "groups": {
            name: [[key, [run.folder.name for run in runs]] for key, runs in e.group(name).items()] for name in GROUPS
        },
        "limits": e.limits,
        **{name: [_told(t) for t in getattr(e, name)] for name in TRIALS},
    }
    write_record(folder, index, [folder / RECORDS], INDEX)


def _told(t: Trial) -> dict[str, Any]:
    """A trial as JSON can hold it."""
    found = t.finding
    return {
        "case": t.case.name,
        **{key: getattr(t, key) for key in OWN},
        "cost": {key: float(value) for key, value in t.cost.items()},
        "tolerance": t.tolerance,
        "finding": found and {"error": float(found.error), "numbers": [_plain(n) for n in found.numbers]},
        "runs": {label: run.folder.name for label, run in t.runs.items()},
    }


def _plain(n: Number) -> dict[str, Any]:
    return {"quantity": n.quantity, "measured": float(n.measured), "reference": float(n.reference)}


def restore(folder: Path) -> Evidence:
    """The evidence that a folder holds; its runs have records alone. Raises UserError where it is not whole."""
    import pandas as pd

    index, why = read_record(folder, INDEX)
    where = quoted(str(folder))[1:-1]
    if index is None:
        raise UserError(f"{where}: {why or f'no {INDEX} here: give a folder that `fluidbench table1` wrote'}")
    try:
        table = pd.read_parquet(folder / RECORDS)
        records = {
            name: Record.model_validate(json.loads(text)) for name, text in zip(table.run, table.record, strict=True)
        }
        runs = {name: Run(record, folder / "runs" / name) for name, record in records.items()}
        trials, other = ([_trial(t, runs) for t in index[name]] for name in TRIALS)
        e = Evidence(Scenario.model_validate(index["scenario"]), trials, {}, limits=index["limits"])
        e.other_trials, e.seed = other, index["seed"]
        for name in GROUPS:
            e.take(name, {key: _pick(runs, names) for key, names in index["groups"][name]})
        return e
    except (KeyError, TypeError, ValidationError) as error:
        raise UserError(f"{where}: of another edition of fluidbench ({type(error).__name__}: {error})") from None


def _pick(runs: dict[str, Run], names: Iterable[str]) -> list[Run]:
    return [runs[name] for name in names]


def _trial(told: dict[str, Any], runs: dict[str, Run]) -> Trial:
    found = told["finding"]
    finding = found and Finding(found["error"], tuple(Number(**n) for n in found["numbers"]))
    own = {key: told[key] for key in OWN}
    made = {label: runs[name] for label, name in told["runs"].items()}
    trial = Trial(cases()[told["case"]], **own, finding=finding, runs=made, cost=told["cost"])
    if not math.isclose(trial.tolerance, told.get("tolerance", trial.tolerance), rel_tol=1e-9):
        raise UserError(f"{trial.name} was judged by a tolerance of {told['tolerance']:g}, which is now another")
    return trial


def archives(folder: Path) -> dict[str, Evidence]:
    """Every study that a folder holds, itself or in folders of its own, by what sets it apart. Raises UserError for
    none, and for one that is not whole."""
    try:
        places = [folder] if (folder / INDEX).exists() else sorted(path.parent for path in folder.glob(f"*/{INDEX}"))
    except (OSError, ValueError) as error:
        raise UserError(f"{quoted(str(folder))[1:-1]}: {getattr(error, 'strerror', None) or error}") from None
    if not places:
        raise UserError(
            f"{quoted(str(folder))[1:-1]}: no {INDEX}, here or one folder down: give one that `fluidbench table1` wrote"
        )
    found: dict[str, Evidence] = {}
    for place in places:
        e = restore(place)
        found[e.label if e.label not in found else f"{e.label}, {place.name}"] = e
    if len({_subject(e) for e in found.values()}) > 1:
        raise UserError(f"{quoted(str(folder))[1:-1]}: studies of different scenarios are not put side by side")
    return found


def _subject(e: Evidence) -> str:
    """What it is a study of, chance apart."""
    return e.scenario.model_copy(update={"seed": 0, "jitter": 0.0}).model_dump_json()
