"""Points of the study of stability: axes, tasks, what a point measures, and the findings."""

import itertools
import math
from dataclasses import replace

import pytest

from fluidbench.errors import UserError
from fluidbench.method.contract import Steps
from fluidbench.method.target import Target
from fluidbench.method.vitals import Vital
from fluidbench.registry import get_method
from fluidbench.scenario.numerics import configure
from fluidbench.study import limits, points, stability
from fluidbench.study.case import Finding, Number
from fluidbench.study.limits import Limit, default_dt
from fluidbench.study.points import (
    AXES,
    BLOCKS,
    block_material,
    block_tasks,
    choose,
    findings,
    measure_block,
    measure_blocks,
    measure_point,
    measure_points,
    point_tasks,
    varied,
)
from fluidbench.study.trials import evaluate

from ..conftest import bead, scenario
from .made import BEAD, case, finished, working

WATER = {"density": 1000.0, "sound_speed": 10.0}


def test_axes_set_their_keys():
    assert AXES["viscosity"].setting(BEAD, 3.0) == {"material.viscosity": 3.0}
    assert AXES["spacing"].setting(BEAD, 2.0) == {"spacing": 3e-3}
    own = choose(["particles_per_cell"], ["sph", "mpm"])["particles_per_cell"]
    assert own.setting(BEAD, 8) == {"numerics.mpm.grid_ratio": pytest.approx(2.0)} and own.method == "mpm"
    assert list(choose([], ["mpm", "sph"])) == [*AXES, "particles_per_cell"]
    assert list(choose([], ["sph", "pbd"])) == list(AXES) and list(choose(["density"], ["mpm"])) == ["density"]
    with pytest.raises(UserError, match="no axis 'particles_per_cell'"):
        choose(["particles_per_cell"], ["sph", "pbd"])
    for axis in choose([], ["mpm"]).values():
        assert list(axis.values) == sorted(set(axis.values)) and set(axis.quick) <= set(axis.values)
        assert (axis.quick[0], axis.quick[-1]) == (axis.values[0], axis.values[-1])


def test_tasks_are_every_axis_method_and_value():
    tasks = point_tasks(BEAD, choose(["density", "particles_per_cell"], ["mpm", "sph"]), ["mpm", "sph"], True, Target())
    assert [(label, t["value"]) for label, t in tasks] == [
        *[(f"density-{m}", v) for m in ("mpm", "sph") for v in (10.0, 1e3, 1e4)],
        *[("particles_per_cell-mpm", v) for v in (1, 8, 27)],
    ]
    assert tasks[0][1]["settings"] == {"material.density": 10.0} and tasks[0][1]["quick"] is True
    assert len(point_tasks(BEAD, choose(["density"], ["pbd"]), ["pbd"], False, Target())) == 5
    made = block_tasks(["mpm", "sph", "pbd"], True, Target())
    assert [label for label, _ in made] == [f"block-{k}-{m}" for m in ("mpm", "sph") for k in BLOCKS]
    assert {t["precision"] for _, t in made} == {0.1} and block_tasks(["mpm"], False, Target())[0][1][
        "precision"
    ] == 0.03


def test_axes_go_by_decades_or_halves_of_them():
    """Consecutive values, where they are not zero: a factor of 10 or 100, or 3 and 10 / 3 in turn."""
    for name in ("viscosity", "youngs_modulus", "yield_stress", "density", "exit_speed"):
        values = [v for v in AXES[name].values if v > 0]
        steps = {round(b / a, 2) for a, b in itertools.pairwise(values)}
        assert steps <= {10.0, 100.0, 3.0, 3.33} and values[0] == pytest.approx(10 ** round(math.log10(values[0])))
    counts = choose(["particles_per_cell"], ["mpm"])["particles_per_cell"].values
    assert counts[0] == 1 and counts[-1] == 27 and [b / a for a, b in itertools.pairwise(counts[:4])] == [2.0] * 3
    assert AXES["spacing"].values == pytest.approx((1 / 3, 1 / 2, 1, 2, 8 / 3))
    assert AXES["poisson_ratio"].values == (0.0, 0.2, 0.3, 0.4, 0.45, 0.49, 0.499)


