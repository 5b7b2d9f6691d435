"""Sweeps: the grid of points, which of them share launches, what becomes of batches, and what is shown."""

import itertools

import pytest

import fluidbench as fb
from fluidbench.cli.options import axes_of
from fluidbench.errors import UserError
from fluidbench.method.target import Target
from fluidbench.registry import get_method
from fluidbench.runs.experiment import CRASH, Experiment
from fluidbench.study.sweep import Point, points_of
from fluidbench.study.sweep_report import report
from fluidbench.study.worlds import shared

from .made import BEAD, change, finished, working

STRESS, SPEED = "material.yield_stress", "nozzle.exit_speed"
MPM = get_method("mpm")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=20:200:5", [20.0, 65.0, 110.0, 155.0, 200.0]),
        ("a.b=1:1000:4:log", [1.0, 10.0, 100.0, 1000.0]),
        ("a.b=3,1.5, 20 Pa", [3, 1.5, "20 Pa"]),
        ("a.b=7", [7]),
        ("a.b=2:-2:2", [2.0, -2.0]),
    ],
)
def test_values_are_a_list_or_a_range(text, values):
    assert axes_of([text]) == {"a.b": pytest.approx(values) if isinstance(values[-1], float) else values}


@pytest.mark.parametrize(
    "wrong",
    [
        "a.b",
        "=3",
        "a.b=",
        "a.b=1:2",
        "a.b=1:2:1",
        "a.b=1:2:x",
        "a.b=0:2:3:log",
        "a.b=1:inf:3",
        "a.b=1:2:2000",
        "a=1,,2",
    ],
)
def test_what_is_no_range_is_refused(wrong):
    with pytest.raises(UserError, match="--over takes"):
        axes_of([wrong])


def test_a_key_is_named_once():
    with pytest.raises(UserError, match="twice"):
        axes_of(["a=1", "a=2"])
    with pytest.raises(UserError, match="twice"):
        axes_of(["a=1,1"])


def test_points_are_every_combination_the_last_key_fastest():
    grid = points_of(BEAD, {STRESS: [20.0, 60.0], SPEED: [0.05, "0.1 m/s", 0.2]})
    assert [tuple(settings.values()) for settings, _ in grid] == list(
        itertools.product((20.0, 60.0), (0.05, "0.1 m/s", 0.2))
    )
    scenarios = [s for _, s in grid]
    assert [s.material.yield_stress for s in scenarios] == [20.0] * 3 + [60.0] * 3
    assert [s.nozzle.speed for s in scenarios[:3]] == pytest.approx([0.05, 0.1, 0.2])
    assert scenarios[0].material.youngs_modulus == BEAD.material.youngs_modulus


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ({}, "a key and its values"),
        ({STRESS: []}, "a list of values"),
        ({STRESS: "20"}, "a list of values"),
        ({STRESS: 20.0}, "a list of values"),
        ({STRESS: [20.0, 20.0]}, "named twice"),
        ({"material.yeld_stress": [1.0, 2.0]}, "did you mean 'yield_stress'"),
        ({STRESS: [20.0, -1.0]}, "material.yield_stress = -1.0: line_bead: material.yield_stress"),
        ({STRESS: list(range(200)), "spacing": [1e-3 * (i + 1) for i in range(51)]}, "more than 10000"),
    ],
)
def test_what_cannot_be_swept_says_so(over, words):
    with pytest.raises(UserError, match=words):
        points_of(BEAD, over)


def test_points_that_differ_in_material_alone_share_launches():
    scenarios = [s for _, s in points_of(BEAD, {STRESS: [20.0, 60.0, 90.0], SPEED: [0.05, 0.1]})]
    assert shared(MPM, scenarios, Target(), 64) == [[0, 2, 4], [1, 3, 5]]
    assert shared(MPM, scenarios, Target(), 2) == [[0, 2], [1, 3], [4], [5]]
    assert shared(MPM, scenarios, Target(), 1) == [[i] for i in range(6)]
    resting = [s.replace(until="rest") for s in scenarios]  # each has an end of its own
    assert shared(MPM, resting, Target(), 64) == [[i] for i in range(6)]


