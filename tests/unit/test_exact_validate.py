"""Known answers as they are planned, limited, judged and published, by hand."""

import math
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from fluidbench.errors import UserError
from fluidbench.files import write_parquet
from fluidbench.method.target import Target
from fluidbench.method.verdict import Evidence
from fluidbench.report.progress import Display
from fluidbench.study import trials, workplace
from fluidbench.study import validate as module
from fluidbench.study.case import Finding, case_in, cases, select
from fluidbench.study.trials import LEVELS, Trial, evaluate, evaluate_law, orders, plan, tidy

from ..conftest import scenario
from .made import case, change, finished, trial, workplace_in

LIMITED = case(tolerance=0.1, fine_tolerance=0.02, tolerances={"sph": 0.3})


@pytest.mark.parametrize(
    ("method", "factor", "limit"),
    [
        ("mpm", 1.0, 0.1),
        ("mpm", 1.5, 0.15),
        ("mpm", 2.0, 0.2),
        ("mpm", 2 / 3, 0.1),
        ("mpm", 0.51, 0.1),
        ("mpm", 0.5, 0.02),
        ("mpm", 0.25, 0.02),
        ("sph", 0.5, 0.3),
        ("sph", 1.0, 0.3),
        ("sph", 1.5, 0.45),
    ],
)
def test_a_tolerance_grows_with_the_spacing_and_has_a_fine_end(method, factor, limit):
    assert LIMITED.limit(method, factor) == pytest.approx(limit)
    assert trial(LIMITED, method, spacing=factor * LIMITED.spacing).tolerance == pytest.approx(limit)
    assert case(tolerance=0.1).limit("mpm", 0.5) == 0.1


def test_levels_are_factors_on_the_coarse_spacing():
    assert {"rough": 1.5, "coarse": 1.0, "medium": pytest.approx(2 / 3), "fine": 0.5} == LEVELS


def test_a_trial_says_what_it_is_evidence_of():
    of = case()
    states = {
        "pass": Evidence.RESULT,
        "MISS": Evidence.RESULT,
        "diverged": Evidence.INSTABILITY,
        "error": Evidence.NOTHING,
        "skipped": Evidence.NOTHING,
    }
    assert {v: trial(of, "mpm", verdict=v).evidence for v in states} == states
    assert not trial(of, "mpm", verdict="skipped").judged and trial(of, "mpm", verdict="error").judged
    assert trial(of, "mpm", 0.25).error == 0.25 and math.isnan(trial(of, "mpm", verdict="error").error)
    assert trial(of, "mpm", spacing=0.0123).name == "any, mpm, d = 12.3 mm"


def scenarios(spacing):
    return {"a": scenario(spacing=spacing), "b": scenario(spacing=spacing, seed=1)}


def test_trials_are_planned_at_every_level():
    full = case(scenarios=scenarios, quick=0.02, skipped={"pbd": "why not"}, exempt={"sph": "not expected"})
    made = plan([full], ["mpm", "sph", "pbd"], ["coarse", "medium"], False, Target(), 5.0)
    assert [(t.method, t.level, t.spacing) for t in made] == [
        (m, level, pytest.approx(d))
        for level, d in (("coarse", 0.01), ("medium", 0.01 / 1.5))
        for m in ("mpm", "sph", "pbd")
    ]
    assert (made[2].verdict, made[2].note, made[2].jobs) == ("skipped", "why not", {})
    first = made[0].jobs
    assert list(first) == ["a", "b"] and first["b"].scenario["seed"] == 1 and first["a"].keep_frames
    assert first["a"].wall_limit == 5.0 and first["a"].scenario["spacing"] == pytest.approx(0.01)
    (quick,) = plan([full, case("c", scenarios=scenarios)], ["mpm", "sph", "pbd"], ["coarse"], True, Target(), None)
    assert (quick.method, quick.level, quick.spacing) == ("mpm", "quick", 0.02)
    law = case("law", drive=lambda dt: Finding(dt), quick=0.5)
    (driven,) = plan([law], ["mpm", "sph"], ["coarse"], False, Target(), None)
    assert (driven.method, driven.spacing, driven.jobs) == ("law", 0.01, {})
    assert plan([law], ["mpm"], ["coarse"], True, Target(), None)[0].spacing == 0.5


def judged(error, of=LIMITED, method="mpm"):
    made = trial(of, method, error)
    trials._judge(made)
    return made.verdict, made.note


