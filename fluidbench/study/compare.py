"""`compare` and `run`: one scenario through several methods, or one; fidelity beside cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

from ..errors import UserError, quoted
from ..method.suitability import check_backend
from ..method.target import DEFAULT_BACKEND, Target
from ..method.verdict import lacking
from ..registry import get_method
from ..runs.job import CHECKPOINTS, Job
from ..runs.record import Run
from ..scenario import Scenario
from ..scenario.measured import Measured
from ..scenario.numerics import configure
from .compare_report import report
from .result import Result
from .workplace import (
    Options,
    Workplace,
    as_scenario,
    measured_of,
    methods_of,
    names_of,
    require_number,
    targets_of,
    threads_alone,
)

WALL_LIMIT = 900.0  # s


@dataclass(repr=False)
class Comparison(Result):
    """Runs of one scenario, in `runs`; `table` has a row for each."""


def compare(
    scenario: Scenario | str | Path,
    methods: Sequence[str] | None = None,
    *,
    repeats: int = 1,
    backends: Sequence[str] | None = None,
    quick: bool = False,
    frames: bool = False,
    render_every: float | None = None,
    checkpoint_every: float = CHECKPOINTS,
    measured: str | Path | Sequence[Measured] = (),
    verb: str = "compare",
    **options: Unpack[Options],
) -> Comparison:
    """Run one scenario through several methods and put fidelity and cost side by side.

    `scenario` is one, or the name of a shipped one (`quick`: its shorter version), or a TOML file. `methods`: their
    names; default all. `repeats`: runs of each, for the spread of its cost. `backends`: several languages instead of
    one. `frames` keeps a snapshot of every output, `render_every` [simulated s] draws pictures beside the run,
    `checkpoint_every` [wall s] is what a killed run loses at most (0: everything). `measured`: a table of what was
    measured on a real print (CSV), beside what the scenario has of it. `verb` names what is written.
    `options` are those of every verb, see Options; with `jobs` as many run at a time, and the table of costs says so.

    Raises UserError for what cannot be run, before anything is.
    """
    backends = names_of(backends, "backends")
    if backends and "backend" in options:
        raise UserError("backend, backends: give one or the other")
    resolved, names = as_scenario(scenario, quick), methods_of(methods, options, backends)
    beside = measured_of(resolved, measured)
    require_number(checkpoint_every, "checkpoint_every", 0.0)
    if render_every is not None:
        require_number(render_every, "render_every", 1e-9)
    languages = backends or [options.get("backend", DEFAULT_BACKEND)]
    threads = options.get("threads")
    one = threads if len(languages) == 1 else 1
    place = Workplace.of({**options, "backend": languages[0], "threads": one}, WALL_LIMIT, names)
    if threads is None and place.executor is None and len(names) == repeats == len(languages) == 1:
        threads = threads_alone(resolved, names[0], place.target)
    targets = targets_of(place.target.device, languages, 1 if threads is None else threads)
    if not verb.replace("-", "").replace("_", "").isalnum():
        raise UserError(f"verb: a plain name is wanted (got {quoted(verb)})")
    planned = jobs(
        resolved,
        names,
        repeats,
        targets,
        wall_limit=place.wall_limit,
        keep_frames=frames,
        film_every=render_every,
        checkpoint_every=checkpoint_every,
    )
    runs = place.run(planned, verb, together=options.get("jobs") is not None)
    missing = lacking(runs, refusals=False)
    ok = any(run.ok for run in runs) and not missing
    made = report(runs, place.store.root, verb, beside)
    return Comparison(made, place.store.root, runs, missing, ok, keeper=place.keeper)


def run(scenario: Scenario | str | Path, method: str, **more: Any) -> Run:
    """Run one `scenario` through one `method`, by name; `more` are the arguments of `compare`, times in [s].

    However the run ends, its record says so; `record.measures`, `series` and `frame()` are what it left, in SI units.

    Raises UserError for what cannot be run, before anything is.
    """
    return compare(scenario, [method], **more).runs[0]


def jobs(
    scenario: Scenario, methods: Sequence[str], repeats: int, targets: Sequence[Target], **watched: Any
) -> list[Job]:
    """All runs of a comparison, `watched` as a Job says; raises UserError for an unknown method or setting."""
    require_number(repeats, "repeats", 1, whole=True)
    for name in methods:
        configure(get_method(name), scenario)
        for target in targets:
            check_backend(get_method(name), target)
    table = scenario.model_dump(mode="json")
    return [
        Job(table, name, target, repeat, **watched)
        for name in methods
        for target in targets
        for repeat in range(repeats)
    ]
