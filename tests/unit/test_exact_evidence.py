"""What the judged table runs, in both frameworks, and what the printed tower's timing says of the paper's claims."""

import math
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from fluidbench.method.target import Target
from fluidbench.paper import evidence as module
from fluidbench.paper.cells import all_runs, figures, runs_of
from fluidbench.paper.definitions import COST_CASES, METHODS, STRANDS
from fluidbench.paper.evidence import DEAR, GROUPS, SHIPPED, Evidence, gather, levels_of, methods_of, shipped
from fluidbench.runs.experiment import Experiment
from fluidbench.runs.job import Job
from fluidbench.runs.record import Run
from fluidbench.study.case import cases

from .made import BEAD, case, evidence, finished, known, trial

TAICHI = Target(backend="taichi")


@dataclass(frozen=True)
class Wanted(Run):
    """A run that remembers what was asked for."""

    wanted: Job | None = None


class Place(SimpleNamespace):
    """A workplace where nothing is run: calls as lists of work, and whether it may run together."""

    def __init__(self):
        super().__init__(target=Target(), wall_limit=77.0, calls=[], together=[])

    def run(self, planned, title, together=False):
        self.calls.append(list(planned))
        self.together.append(together)
        return [self.made(work) for work in planned]

    def made(self, work):
        if isinstance(work, Experiment):
            return {"method": work.method, "verdict": "held", "value": work.task["value"]}
        run = finished(work.method, spacing=work.scenario["spacing"])
        return Wanted(run.record, run.folder, wanted=work)


@pytest.fixture
def gathered():
    """What `gather` asks for: calls as lists of jobs, and the tasks of stability."""
    place = Place()
    found = gather(BEAD, [], 3, False, place)
    *calls, points = place.calls
    return found, calls, [work.task for work in points]


def numerics(run, method, key):
    return run.wanted.scenario["numerics"][method][key]


def test_the_scenario_runs_through_every_method_and_backend(gathered):
    found, calls, _ = gathered
    for m in METHODS:
        assert [(r.wanted.repeat, r.record.spacing_m) for r in found.repeats[m]] == [
            (0, 1.5e-3),
            (1, 1.5e-3),
            (2, 1.5e-3),
        ]
        assert [r.wanted.target.backend for r in found.other[m]] == ["taichi", "taichi"]
        assert [r.wanted.repeat for r in found.other[m]] == [0, 1]
        (second,) = found.second[m]
        assert second.record.spacing_m == pytest.approx(2e-3) and second.method == m
        assert [r.record.spacing_m for r in found.previews[m]] == pytest.approx([3e-3, 4e-3])
    timed, swept = calls
    made = [*timed, *swept]
    assert (len(timed), len(swept)) == (36, 24) and {job.wall_limit for job in made} == {77.0}
    assert all(
        job.target.backend == "warp"
        for job in made
        if job.method and job not in [r.wanted for runs in found.other.values() for r in runs]
    )
    assert len(found.runs()) == 60


def test_a_viscous_liquid_runs_by_both_schemes(gathered):
    found, *_ = gathered
    for scheme, runs in (("explicit", found.explicit), ("implicit", found.implicit)):
        for m in ("mpm", "sph"):
            assert [numerics(r, m, "viscosity") for r in runs[m]] == [scheme] * 2
        assert [r.wanted.scenario["name"] for r in runs["pbd"]] == ["honey_line"] * 2
        assert [r.wanted.repeat for r in runs["pbd"]] == [0, 1]


def test_sweeps_have_two_resolutions(gathered):
    """Grids keep their cells, of 1.5 and 2 spacings of 1.5 mm, while particles a cell vary; PBD keeps its spacing."""
    found, *_ = gathered
    assert list(found.grids) == [1.0, 1.5, 2.0, 3.0]
    for g, runs in found.grids.items():
        assert [numerics(r, "mpm", "grid_ratio") for r in runs] == [g, g]
        assert [r.record.spacing_m * g for r in runs] == pytest.approx([2.25e-3, 3e-3])
    assert list(found.iterations) == [1, 2, 5, 10] and list(found.advances) == [0.0625, 0.125, 0.25, 0.5]
    for key, sweep in (("iterations", found.iterations), ("advance", found.advances)):
        for value, runs in sweep.items():
            assert [numerics(r, "pbd", key) for r in runs] == [value, value]
            assert [r.record.spacing_m for r in runs] == pytest.approx([1.5e-3, 2e-3])
            assert {r.method for r in runs} == {"pbd"}