@pytest.mark.parametrize(
    ("ticks", "each", "trouble_at", "looked"), [(9, 1, None, 9), (9, 1999, None, 2), (9, 1000, None, 2), (9, 1, 3, 3)]
)
@pytest.mark.parametrize("kind", ["complaint", "shortage"])
def test_the_opening_is_two_thousand_substeps_or_all(monkeypatch, ticks, each, trouble_at, looked, kind):
    s = scenario(duration=0.1 * ticks, tick=0.1, output_interval=0.1)
    assert s.schedule[:2] == (pytest.approx(0.1), ticks)

    class Opened:
        def __init__(self, opened, config, target):
            assert (opened, config, target) == (s, configure(get_method("mpm"), s), Target())
            self.now, self.done, self.looks = 0.0, 0, 0
            made.append(self)

        def advance(self, until):
            assert until == pytest.approx(self.now + s.schedule[0])
            self.now, self.done = until, self.done + 1
            return Steps(substeps=each)

        def look(self):
            self.looks += 1
            return Vital(1.0, 1.0, 0.0, **{"complaint": None, kind: "boom" if self.looks == trouble_at else None})

    made = []
    monkeypatch.setattr(get_method("mpm"), "start", Opened)
    assert points.opening(s, "mpm", Target()) == ("boom" if trouble_at else None)
    assert made[0].looks == looked == made[0].done


def test_a_varied_scenario_changes_only_its_keys():
    table = bead(nozzle={"diameter": 0.012, "flow_rate": 1e-5, "standoff": 0.01}).model_dump(mode="json")
    changed = varied(table, {"nozzle.exit_speed": 0.2, "material.density": 7.0})
    assert (changed.nozzle.exit_speed, changed.nozzle.flow_rate, changed.material.density) == (0.2, None, 7.0)
    kept = varied(table, {"material.density": 7.0}).nozzle
    assert (kept.exit_speed, kept.flow_rate) == (None, 1e-5)
    assert varied(table, {}).model_dump(mode="json") == table
    with pytest.raises(UserError, match="the scenario has no nozzle"):
        varied(scenario().model_dump(mode="json"), {"nozzle.exit_speed": 1.0})


def test_a_block_of_the_scenarios_material_does_not_yield():
    assert block_material(bead()) == {
        "density": 1000.0,
        "youngs_modulus": 6e3,
        "poisson_ratio": 0.45,
        "viscosity": 0.0,
        "plastic_viscosity": 0.0,
        "flow_index": 1.0,
        "equation_of_state": "linear",
    }
    water = scenario()
    assert block_material(water)["sound_speed"] == water.liquid_sound_speed
    assert "sound_speed" not in block_material(scenario(material={"density": 1.0, "bulk_modulus": 3.0}))
    assert block_material(scenario(material=WATER))["sound_speed"] == 10.0
    oldroyd = scenario(material={"density": 1.0, "youngs_modulus": 3.0, "relaxation_time": 0.5})
    assert block_material(oldroyd)["relaxation_time"] == 0.5 and "sound_speed" not in block_material(oldroyd)


def point(monkeypatch, method="mpm", quick=True, survive=lambda dt: None, block_dt=0.5, opening=None, own=1.0):
    """A point of density whose lump comes through where `survive` says so; and all steps that were tried."""
    tried, asked = [], []

    def lump_survives(s, solver, config, dt, target):
        tried.append(dt)
        return survive(dt)

    def block_limit(s, solver, config, own, precision, target):
        asked.append((s, own, precision))
        return Limit(block_dt, block_dt)

    monkeypatch.setattr(limits, "lump_survives", lump_survives)
    monkeypatch.setattr(limits, "block_limit", block_limit)
    monkeypatch.setattr(limits, "default_dt", lambda *_: (own, "acoustic"))
    monkeypatch.setattr(points, "opening", lambda *_: opening)
    task = point_tasks(BEAD, choose(["density"], [method]), [method], quick, Target())[1][1]
    return measure_point(task), tried, asked


def test_a_point_is_bracketed_around_the_methods_own_step(monkeypatch):
    row, tried, asked = point(monkeypatch, survive=lambda dt: None if dt <= 4.0 else "boom")
    assert (row["verdict"], row["reason"], row["binding"], row["dt_own_s"]) == ("held", "", "acoustic", 1.0)
    assert row["axis"] == "density" and row["method"] == "mpm" and row["value"] == 1e3
    assert row["dt_lump_s"] <= 4.0 < 1.2 * row["dt_lump_s"] and row["lump_limit_found"] is True
    assert row["dt_block_s"] == 0.5 and asked[0][1:] == (1.0, 0.2) and asked[0][0].spacing == BEAD.spacing
    assert asked[0][0].numerics == BEAD.numerics and asked[0][0].material.yield_stress is None
    assert tried[:2] == [1.0, 1.0] and max(tried) <= 8.0
    assert row["dt_theory_s"] == pytest.approx(
        get_method("mpm").theory(BEAD, get_method("mpm").Config(**BEAD.numerics["mpm"]))
    )
    beyond, tried, _ = point(monkeypatch)
    assert beyond["lump_limit_found"] is False and beyond["dt_lump_s"] == pytest.approx(1.5**5) and len(tried) == 7