@pytest.mark.parametrize(
    "over",
    [
        {"seed": [1, 2]},  # a session lays all worlds out by the first one's
        {"material.youngs_modulus": [1e3, 1e7]},  # and judges all by the fastest waves
        {"gravity": [[0.0, 0.0, -9.81], [0.0, 0.0, -981.0]]},
        {"nozzle.exit_speed": [0.05, 0.1]},
    ],
)
def test_points_do_not_share_what_a_session_has_once(over):
    scenarios = [s for _, s in points_of(BEAD, over)]
    assert shared(MPM, scenarios, Target(), 64) == [[0], [1]]


def test_a_point_that_is_refused_stands_alone():
    scenarios = [s for _, s in points_of(BEAD, {STRESS: [20.0, 1e9, 60.0]})]  # a solid is fed in
    assert shared(get_method("pbd"), scenarios, Target(), 64) == [[0, 2], [1]]


def test_keys_of_a_nozzle_need_one():
    with pytest.raises(UserError, match="the scenario has no nozzle"):
        points_of(fb.load("dam_break"), {SPEED: [0.1, 0.2]})


def test_what_cavitates_does_not_share_with_what_holds_together():
    honey = fb.load("honey_line", {"material.sound_speed": 5.0})  # the same whatever the viscosity
    scenarios = [s for _, s in points_of(honey, {"material.tension_limit": [0.0, 1e3, 2e3]})]
    assert shared(get_method("sph"), scenarios, Target(), 64) == [[0], [1, 2]]


def test_points_that_a_method_runs_by_other_schemes_do_not_share():
    scenarios = [s for _, s in points_of(BEAD, {"material.viscosity": [1.0, 1e4, 2.0]})]
    assert shared(get_method("sph"), scenarios, Target(), 64) == [[0, 2], [1]]


def batches(verdict="completed", broken=None):
    """Answers of batches that ended so: a width of as many metres as the yield stress has pascals."""

    def answer(work):
        if not isinstance(work, Experiment):
            stress = work.scenario["material"]["yield_stress"]
            return finished(work.method, measures={"bead_width_m": stress}, machine={"device": "alone"})
        if verdict == CRASH:
            return {CRASH: "it died"}
        told = [
            {
                "verdict": verdict,
                "reason": "",
                "cost": {"wall_s": 4.0},
                "points": [
                    {
                        "measures": {"bead_width_m": s["material"]["yield_stress"]},
                        "complaint": "it flew" if s["material"]["yield_stress"] == broken else None,
                        "print": "collapsed",
                        "warnings": ["odd"],
                    }
                    for s in batch
                ],
            }
            for batch in work.task["batches"]
        ]
        return {"machine": {"device": "shared"}, "batches": told}

    return answer


def run_sweep(monkeypatch, tmp_path, verdict, broken=None, **more):
    calls = working(monkeypatch, batches(verdict, broken))
    over = {STRESS: [20.0, 60.0], SPEED: [0.05, 0.1]}
    return fb.sweep("line_bead", over, ["mpm"], out=tmp_path, progress=False, **more), calls


def test_a_batch_gives_each_point_its_own(monkeypatch, tmp_path):
    found, calls = run_sweep(monkeypatch, tmp_path, "completed", worlds=8)
    assert len(calls) == 1 and [len(b) for work in calls[0] for b in work.task["batches"]] == [2, 2]
    assert found.table.bead_width_m.tolist() == found.table[STRESS].tolist() == [20.0, 20.0, 60.0, 60.0]
    assert found.table.together.tolist() == [2] * 4 and found.ok and not found.missing
    assert "shared" in found.report.machine and found.table.wall_s.tolist() == [4.0] * 4


