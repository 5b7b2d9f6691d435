"""The evidence of a study, kept without its particles, see runs/archive.py; enough to judge the table again."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import UserError
from ..runs import archive
from ..runs.record import Run
from ..scenario import Scenario
from ..study.case import Finding, Number, cases
from ..study.trials import Trial
from .evidence import GROUPS, Evidence

NAME = "evidence"
TRIALS = ("trials", "other_trials")
OWN = ("method", "level", "spacing", "verdict", "note")  # of a trial


def keep(e: Evidence, folder: Path) -> None:
    """Write it into a folder."""
    index = {
        "scenario": e.scenario.model_dump(mode="json"),
        "seed": e.seed,
        "groups": {
            name: [[key, [run.folder.name for run in runs]] for key, runs in e.group(name).items()] for name in GROUPS
        },
        "limits": e.limits,
        **{name: [_told(t) for t in getattr(e, name)] for name in TRIALS},
    }
    archive.keep(folder, NAME, index, e.runs())


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
    index, runs = archive.restore(folder, NAME)
    try:
        trials, other = ([_trial(t, runs) for t in index[name]] for name in TRIALS)
        e = Evidence(Scenario.model_validate(index["scenario"]), trials, {}, limits=index["limits"])
        e.other_trials, e.seed = other, index["seed"]
        for name in GROUPS:
            e.take(name, {key: _pick(runs, names) for key, names in index["groups"][name]})
        return e
    except (KeyError, TypeError, ValidationError) as error:
        raise UserError(archive.another_edition(folder, error)) from None


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
    found: dict[str, Evidence] = {}
    for place in archive.places(folder, NAME, "table1"):
        e = restore(place)
        found[e.label if e.label not in found else f"{e.label}, {place.name}"] = e
    if len({_subject(e) for e in found.values()}) > 1:
        raise UserError(f"{archive.shown(folder)}: studies of different scenarios are not put side by side")
    return found


def _subject(e: Evidence) -> str:
    """What it is a study of, chance apart."""
    return e.scenario.model_copy(update={"seed": 0, "jitter": 0.0}).model_dump_json()
