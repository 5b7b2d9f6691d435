"""What a verdict may rest on: runs that say something of their method, whole, of this code and of this machine."""

import json
import math

import pytest

from fluidbench.method.verdict import Evidence as Weight
from fluidbench.method.verdict import Verdict, evidence_of, lacking
from fluidbench.paper.cells import figures
from fluidbench.paper.claims import claims
from fluidbench.paper.definitions import CONFIRMED, METHODS, OPEN, REFUTED
from fluidbench.paper.evidence import Evidence
from fluidbench.paper.judged import cells, fidelity
from fluidbench.paper.rows import Row
from fluidbench.paper.rows import claims as claims2
from fluidbench.paper.verdicts import answers_of, at_equal_error, told, winners, within
from fluidbench.runs import execute as execution
from fluidbench.runs import job as job_module
from fluidbench.runs import provenance
from fluidbench.runs.execute import Hooks, execute
from fluidbench.runs.job import Job
from fluidbench.runs.record import Record, keep
from fluidbench.runs.store import Store, read_record, write_record
from fluidbench.scenario.library import load
from fluidbench.study import selection
from fluidbench.study.case import Finding, cases
from fluidbench.study.remarks import unconverged
from fluidbench.study.select_report import _further
from fluidbench.study.selection import Candidate, Selection, Trust, assess, confidence
from fluidbench.study.trials import Trial

from .made import finished

SAYS = {
    "completed": Weight.RESULT,
    "diverged": Weight.INSTABILITY,
    "error": Weight.NOTHING,
    "timeout": Weight.NOTHING,
    "out_of_capacity": Weight.NOTHING,
    "refused": Weight.NOTHING,
}


def test_every_verdict_is_evidence_of_one_thing():
    assert {str(v): evidence_of(v) for v in Verdict} == SAYS
    with pytest.raises(ValueError, match="sound"):
        evidence_of("sound")


def trial(case, method, verdict="pass", error=0.0, wall=1.0, spacing=1.0):
    made = Trial(cases()[case], method, "coarse", spacing * cases()[case].spacing, verdict=verdict)
    if verdict in ("pass", "MISS"):
        made.finding, made.cost = Finding(error), {"wall_s": wall}
    return made


def test_what_says_nothing_is_not_judged_and_what_blew_up_is_not_within():
    liquid = ["elliptic_drop", "dam_break", "hydrostatic_column"]
    for verdict, expected in (("error", (2, 2)), ("timeout", (2, 2)), ("refused", (2, 2)), ("diverged", (2, 3))):
        trials = [trial(liquid[0], "sph"), trial(liquid[1], "sph"), trial(liquid[2], "sph", verdict)]
        assert within(answers_of(trials, ["sph"], ["liquid"])) == expected
        assert told(trials) == (verdict == "diverged")


def test_no_verdict_rests_on_runs_that_crashed():
    """104 runs that all ended in error were once 8 confirmed and 5 refuted."""
    broken = {m: [finished(m, "error", reason="ImportError", repeat=r) for r in range(3)] for m in METHODS}
    trials = [trial(name, m, "error") for name in cases() if cases()[name].drive is None for m in METHODS]
    for t in trials:
        t.runs = {"a": finished(t.method, "error", reason="ImportError")}
    points = {
        m: [{"axis": "spacing", "value": 1.0, "method": m, "verdict": "error", "reason": "it died"}] * 2
        for m in METHODS
    }
    e = Evidence(load("line_bead"), trials, broken, {m: broken[m][:1] for m in METHODS}, limits=points, other=broken)
    assert {cell.verdict for cell in cells(e)} == {OPEN}
    missing = e.missing()
    assert any("ImportError" in line for line in missing) and any("it died" in line for line in missing)


