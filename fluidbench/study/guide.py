"""`guide`: which method for what: `select` on the jobs that people have, at several tolerances, as one chart."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

from ..errors import UserError
from ..method.verdict import lacking
from ..runs import archive
from ..runs.record import Run
from ..scenario import Scenario
from .candidates import limit_within, run_candidates
from .guide_report import report
from .result import Result
from .selection import Selection, Trust, assess
from .workplace import Options, Workplace, as_scenario, methods_of, names_of, share_of

JOBS = {
    "paste bead": "line_bead",
    "concrete wall": "concrete_wall",
    "foam wall": "foam_wall",
    "honey": "honey_line",
    "water": "dam_break",
}
"""What people simulate, and the shipped scenario that stands for it."""
TOLERANCES = (0.02, 0.05, 0.10)
NAME = "selections"  # of what is kept


@dataclass(repr=False)
class Guide(Result):
    """The choice for every job, machine and tolerance: `table` has a row for each; `studies` by machine and job is what
    it rests on."""

    studies: dict[str, dict[str, Selection]] = field(default_factory=dict)

    def keep(self, folder: Path) -> None:
        for jobs in self.studies.values():
            keep(jobs, folder)


def guide(
    scenarios: Sequence[Scenario | str | Path] | None = None,
    methods: Sequence[str] | None = None,
    *,
    tolerances: Sequence[float | str] = TOLERANCES,
    quick: bool = False,
    within: float = math.inf,
    **options: Unpack[Options],
) -> Guide:
    """Say which method and spacing [m] are the cheapest [s] within each tolerance for each job: what `select` finds,
    side by side.

    `scenarios`: shipped names, TOML files or scenarios, default those of JOBS; `quick`: the shorter versions of what is
    named; `methods` are names, default all; `tolerances`: largest relative errors of any length, as 0.05 or "5%";
    `within`: time [s] that all of it may take on a CPU, as in `select`. `options` are those of every verb, see Options.

    Raises UserError for what cannot be run, before anything is; Obstacle where `within` proves too short.
    """
    wanted = tolerances_of(tolerances)
    names = methods_of(methods, options)
    place = Workplace.of(options, limit_within(within), names)
    subjects = subjects_of(scenarios, quick)
    tried = run_candidates(subjects, names, place, "guide", within)
    jobs = {
        name: assess(subjects[name], names, own.runs, subjects[name].measured, own.untried)
        for name, own in tried.items()
    }
    studies = {archive.where(run for found in jobs.values() for run in found.runs): jobs}
    return _concluded(studies, wanted, place.store.root, keeper=place.keeper)


def published(
    folder: str | Path, tolerances: Sequence[float | str] = TOLERANCES, out: str | Path | None = None
) -> Guide:
    """Choose again from what studies have kept in a `folder`, or in folders inside it: nothing is run.

    Raises UserError where there is none, for one that was changed since, and for studies of different scenarios.
    """
    wanted = tolerances_of(tolerances)
    studies: dict[str, dict[str, Selection]] = {}
    for place in archive.places(Path(folder).expanduser(), NAME, "guide"):
        jobs = restore(place)
        machine = archive.where(run for found in jobs.values() for run in found.runs)
        if machine in studies:
            raise UserError(f"{archive.shown(place)}: a second study of {machine}; each machine is shown once")
        for job, found in ((j, f) for other in studies.values() for j, f in other.items() if j in jobs):
            if _subject(found) != _subject(jobs[job]):
                raise UserError(f"{archive.shown(place)}: {job} is another scenario than elsewhere")
        studies[machine] = jobs
    root = Path(folder if out is None else out).expanduser().absolute()
    return _concluded(studies, wanted, root, kept=True)


def subjects_of(scenarios: Sequence[Scenario | str | Path] | None, quick: bool) -> dict[str, Scenario]:
    """Scenario by job; raises UserError for one that is named twice, and for an empty list."""
    named = names_of(scenarios, "scenario")
    if named is not None and not named:
        raise UserError("scenarios: none is named; leave them out for one of each job")
    given: Iterable[Any] = named or JOBS.values()
    titles = {name: job for job, name in JOBS.items()}
    found: dict[str, Scenario] = {}
    for one in given:
        scenario = as_scenario(one, quick)
        job = titles.get(scenario.name, scenario.name)
        if job in found:
            raise UserError(f"scenario: {job} is named twice")
        found[job] = scenario
    return found


def _concluded(studies: dict[str, dict[str, Selection]], tolerances: Sequence[float], root: Path, **more: Any) -> Guide:
    selections = [found for jobs in studies.values() for found in jobs.values()]
    runs = [run for found in selections for run in found.runs]
    missing = lacking(runs, refusals=False)
    ok = all(found.candidates for found in selections) and not missing
    return Guide(report(studies, tolerances, root, missing), root, runs, missing, ok, studies=studies, **more)


def tolerances_of(given: Any) -> list[float]:
    """From the least to the largest; raises UserError for what is none."""
    several = isinstance(given, Iterable) and not isinstance(given, str)
    found = [share_of(one, "tolerances") for one in (given if several else [given])]
    if not found:
        raise UserError("tolerances: at least one is wanted")
    return sorted(set(found))


def _subject(found: Selection) -> str:
    """What it is a study of, spacing and chance apart."""
    alike = {"spacing": 1.0, "seed": 0, "jitter": 0.0}
    return found.scenario.model_copy(update=alike).model_dump_json() if found.scenario else ""


def keep(jobs: Mapping[str, Selection], folder: Path) -> None:
    """Write the records of all runs, and which job they are of, into a folder."""
    index = {
        "jobs": {
            job: {
                "scenario": found.scenario and found.scenario.model_dump(mode="json"),
                "runs": [run.folder.name for run in found.runs],
                "untried": found.untried,
                "trust": {method: [trust.passed, trust.judged] for method, trust in found.trust.items()},
            }
            for job, found in jobs.items()
        }
    }
    archive.keep(folder, NAME, index, (run for found in jobs.values() for run in found.runs))


def restore(folder: Path) -> dict[str, Selection]:
    """What a folder keeps, assessed anew; methods are trusted as by the known answers of the edition that ran them."""
    index, runs = archive.restore(folder, NAME)
    try:
        return {job: _again(told, runs) for job, told in index["jobs"].items()}
    except (KeyError, TypeError, ValueError) as error:
        raise UserError(archive.another_edition(folder, error)) from None


def _again(told: Mapping[str, Any], runs: Mapping[str, Run]) -> Selection:
    """A job's selection, assessed anew."""
    scenario = Scenario.model_validate(told["scenario"])
    trust = {method: Trust(*counts) for method, counts in told["trust"].items()}
    made = [runs[name] for name in told["runs"]]
    return assess(scenario, list(trust), made, scenario.measured, told["untried"], trust)