def test_a_point_that_fails_says_why_and_a_full_study_looks_at_the_opening(monkeypatch):
    row, *_ = point(monkeypatch, survive=lambda dt: None if dt < 0.5 else "boom")
    assert (row["verdict"], row["reason"]) == ("failed", "boom") and 0.4 < row["dt_lump_s"] < 0.5
    row, _, asked = point(monkeypatch, quick=False, opening="late")
    assert (row["verdict"], row["reason"], asked[0][2]) == ("failed", "late", 0.05)
    assert point(monkeypatch, opening="late")[0]["verdict"] == "held"
    assert point(monkeypatch, quick=False)[0]["verdict"] == "held"


def test_pbd_is_tried_at_eight_steps_once(monkeypatch):
    row, tried, asked = point(monkeypatch, "pbd")
    assert tried == [1.0, 8.0] and row["dt_lump_s"] == 8.0 and row["lump_limit_found"] is False and not asked
    assert point(monkeypatch, "pbd", own=0.5)[1] == [0.5, 4.0]
    row, tried, _ = point(monkeypatch, "pbd", survive=lambda dt: "boom" if dt > 1 else None)
    assert row["dt_lump_s"] == 1.0 and row["lump_limit_found"] is True and "dt_block_s" not in row
    assert row["dt_theory_s"] is None


def test_a_point_that_makes_no_scenario_or_is_refused_says_so():
    task = point_tasks(scenario(), choose(["exit_speed"], ["mpm"]), ["mpm"], True, Target())[0][1]
    assert measure_point(task)["reason"] == "nozzle.exit_speed: the scenario has no nozzle"
    assert measure_point(task)["verdict"] == "refused"


def test_crashes_are_rows_with_their_reason():
    results = [{"crash": "it died"}, {"axis": "density", "value": 1.0}]
    asked = []

    def run(work):
        asked.append(list(work))
        return results

    tasks = point_tasks(BEAD, choose(["density"], ["mpm"]), ["mpm"], True, Target())[:2]
    rows = measure_points(tasks, run)
    assert rows[0] == {"axis": "density", "value": 10.0, "method": "mpm", "verdict": "error", "reason": "it died"}
    assert rows[1] == results[1]
    blocks = block_tasks(["mpm"], True, Target())[:2]
    assert measure_blocks(blocks, run) == [{"kind": "acoustic", "method": "mpm", "reason": "it died"}, results[1]]
    for (function, given), work in zip((("measure_point", tasks), ("measure_block", blocks)), asked, strict=True):
        assert [(w.label, w.task) for w in work] == given and {w.target for w in work} == {Target()}
        assert {(w.function, w.method) for w in work} == {(f"fluidbench.study.points:{function}", "mpm")}


@pytest.mark.parametrize(
    ("verdict", "block", "fine"),
    [
        ("held", {}, True),
        ("refused", {}, True),
        ("failed", {}, False),
        ("error", {}, False),
        ("held", {"reason": "it died"}, False),
    ],
)
def test_a_study_of_stability_ends_well_when_all_holds_or_is_refused(tmp_path, monkeypatch, verdict, block, fine):
    def answer(work):
        if "kind" in work.task:
            whole = block or {"dt_limit_s": 1.0, "dt_own_s": 1.0, "dt_theory_s": 1.0}
            return {"kind": work.task["kind"], "method": work.method, **whole}
        return {"axis": work.task["axis"], "value": work.task["value"], "method": work.method, "verdict": verdict}

    calls = working(monkeypatch, answer)
    made = stability.stability(BEAD, ["mpm"], axes=["density"], quick=True, out=tmp_path, progress=False, wall_limit=7)
    assert {work.limit for call in calls for work in call} == {7}
    assert made.ok is fine and (len(made.points), len(made.blocks), len(made.table)) == (3, 3, 6)
    assert [(len(call), call.workers) for call in calls] == [(3, 2), (3, 2)] and made.runs == []


