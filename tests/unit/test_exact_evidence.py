"""What the judged table runs, in both frameworks, and what the printed tower's timing says of the paper's claims."""

import math

import pytest

from fluidbench.run import Job
from fluidbench.study import evidence as module
from fluidbench.study.case import cases
from fluidbench.study.cells import all_runs, figures, runs_of
from fluidbench.study.evidence import COST_CASES, DEAR, METHODS, SHIPPED, Evidence, gather, levels_of, planned, shipped
from fluidbench.target import Target

from .made import BEAD, case, evidence, finished, known, trial

TAICHI = Target(backend="taichi")


@pytest.fixture
def gathered(monkeypatch):
    """What `gather` asks for: calls of execute as lists of jobs, and the tasks of stability."""
    calls: list[list[Job]] = []
    points: list[dict] = []

    def execute(planned, store, hooks):
        calls.append(list(planned))
        return [finished(j.method, spacing=j.scenario["spacing"], wanted=j) for j in planned]

    def measure(tasks, store, workers, done):
        points.extend(task for _, task in tasks)
        return [{"method": task["method"], "verdict": "held", "value": task["value"]} for _, task in tasks]

    monkeypatch.setattr(module, "execute", execute)
    monkeypatch.setattr(module, "measure_points", measure)
    found = gather(BEAD, [], 3, False, None, None, 1, Target(), 77.0)
    return found, calls, points


def numerics(run, method, key):
    return run.record["wanted"].scenario["numerics"][method][key]


def test_the_scenario_runs_through_every_method_and_backend(gathered):
    found, calls, _ = gathered
    for m in METHODS:
        assert [(r.record["wanted"].repeat, r.record["spacing_m"]) for r in found.repeats[m]] == [
            (0, 1.5e-3), (1, 1.5e-3), (2, 1.5e-3)
        ]  # fmt: skip
        assert [r.record["wanted"].target.backend for r in found.other[m]] == ["taichi", "taichi"]
        assert [r.record["wanted"].repeat for r in found.other[m]] == [0, 1]
        assert found.second[m].record["spacing_m"] == pytest.approx(2e-3)
        assert found.second[m].record["method"] == m
    made = [job for call in calls for job in call]
    assert len(made) == planned(3, Target()) == 42 and {job.wall_limit for job in made} == {77.0}
    assert all(job.target.backend == "warp" for job in made if job.method and job not in
               [r.record["wanted"] for runs in found.other.values() for r in runs])  # fmt: skip
    assert len(found.runs()) == 42


def test_sweeps_have_two_resolutions(gathered):
    """Grids keep their cells, of 1.5 and 2 spacings of 1.5 mm, while particles a cell vary; PBD keeps its spacing."""
    found, *_ = gathered
    assert list(found.grids) == [1.0, 1.5, 2.0, 3.0]
    for g, runs in found.grids.items():
        assert [numerics(r, "mpm", "grid_ratio") for r in runs] == [g, g]
        assert [r.record["spacing_m"] * g for r in runs] == pytest.approx([2.25e-3, 3e-3])
    assert list(found.iterations) == [1, 2, 5, 10] and list(found.advances) == [0.0625, 0.125, 0.25, 0.5]
    for key, sweep in (("iterations", found.iterations), ("advance", found.advances)):
        for value, runs in sweep.items():
            assert [numerics(r, "pbd", key) for r in runs] == [value, value]
            assert [r.record["spacing_m"] for r in runs] == pytest.approx([1.5e-3, 2e-3])
            assert {r.record["method"] for r in runs} == {"pbd"}


def test_limits_are_measured_at_two_spacings(gathered):
    found, _, points = gathered
    assert [(p["method"], p["value"], p["settings"]["spacing"]) for p in points] == [
        (m, v, pytest.approx(v * 1.5e-3)) for m in METHODS for v in (0.5, 1.0)
    ]
    assert {m: [r["value"] for r in rows] for m, rows in found.limits.items()} == {m: [0.5, 1.0] for m in METHODS}


def test_one_backend_alone_is_no_pair(gathered, monkeypatch):
    monkeypatch.setattr(Target, "other", property(lambda _: None))
    alone = gather(BEAD, [], 2, True, None, None, 1, Target(), 1.0)
    assert alone.other == {} and planned(2, Target()) == 33
    assert planned(5, Target()) == 42


def test_levels_and_cases_of_a_quick_study():
    every = cases()
    assert [c.name for c in module.chosen_cases(False)] == list(every)
    assert {c.name for c in module.chosen_cases(True)} == set(every) - set(DEAR)
    assert levels_of(every["dam_break"], False) == ("rough", "coarse", "medium")
    assert levels_of(every["dam_break"], True) == ("rough", "coarse") and levels_of(every["free_fall"], False) == (
        "coarse",
    )
    assert set(COST_CASES) | set(DEAR) <= set(every)


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

    row = {"case": "slump_slip", "method": "mpm", "verdict": "pass", "error": 0.1, "spacing_m": 1.0, "particles": 1,
           "wall_s": 1.0, "wall_per_simulated_s": 1.0}  # fmt: skip
    rows = [row, row | {"method": "sph", "verdict": "skipped"}, row | {"method": "law"}, row | {"case": "free_fall"},
            row | {"method": "pbd", "verdict": "timeout", "error": math.nan}]  # fmt: skip
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
        "line_bead, sph, d = 1 mm: timeout: ", "q, mpm, d = 10 mm: error: ", "stability, spacing = 0.5, sph: error: r",
    ]  # fmt: skip
    bad = [finished(f"m{i}", "error") for i in range(6)]
    full = Evidence(BEAD, [], {"mpm": [bad[0]]}, {"mpm": bad[1]}, {1.0: [bad[2]]}, {1: [bad[3]]}, {0.1: [bad[4]]}, {},
                    {"mpm": [bad[5]]})  # fmt: skip
    assert {id(r) for r in full.runs()} == {id(r) for r in bad} and len(full.missing()) == 6


def test_figures_need_every_repeat():
    runs = {"mpm": [finished(wall_s=2.0), finished(wall_s=3.0)], "sph": [finished("sph", "diverged")], "pbd": []}
    assert figures(runs, "wall_s") == {"mpm": [2.0, 3.0]}
    assert [r.record["method"] for r in all_runs(evidence())] == ["mpm", "mpm", "sph", "sph", "pbd", "pbd"]
    rows = known("mpm", 2, 1)
    assert runs_of(rows) == [r for t in rows for r in t.runs.values()]