def test_one_crash_among_known_answers_leaves_their_verdicts_open():
    liquid = [name for name, case in cases().items() if case.physics == "liquid"]
    good = [trial(name, "sph") for name in liquid]
    runs = {m: [finished(m, repeat=r) for r in range(2)] for m in METHODS}

    def verdict(trials):
        e = Evidence(load("line_bead"), trials, runs, {m: runs[m][:1] for m in METHODS})
        (cell,) = [c for c in fidelity(e) if c.method == "sph" and c.aspect == "liquids"]
        return cell.verdict

    assert verdict(good) == CONFIRMED
    assert verdict([*good[:-1], trial(liquid[-1], "sph", "error")]) == OPEN
    assert verdict([trial(name, "sph", "diverged") for name in liquid]) == REFUTED


def test_a_prediction_needs_answers_not_crashes():
    names = ("slump_cylinder", "self_weight_column", "cantilever_sag", "viscous_column_slip")
    runs = {m: [finished(m, repeat=r) for r in range(2)] for m in METHODS}

    def verdict(state):
        e = Evidence(
            load("line_bead"), [trial(n, "pbd", state, 9.9) for n in names], runs, {m: runs[m][:1] for m in METHODS}
        )
        (cell,) = [c for c in claims(e) if c.paper == "cannot predict deformation under load"]
        return cell.verdict

    assert verdict("MISS") == CONFIRMED and verdict("diverged") == CONFIRMED
    assert verdict("error") == OPEN and verdict("timeout") == OPEN


def test_costs_are_of_complete_sets_of_repeats():
    runs = {"mpm": [finished(), finished(repeat=1)], "sph": [finished("sph"), finished("sph", "timeout", repeat=1)]}
    assert figures(runs, "wall_s") == {"mpm": [1.0, 1.0]}


def test_a_case_that_one_method_could_not_run_has_no_winner():
    own = [trial("elliptic_drop", "mpm", wall=2.0), trial("elliptic_drop", "sph", wall=1.0)]
    assert winners(own, ["liquid"]) == {"sph": 1}
    assert winners([own[0], trial("elliptic_drop", "sph", "error")], ["liquid"]) == {}
    assert winners([own[0], trial("elliptic_drop", "sph", "diverged")], ["liquid"]) == {"mpm": 1}


def test_cost_at_equal_error_needs_every_run():
    trials = [trial("elliptic_drop", m, "MISS", k * h, h**-4, h) for m, k in (("mpm", 1), ("sph", 4)) for h in (1, 0.5)]
    assert set(at_equal_error(trials)) == {"mpm", "sph"}
    assert at_equal_error([*trials, trial("elliptic_drop", "pbd", "error")]) == {}


def test_claims_of_table_2_need_every_repeat():
    def rows(bad):
        variants = {"plain": 100.0, "curing": 90.0, "expansion": 30.0}
        made = []
        for name, speed in variants.items():
            bare = [finished(steps_per_s=speed), finished(steps_per_s=speed, repeat=1)]
            bare[1] = finished(verdict="error", reason="x", repeat=1) if name == bad else bare[1]
            made.append(Row(name, None, "mpm", bare, []))
        return made

    words = "curing a modest overhead, expansion a stronger one"
    assert (("mpm", words) in {c[:2] for c in claims2(rows(""))}) and rows("")[0].missing() == []
    assert words not in {c[1] for c in claims2(rows("plain"))}
    assert rows("plain")[0].missing() == ["line_bead, mpm, d = 1 mm: error: x"]


def test_what_is_lacking_is_named_once_with_its_reason():
    slow = [finished("sph", "timeout", reason="too slow", repeat=r) for r in range(2)]
    runs = [finished(), *slow, finished("pbd", "refused", reason="no")]
    assert lacking(runs) == ["line_bead, sph, d = 1 mm: timeout: too slow", "line_bead, pbd, d = 1 mm: refused: no"]
    assert lacking(runs, refusals=False) == ["line_bead, sph, d = 1 mm: timeout: too slow"]