@pytest.mark.parametrize(
    ("verdict", "error", "fine", "missing"),
    [
        ("completed", 0.0, True, []),
        ("completed", 0.5, False, []),
        ("diverged", 0.0, False, []),
        ("timeout", 0.0, False, ["own, mpm, d = 10 mm: timeout: too slow"]),
    ],
)
def test_a_study_of_stability_rests_on_the_cases_of_a_methods_own_numerics(
    tmp_path, monkeypatch, verdict, error, fine, missing
):
    own = case("own", "numerics", about="mpm", scenarios=lambda d: {"": scenario(spacing=d)})
    own = replace(own, evaluate=lambda runs: Finding(error, (Number("kappa [-]", 1.0, 1.0),)))
    monkeypatch.setattr(stability, "cases", lambda: {"own": own, "other": replace(own, name="other", about="sph")})

    def run(trials, place, title):
        for trial in trials:
            trial.runs = {"": finished(trial.method, verdict, reason="too slow")}
            evaluate(trial)

    def answer(work):
        whole = {"dt_limit_s": 1.0, "dt_own_s": 1.0, "dt_theory_s": 1.0}
        return {"axis": "", "value": 0.0, "method": work.method, "verdict": "held"} | work.task | whole

    monkeypatch.setattr(stability, "run", run)
    working(monkeypatch, answer)
    made = stability.stability(BEAD, ["mpm"], axes=["density"], quick=True, out=tmp_path, progress=False)
    assert (made.ok, made.missing, len(made.runs)) == (fine, missing, 1)


def test_a_block_is_measured_bare(monkeypatch):
    asked = []

    def block_limit(s, solver, config, own, precision, target):
        asked.append((s, config, own, precision))
        return Limit(0.04, 0.09)

    monkeypatch.setattr(limits, "block_limit", block_limit)
    for label, task in block_tasks(["mpm", "sph"], True, Target()):
        row, (s, config, own, precision) = measure_block(task), asked[-1]
        solver = get_method(task["method"])
        assert config == solver.Config(**get_method(task["method"]).bare) and (s.spacing, precision) == (0.01, 0.1), (
            label
        )
        assert row["dt_limit_s"] == pytest.approx(0.06) and row["dt_own_s"] == own == default_dt(s, solver, config)[0]
        assert row["dt_theory_s"] == get_method(task["method"]).theory(s, config) and row["kind"] == task["kind"]


def test_findings_count_and_compare():
    blocks = [
        {"kind": "acoustic", "method": "mpm", "dt_limit_s": 3.0, "dt_theory_s": 4.0, "dt_own_s": 1.5},
        {"kind": "viscous", "method": "sph", "reason": "it died"},
    ]
    points = [
        {"axis": "density", "method": "mpm", "value": v, "verdict": w, "reason": r, "dt_own_s": dt, "binding": "b"}
        for v, w, r, dt in ((1.0, "held", "", 4.0), (2.0, "failed", "boom", 1.0), (3.0, "held", "", 2.0))
    ]
    points += [
        {"axis": "spacing", "method": "sph", "value": 1.0, "verdict": "refused", "reason": "no"},
        {"axis": "spacing", "method": "mpm", "value": 1.0, "verdict": "held", "reason": "", "dt_own_s": 3.0},
        {"axis": "spacing", "method": "mpm", "value": 2.0, "verdict": "held", "reason": "", "dt_own_s": 4.4},
    ]
    assert findings(points, blocks) == [
        "mpm, acoustic block: stable up to dt = 3 s, 0.75 of theory; the method's own bound is 0.50 of what was "
        "measured.",
        "sph, viscous block: error: it died.",
        "Default steps: 6 points tried, 4 held, 1 refused, 1 failed.",
        "mpm: density narrows the step 4-fold, from 4 s at 1 to 1 s at 2 (bound: b).",
        "mpm: spacing from 1 to 2 leaves the step as it is.",
        "mpm, density = 2: failed: boom.",
        "sph, spacing = 1: refused: no.",
    ]
    points[-1] |= {"dt_own_s": 4.5}
    points[-2] |= {"binding": "c"}
    points[3]["verdict"] = "error"
    lines = findings(points, [])
    assert lines[0] == "Default steps: 6 points tried, 4 held, 0 refused, 1 failed, 1 could not be measured."
    assert "mpm: spacing narrows the step 1.5-fold, from 4.5 s at 2 to 3 s at 1 (bound: c)." in lines