def test_an_answer_passes_is_exempt_or_misses_with_its_cause():
    assert judged(0.1) == ("pass", "") and judged(0.100001) == ("MISS", "no cause known")
    told = case(exempt={"sph": "not expected"}, causes={"mpm": "the grid"})
    assert judged(0.2, told) == ("MISS", "the grid") and judged(0.2, told, "sph") == ("exempt", "not expected")
    assert judged(0.1, told, "sph") == ("pass", "") and judged(math.nan, told) == ("MISS", "the grid")


def ended(*runs, of=None):
    made = Trial(of or case(evaluate=lambda found: Finding(len(found) / 100)), "mpm", "coarse", 0.01)
    made.runs = {str(i): r for i, r in enumerate(runs)}
    made.jobs = dict.fromkeys(made.runs)
    return made


def whole(tmp_path, **cost):
    made = finished(input=scenario().model_dump(mode="json"), folder=tmp_path)
    return change(made, {"simulated_s": 2.0, "substeps": 5, "peak_particles": 7, "wall_s": 3.0, "cpu_s": 4.0} | cost)


def test_a_trial_sums_what_its_runs_cost(tmp_path):
    made = ended(whole(tmp_path), whole(tmp_path, peak_particles=9, simulated_s=1.0, wall_s=6.0))
    evaluate(made)
    assert (made.verdict, made.error) == ("pass", 0.02)
    assert made.cost == {"particles": 9, "substeps": 10, "wall_s": 9.0, "cpu_s": 8.0, "wall_per_simulated_s": 3.0}


def test_a_failed_run_fails_its_trial_and_a_crash_goes_before_a_blow_up(tmp_path):
    blown, crashed = finished(verdict="diverged", reason="x"), finished(verdict="error", reason="y")
    for runs, verdict in (
        ((whole(tmp_path), blown), "diverged"),
        ((blown, crashed), "error"),
        ((crashed, blown), "error"),
    ):
        made = ended(*runs)
        evaluate(made)
        assert (made.verdict, made.note) == (verdict, {"diverged": "x", "error": "y"}[verdict]) and made.finding is None
        assert made.cost == {"particles": 7 if runs[0].ok else 0}  # what it took is no cost


def test_an_evaluation_that_fails_is_an_error_of_its_own(tmp_path):
    made = ended(whole(tmp_path), of=case(evaluate=lambda found: 1 / 0))
    evaluate(made)
    assert made.verdict == "error" and made.note == "its evaluation failed: ZeroDivisionError: division by zero"


def test_a_law_is_driven_at_its_step():
    made = Trial(case(drive=lambda dt: Finding(3 * dt)), "law", "coarse", 0.01)
    evaluate_law(made)
    assert (made.verdict, made.error, made.cost["particles"]) == ("pass", 0.03, 1) and made.cost["wall_s"] >= 0


def test_a_run_shows_its_frames_in_order_of_time(tmp_path):
    for i, t in enumerate((0.0, 0.5, 2.0)):
        np.savez(tmp_path / f"frame_{i:04d}.npz", time=t, mass=np.array([i]))
    made = whole(tmp_path, mean_dt_s=0.25)
    change(made, files={path.name: "" for path in tmp_path.glob("frame_*")})
    np.savez(tmp_path / "frame_0009.npz", time=9.0, mass=np.array([9]))  # of an earlier attempt: not of this record
    run = made
    assert run.times.tolist() == [0.0, 0.5, 2.0] and run.dt == 0.25 and run.method == "mpm"
    assert [int(run.near(t)["mass"][0]) for t in (0.2, 0.3, 1.2, 1.3, 9.0, -1.0)] == [0, 1, 1, 2, 2, 0]
    assert run.scenario == scenario()
    write_parquet(tmp_path / "series.parquet", pd.DataFrame({"time_s": [0.0, 0.5], "top_m": [3.0, 2.0]}))
    assert run.series["top_m"].tolist() == [3.0, 2.0]


def test_cases_are_chosen_by_name_in_order_of_physics():
    assert [c.name for c in select(["slump_slip", "free_fall"])] == ["slump_slip", "free_fall"]
    assert select([]) == list(cases().values())
    order = list(dict.fromkeys(c.physics for c in cases().values()))
    assert order == [
        p
        for p in (
            "kinematics",
            "emission",
            "liquid",
            "viscous",
            "yield stress",
            "elastic",
            "viscoelastic",
            "process",
            "numerics",
        )
        if p in order
    ]