# --- what is stored


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """A store, a job, and how often it was really run, with a child that does nothing."""
    made = []

    def launch(job, folder, progress=None, gpu=""):
        made.append(job)
        (folder / "final.npz").write_bytes(b"particles")
        frames = [folder / "frame_0000.npz"] if job.keep_frames else []
        for path in frames:
            path.write_bytes(b"frame")
        about = job_module.hardware(job.target) | {"time": "now"}
        record = Record(
            **job.heading(), verdict="completed", measures={"top_m": 1.0}, film_every=job.film_every, machine=about
        )
        return keep(folder, record, ["final.npz", *(path.name for path in frames)])

    monkeypatch.setattr(execution, "launch", launch)
    notes: list[str] = []

    def call(fresh=False, **changes):
        job = Job(load("line_bead").model_dump(mode="json"), "mpm", **changes)
        nothing = lambda *_: None  # noqa: E731
        before = len(made)
        (result,) = execute([job], Store(tmp_path, fresh), Hooks(nothing, nothing, nothing, notes.append))
        return result, len(made) - before

    return tmp_path, call, notes


def test_a_stored_run_is_reused_only_whole(stored):
    root, call, notes = stored
    assert call()[1] == 1
    again, runs = call()
    assert runs == 0 and again.reused and not notes
    (path,) = root.glob("runs/*/record.json")
    path.write_text(path.read_text().replace('"top_m": 1.0', '"top_m": 2.0'))
    result, runs = call()
    assert runs == 1 and not result.reused and result.record.measures["top_m"] == 1.0
    assert "record.json is not as it was written" in notes[-1]
    (root / path.parent / "final.npz").unlink()
    assert call()[1] == 1 and "final.npz is missing" in notes[-1]
    (root / path.parent / "final.npz").write_bytes(b"particle")
    assert call()[1] == 1 and "final.npz is not as it was written" in notes[-1]
    assert call()[1] == 0


def test_a_stored_run_is_of_this_code_and_this_machine(stored, monkeypatch):
    _, call, notes = stored
    call()
    for place, name, change, words in (
        (job_module, "code", {"sources": "edited"}, "the code"),
        (job_module, "code", {"warp": "9.9"}, "the code"),
        (job_module, "hardware", {"processor": "another"}, "another machine"),
    ):
        real = getattr(provenance, name)
        monkeypatch.setattr(place, name, lambda *a, real=real, change=change: real(*a) | change)
        assert call()[1] == 1 and words in notes[-1]
        assert call()[1] == 0
        monkeypatch.setattr(place, name, real)
        assert call()[1] == 1 and call()[1] == 0


def test_fresh_runs_again_but_each_run_once(stored):
    root, call, _ = stored
    call()
    assert call(fresh=True)[1] == 1
    job = Job(load("line_bead").model_dump(mode="json"), "mpm")
    nothing = lambda *_: None  # noqa: E731
    results = execute([job, job], Store(root, fresh=True), Hooks(nothing, nothing, nothing))
    assert [r.reused for r in results] == [False, False]


def test_frames_are_no_part_of_what_a_run_is(stored):
    root, call, notes = stored
    call()
    assert call(keep_frames=True)[1] == 1 and "snapshots" in notes[-1]
    assert call()[1] == 0 and call(keep_frames=True)[1] == 0
    assert len(list(root.glob("runs/*"))) == 1
    assert call(film_every=0.1)[1] == 1 and "pictures are wanted" in notes[-1]
    assert call()[1] == 1 and "not wanted" in notes[-1]
    assert call(variant="pictures", film_every=0.1)[1] == 1 and len(list(root.glob("runs/*"))) == 2


@pytest.mark.parametrize("verdict", ["error", "timeout"])
def test_what_another_attempt_may_change_is_tried_again(stored, verdict):
    root, call, _ = stored
    call()
    (folder,) = root.glob("runs/*")
    record, _ = read_record(folder)
    write_record(folder, record | {"verdict": verdict})
    assert call()[1] == 1