def test_a_point_of_a_batch_tells_the_warnings_of_its_own_scenario(monkeypatch, tmp_path):
    working(monkeypatch, batches())
    found = fb.sweep("line_bead", {"material.youngs_modulus": [50.0, 60.0]}, ["mpm"], worlds=2, out=tmp_path)
    told = [note for note in found.report.notes if "wave speed" in note]
    assert [note.partition(":")[0] for note in told] == [f"mpm, material.youngs_modulus = {e}" for e in (50.0, 60.0)]


@pytest.mark.parametrize("verdict", ["diverged", "timeout", CRASH])
def test_points_of_a_batch_that_failed_run_alone(monkeypatch, tmp_path, verdict):
    found, calls = run_sweep(monkeypatch, tmp_path, verdict, worlds=8)
    assert [len(call) for call in calls] == [2, 4]
    assert found.table.bead_width_m.tolist() == [20.0, 20.0, 60.0, 60.0] and found.table.together.tolist() == [1] * 4
    assert found.report.failures and all("points of mpm ran alone" in line for line in found.report.failures)


def test_a_world_that_broke_by_its_own_scenario_runs_alone(monkeypatch, tmp_path):
    found, calls = run_sweep(monkeypatch, tmp_path, "completed", broken=60.0, worlds=8)
    assert [len(call) for call in calls] == [2, 2] and found.table.together.tolist() == [2, 2, 1, 1]
    assert found.report.alarms[0].endswith("the print: collapsed") and found.report.notes[0].endswith(": odd")


def test_on_a_processor_nothing_is_shared_unless_asked(monkeypatch, tmp_path):
    found, calls = run_sweep(monkeypatch, tmp_path, "completed")
    assert [len(call) for call in calls] == [4] and len(found.runs) == 4


def test_a_point_that_blew_up_is_a_point(monkeypatch, tmp_path):
    def answer(work):
        bad = work.scenario["material"]["yield_stress"] > 50.0
        told = {"verdict": "diverged", "reason": "it flew"} if bad else {}
        return change(finished(work.method, wall_s=3.0), **told)

    working(monkeypatch, answer)
    found = fb.sweep("line_bead", {STRESS: [20.0, 60.0]}, ["mpm"], out=tmp_path, progress=False)
    assert found.table.verdict.tolist() == ["completed", "diverged"] and found.ok
    assert found.report.failures == ["mpm, material.yield_stress = 60.0: diverged: it flew"]
    assert found.findings[0] == "2 points, 2 runs: 1 completed, 1 diverged."
    assert found.runs[1].cost.wall_s == 3.0 and found.table.wall_s.isna().tolist() == [False, True]
    assert [row[-1] for row in found.report.tables[0].rows] == ["3", "-"]  # it took time, and has no cost


def test_lengths_are_small_multiples_over_the_first_key(tmp_path):
    points = []
    for method in ("mpm", "sph"):
        for stress, speed in itertools.product((20.0, 60.0), (0.05, 0.1)):
            made = Point({STRESS: stress, SPEED: speed}, BEAD, method, "completed", together=4)
            made.measures, made.cost = {"bead_width_m": 1e-3 * stress, "top_m": 1.0}, {"wall_s": 2.0}
            points.append(made)
    made = report(BEAD, [STRESS, SPEED], points, {"device": "x"}, [], tmp_path)
    assert [plot.title for plot in made.plots] == [
        "bead width [mm], exit_speed = 0.05",
        "bead width [mm], exit_speed = 0.1",
    ]
    assert [(t.label, t.x, t.y) for t in made.plots[0].traces] == [
        ("mpm", [20.0, 60.0], [20.0, 60.0]),
        ("sph", [20.0, 60.0], [20.0, 60.0]),
    ]
    (table,) = made.tables
    assert table.head == ["method", "yield_stress", "exit_speed", "verdict", "bead width [mm]", "wall [s]"]
    assert table.rows[0] == ["mpm", "20", "0.05", "completed", "20", "2 / 4"]
    assert "mpm: bead width [mm] from 20 to 60." in made.findings