def test_orders_are_of_every_case_and_method_with_two_spacings():
    a, b = case("a"), case("b")
    rows = [trial(a, "mpm", 0.4 * h**1.5, spacing=h) for h in (1.0, 0.5, 0.25)]
    rows += [trial(a, "sph", e, spacing=h) for h, e in ((1.0, 0.2), (0.5, 0.1))]
    rows += [
        trial(b, "mpm", 0.1),
        trial(a, "pbd", 0.0, spacing=1.0),
        trial(a, "pbd", 0.1, spacing=0.5),
        trial(b, "sph", verdict="error"),
    ]
    assert orders(rows) == {("a", "mpm"): (pytest.approx(1.5), 3), ("a", "sph"): (pytest.approx(1.0), 2)}
    table = tidy(rows).to_dict("records")
    assert table[0] | {"order": 1.5} == table[0] | {
        "case": "a",
        "physics": "liquid",
        "method": "mpm",
        "level": "coarse",
        "spacing_m": 1.0,
        "error": 0.4,
        "tolerance": pytest.approx(10.0),
        "order": 1.5,
        "order_spacings": 3,
        "verdict": "pass",
        "wall_s": 1.0,
    }
    assert table[0]["order"] == pytest.approx(1.5)
    assert math.isnan(table[5]["order"]) and table[5]["order_spacings"] == 1


def test_a_trial_is_judged_with_its_last_run(tmp_path, monkeypatch):
    """Two trials of two runs each, in the order in which their runs end; laws at once."""
    of = case(evaluate=lambda found: Finding(0.01 * len(found)), scenarios=scenarios)
    rows = plan([of], ["mpm", "sph"], ["coarse"], False, Target(), 5.0)
    law = case("law", drive=lambda dt: Finding(3 * dt))
    rows += [*plan([law], [], ["coarse"], False, Target(), None), trial(of, "pbd", verdict="skipped")]
    rows[-1].runs = {}
    told = []

    def execute(jobs, store, hooks, workers, executor, gpus=()):
        assert [(j.method, j.scenario["seed"]) for j in jobs] == [(m, s) for m in ("mpm", "sph") for s in (0, 1)]
        assert workers == 3 and rows[2].verdict == "pass"
        for i in (1, 2, 0, 3):
            hooks.started(i, jobs[i], False)
            hooks.progress(i, {"time": 0.5, "until": 1.0, "speed": 1.0})
            hooks.ended(i, whole(tmp_path))
            told.append((i, *(t.verdict for t in rows)))
        return []

    monkeypatch.setattr(workplace, "execute", execute)
    console = Console(file=StringIO(), width=200)
    monkeypatch.setattr(workplace, "Display", lambda *words, **more: Display(*words, **more, console=console))
    trials.run(rows, workplace_in(tmp_path, 3))
    assert told == [
        (1, "", "", "pass", "skipped"),
        (2, "", "", "pass", "skipped"),
        (0, "pass", "", "pass", "skipped"),
        (3, "pass", "pass", "pass", "skipped"),
    ]
    lines = console.file.getvalue().splitlines()
    assert [line.split()[:2] for line in lines] == [["any", "mpm"], ["any", "sph"]]  # each with its last run
    assert [t.error for t in rows[:3]] == [0.02, 0.02, 0.03] and rows[2].cost["wall_s"] < 60.0
    assert [list(t.runs) for t in rows[:2]] == [["b", "a"], ["a", "b"]]


@pytest.mark.parametrize(
    ("verdict", "fine"), [("pass", True), ("exempt", True), ("skipped", True), ("MISS", False), ("error", False)]
)
def test_a_validation_ends_well_when_nothing_missed(verdict, fine, tmp_path):
    rows = [trial(case(), "mpm"), trial(case(), "sph", verdict=verdict)]
    for run in (run for t in rows for run in t.runs.values()):
        object.__setattr__(run, "folder", tmp_path / "runs" / "x")
    made = module.result_of(rows, workplace_in(tmp_path))
    assert made.ok is fine and made.trials is rows and len(made.table) == 2
    assert made.runs == [run for t in rows for run in t.runs.values()] and made.root == tmp_path


def test_a_case_about_one_method_skips_the_others():
    of = case(scenarios=scenarios, quick=0.02, about="sph", skipped={"sph": "too slow"}, exempt={"pbd": "why"})
    words = "the case measures the numerics of sph"
    assert [of.skips(m) for m in ("mpm", "sph", "pbd")] == [words, "too slow", words]
    own = case(scenarios=scenarios, quick=0.02, about="mpm")
    made = plan([own], ["mpm", "sph"], ["coarse"], False, Target(), None)
    assert [(t.verdict, t.note, len(t.jobs)) for t in made] == [
        ("", "", 2),
        ("skipped", "the case measures the numerics of mpm", 0),
    ]
    assert [t.method for t in plan([own], ["mpm", "sph"], ["coarse"], True, Target(), None)] == ["mpm"]
    assert case(skipped={"pbd": "no"}).skips("pbd") == "no" and case().skips("pbd") == ""