def test_the_code_of_a_run_is_the_hash_of_its_sources(tmp_path, monkeypatch):
    known = provenance.code("mpm", "warp")
    assert known.keys() == {"sources", "warp"} and provenance.code("mpm", "taichi").keys() == {
        "sources",
        "warp",
        "taichi",
    }
    for name in ("fluidbench", "solvers"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("a = 1\n")
    (tmp_path / "fluidbench" / "report").mkdir()

    class Spec:
        origin = None

        def __init__(self, name):
            self.submodule_search_locations = [str(tmp_path / name)]

    monkeypatch.setattr(provenance, "find_spec", Spec)
    first = provenance._hash_of(("fluidbench", "solvers"), provenance.IDLE)
    (tmp_path / "fluidbench" / "report" / "page.py").write_text("no run enters this\n")
    assert provenance._hash_of(("fluidbench", "solvers"), provenance.IDLE) == first
    (tmp_path / "solvers" / "kernel.py").write_text("b = 2\n")
    second = provenance._hash_of(("fluidbench", "solvers"), provenance.IDLE)
    (tmp_path / "solvers" / "kernel.py").write_text("b = 3\n")
    assert len({first, second, provenance._hash_of(("fluidbench", "solvers"), provenance.IDLE)}) == 3


# --- selection


def record(method, spacing, width):
    wall = spacing**-4
    return finished(method, spacing=spacing, measures={"bead_width_m": width}, wall_s=wall, wall_per_simulated_s=wall)


def tried(method, errors):
    """A selection of one method whose errors at these spacings are known."""
    candidates = [Candidate(method, d, 1e-4, d**-4, d**-4, e, 0.0, e, finished(method)) for d, e in errors.items()]
    return Selection(candidates, {method: Trust(9, 10)}, {method: {"bead_width_m": 0.01}}, [])


def test_an_error_that_does_not_fall_is_not_called_converged():
    """34.7, 25.1, 25.7 % at 9, 6, 4.5 mm: no first order to halve the spacing by."""
    wild = tried("sph", {9e-3: 0.347, 6e-3: 0.251, 4.5e-3: 0.257})
    assert not wild.converges("sph") and "hardly falls" in _further(wild, wild.candidates[0])
    assert "34.7, 25.1, 25.7 % at 9, 6, 4.5 mm" in unconverged(wild, "sph")
    flat = tried("sph", {9e-3: 0.30, 6e-3: 0.29, 4.5e-3: 0.28})
    assert not flat.converges("sph") and not tried("sph", {9e-3: 0.3, 6e-3: 0.1}).converges("sph")
    tame = assess(load("line_bead"), ["sph"], [record("sph", d, 0.010 * (1 + 20 * d)) for d in (9e-3, 6e-3, 4.5e-3)])
    assert tame.converges("sph") and tame.order("sph") == pytest.approx(1.0)
    assert not any("not converged" in note for note in tame.notes)
    assert "order of 1 it takes 0.5 of the spacing, 16 times the work" in _further(tame, tame.candidates[0])


def test_confidence_needs_a_second_witness_that_converges(monkeypatch):
    monkeypatch.setattr(selection, "trust_of", lambda _, methods: {m: Trust(9, 10) for m in methods})

    def runs(method, limit, slope=0.02):
        return [record(method, d, limit * (1 + slope * d)) for d in (1.0, 1.5, 2.0)]

    def sure(*groups, tolerance=0.05):
        methods = [g[0].method for g in groups]
        return confidence(assess(load("line_bead"), methods, [r for g in groups for r in g]), tolerance, None)

    assert sure(runs("mpm", 0.010), runs("sph", 0.0102)).startswith("high")
    assert sure(runs("mpm", 0.010), runs("sph", 0.0102), tolerance=0.01).startswith("medium")
    assert sure(runs("mpm", 0.010)).startswith("low: only mpm")
    assert any("no second witness" in note for note in assess(load("line_bead"), ["mpm"], runs("mpm", 0.010)).notes)
    wild = [record("sph", d, w) for d, w in ((1.0, 0.0128), (1.5, 0.0091), (2.0, 0.0135))]
    assert sure(runs("mpm", 0.010), wild, tolerance=9.0).startswith("low") and "not converged" in sure(
        runs("mpm", 0.010), wild, tolerance=9.0
    )


def test_a_record_that_holds_no_number_is_no_record(tmp_path):
    for text in ("", "[]", "{}", "null", "9" * 50, '{"verdict": "completed"}', json.dumps({"seal": math.nan})):
        (tmp_path / "record.json").write_text(text)
        assert read_record(tmp_path)[0] is None