def test_limits_are_measured_at_two_spacings(gathered):
    found, _, points = gathered
    assert [(p["method"], p["value"], p["settings"]["spacing"]) for p in points] == [
        (m, v, pytest.approx(v * 1.5e-3)) for m in METHODS for v in (0.5, 1.0)
    ]
    assert {m: [r["value"] for r in rows] for m, rows in found.limits.items()} == {m: [0.5, 1.0] for m in METHODS}


def test_times_are_measured_one_at_a_time_and_limits_are_not():
    place = Place()
    gather(BEAD, [], 3, False, place)
    assert place.together == [False, True, True]


def test_one_backend_alone_is_no_pair(monkeypatch):
    monkeypatch.setattr(Target, "other", property(lambda _: None))
    alone = gather(BEAD, [], 2, True, Place())
    assert alone.other == {} and len(alone.runs()) == 51
    assert len(gather(BEAD, [], 5, True, Place()).runs()) == 60


def test_levels_and_cases_of_a_quick_study():
    every = cases()
    full, quick = ({c.name for c in module.chosen_cases(q)} for q in (False, True))
    assert quick == full - set(DEAR) and {STRANDS, *COST_CASES, "cantilever_sag"} <= full
    assert not full & {"free_fall", "strand_concrete", "wall_collapse", "constitutive_driver"}  # no rule asks for them
    assert methods_of(every[STRANDS]) == ("pbd",) and methods_of(every["dam_break"]) == METHODS
    assert levels_of(every["dam_break"], False) == ("rough", "coarse", "medium")
    assert levels_of(every["dam_break"], True) == ("rough", "coarse") and levels_of(every["free_fall"], False) == (
        "coarse",
    )
    assert set(COST_CASES) | set(DEAR) <= full


def test_shipped_answers_are_those_of_the_dear_cases():
    rows = [r for r in module.reference("known_answers").to_dict("records") if r["case"] in DEAR]
    found = shipped()
    assert {(t.case.name, t.method) for t in found} == {
        (r["case"], r["method"]) for r in rows if r["method"] in METHODS
    }
    by_name = {(t.case.name, t.method): t for t in found}
    for row in rows:
        t = by_name[row["case"], row["method"]]
        assert (t.error, t.verdict, t.note, t.level) == (row["error"], row["verdict"], SHIPPED, "coarse")
        assert t.cost["wall_s"] == row["wall_s"] and t.spacing == row["spacing_m"] and not t.runs


def test_shipped_answers_leave_out_what_was_skipped_or_has_no_error(monkeypatch):
    import pandas as pd

    row = {
        "case": "slump_slip",
        "method": "mpm",
        "verdict": "pass",
        "error": 0.1,
        "spacing_m": 1.0,
        "particles": 1,
        "wall_s": 1.0,
        "wall_per_simulated_s": 1.0,
    }
    rows = [
        row,
        row | {"method": "sph", "verdict": "skipped"},
        row | {"method": "law"},
        row | {"case": "free_fall"},
        row | {"method": "pbd", "verdict": "timeout", "error": math.nan},
    ]
    monkeypatch.setattr(module, "reference", lambda _: pd.DataFrame(rows))
    assert [(t.method, t.finding is None) for t in shipped()] == [("mpm", False), ("pbd", True)]


def test_what_is_missing_is_every_run_trial_and_point_that_says_nothing():
    quiet = trial(case("q"), "mpm", verdict="error")
    quiet.runs = {}
    told = trial(case("s"), "mpm", verdict="skipped")
    points = [
        {"axis": "spacing", "value": 0.5, "method": "sph", "verdict": v, "reason": "r"} for v in ("error", "failed")
    ]
    e = evidence([quiet, told], limits={"sph": points}, other_trials=[trial(case("o"), "sph", verdict="timeout")])
    assert e.missing() == [
        "q, mpm, d = 10 mm: error: ",
        "o, sph, d = 10 mm: timeout: ",
        "stability, spacing = 0.5, sph: error: r",
    ]
    bad = [finished(f"m{i}", "error") for i in range(len(GROUPS))]
    full = Evidence(BEAD, [], {})
    for name, run in zip(GROUPS, bad, strict=True):
        full.take(name, {"mpm": [run]})
    assert [id(r) for r in full.runs()] == [id(r) for r in bad] and len(full.missing()) == len(bad)


def test_figures_need_every_repeat():
    runs = {"mpm": [finished(wall_s=2.0), finished(wall_s=3.0)], "sph": [finished("sph", "diverged")], "pbd": []}
    assert figures(runs, "wall_s") == {"mpm": [2.0, 3.0]}
    assert [r.method for r in all_runs(evidence())] == ["mpm", "mpm", "sph", "sph", "pbd", "pbd"]
    rows = known("mpm", 2, 1)
    assert runs_of(rows) == [r for t in rows for r in t.runs.values()]