MINE = """
from fluidbench.study.case import Case, Finding

CASE = Case("mine", "my own", "liquid", "a book", "relative", 0.01, 0.1, drive=lambda dt: Finding(dt))
"""


def test_a_case_may_be_an_object_or_a_file_of_the_users(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    own = case("own", drive=lambda dt: Finding(dt))
    found = select([own, tmp_path / "mine.py", str(tmp_path / "mine.py"), "free_fall"])
    assert found[0] is own and [c.name for c in found] == ["own", "mine", "mine", "free_fall"]
    assert case_in(tmp_path / "mine.py").drive(0.5).error == 0.5
    made = module.validate([tmp_path / "mine.py"], ["mpm"], out=tmp_path / "out", progress=False)
    assert [(t.method, t.verdict, t.error) for t in made.trials] == [("law", "pass", 0.01)] and made.ok
    with pytest.raises(UserError, match="no case named 'free_fal'; did you mean 'free_fall'"):
        select(["free_fal"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, r"mine\.py: no such case: No such file or directory"),
        ("1 / 0", r"mine\.py: it cannot be run: ZeroDivisionError: division by zero"),
        ("import nothing_of_this_name", r"mine\.py: it cannot be run: ModuleNotFoundError"),
        ("def (", r"mine\.py: it cannot be run: SyntaxError"),
        ("raise ValueError('what')", r"mine\.py: it cannot be run: ValueError: what"),
        ("x = 1", r"mine\.py: it defines no CASE"),
        ("CASE = 5", r"mine\.py: it defines no CASE"),
    ],
)
def test_a_file_that_holds_no_case_says_why(tmp_path, monkeypatch, text, words):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("mine.py").write_text(text)
    with pytest.raises(UserError, match=f"^{words}"):
        select(["mine.py"])


@pytest.mark.parametrize(
    ("finding", "words"),
    [
        (lambda: 0.1, "TypeError: a Finding is wanted, not float"),
        (lambda: Finding(-5.0), "ValueError: an error is a number of 0 or more, not -5.0"),
        (lambda: Finding(math.nan), "ValueError: an error is a number of 0 or more, not nan"),
        (lambda: exit(0), "SystemExit: 0"),
    ],
)
def test_what_is_no_finding_is_an_error_and_never_a_pass(finding, words):
    made = Trial(case(drive=lambda dt: finding()), "law", "coarse", 0.01)
    evaluate_law(made)
    assert made.verdict == "error" and made.note == f"its evaluation failed: {words}" and made.finding is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "it needs scenarios and evaluate, or drive"),
        ({"drive": lambda dt: Finding(dt), "spacing": "x"}, "spacing: a positive number is wanted"),
        ({"drive": lambda dt: Finding(dt), "tolerance": math.nan}, "tolerance: a positive number is wanted"),
        ({"drive": lambda dt: Finding(dt), "physics": "liqid"}, "did you mean 'liquid'"),
        ({"scenarios": lambda d: 1 / 0, "evaluate": lambda r: Finding(0)}, "its scenarios failed: ZeroDivisionError"),
        ({"scenarios": lambda d: {}, "evaluate": lambda r: Finding(0)}, "a table of scenarios by label"),
        ({"scenarios": lambda d: [scenario()], "evaluate": lambda r: Finding(0)}, "a table of scenarios by label"),
    ],
)
def test_what_is_no_case_is_refused_before_anything_runs(change, words, tmp_path):
    with pytest.raises(UserError, match=words):
        module.validate([case("own", **change)], ["mpm"], out=tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()


def test_a_validation_without_a_judged_trial_is_none(tmp_path):
    law = case("own", drive=lambda dt: Finding(dt))
    assert module.validate([law], ["mpm"], levels=(level for level in ["coarse"]), out=tmp_path, progress=False).ok
    assert not module.result_of([], workplace_in(tmp_path)).ok
    with pytest.raises(UserError, match="levels: none is named"):
        module.validate([law], ["mpm"], levels=[], out=tmp_path)
    for nothing in ([], (), iter(())):
        with pytest.raises(UserError, match="cases: none is named"):
            module.validate(nothing, ["mpm"], out=tmp_path)
