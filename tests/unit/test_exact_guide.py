"""What guide says: the choice for each job, machine and tolerance, and what would change it; kept and made again."""

import math

import pytest

from fluidbench.errors import UserError
from fluidbench.report.figures import figure_of
from fluidbench.runs.archive import where
from fluidbench.scenario.measured import Measured
from fluidbench.study.choice import choices, time_of
from fluidbench.study.guide import JOBS, NAME, guide, published, subjects_of, tolerances_of
from fluidbench.study.guide_chart import chart
from fluidbench.study.guide_report import report, sentence
from fluidbench.study.selection import Candidate, Selection, Trust
from fluidbench.study.workplace import cores

from .made import BEAD, change, finished, working


def selection(*rows, trusted=("mpm", "sph")):
    """Candidates (method, spacing [mm], seconds, discretisation, bias)."""
    found = [Candidate(m, 1e-3 * d, 1e-4, t, t, e, b, e, finished(m)) for m, d, t, e, b in rows]
    methods = dict.fromkeys(m for m, *_ in rows)
    limits = {m: {"height_m": 1.0} for m in methods}
    return Selection(found, {m: Trust(m in trusted, 1) for m in methods}, limits, [])


TWO = selection(("mpm", 2, 1.0, 0.05, 0.01), ("mpm", 1, 8.0, 0.02, 0.01), ("sph", 1, 10.0, 0.01, 0.01))


def chosen(found, *tolerances):
    return choices({"CPU": {"bead": found}}, tolerances)


def test_the_cheapest_within_a_tolerance_is_chosen_and_its_rival_named():
    tight, middle, wide = chosen(TWO, 0.01, 0.03, 0.1)
    assert not tight.met and tight.best.error == pytest.approx(0.02)
    assert tight.change == "a tolerance of 2 %"
    falls = [("mpm", d, 1.0, 0.02 * d, 0.0) for d in (1, 2, 4)]
    assert chosen(selection(*falls), 0.01)[0].change == "a finer spacing than was tried, or a tolerance of 2 %"
    biased = [("mpm", d, 1.0, 0.001 * d, 0.1234) for d in (1, 2, 4)]
    assert chosen(selection(*biased), 0.01)[0].change == "a tolerance of 12.5 %"
    assert middle.met and (middle.best.method, middle.best.spacing) == ("mpm", 1e-3)
    assert middle.change == "as good: SPH at 1 mm takes 1.2 times as long"
    assert (wide.best.method, wide.best.spacing) == ("mpm", 2e-3)
    assert wide.change == "SPH at 1 mm takes 10 times as long"


def test_a_choice_says_when_it_rests_on_the_consensus():
    found = selection(("mpm", 2, 5.0, 0.05, 0.0), ("pbd", 2, 1.0, 0.03, 0.2))
    (one,) = chosen(found, 0.1)
    assert one.best.method == "mpm" and one.confidence == "low"
    assert one.change == (
        "PBD at 2 mm is 23% off; PBD at 2 mm in 1 s, if its own limit is the right one (20% from the consensus)"
    )
    assert chosen(selection(("mpm", 2, 5.0, 0.05, 0.0)), 0.1)[0].change == "no other method was judged"


def test_what_nothing_was_judged_for_has_no_choice():
    (one,) = chosen(Selection([], {}, {}, []), 0.1)
    assert one.best is None and not one.met and one.change == "" and one.confidence == "low"
    studies = {"CPU": {"bead": Selection([], {}, {}, [])}}
    assert sentence(studies, [one], "bead") == "bead: CPU: no choice (no method completed at three spacings) at 10 %"
    assert chart([one])[:4] == b"\x89PNG"


def test_a_sentence_puts_together_what_is_the_same():
    studies = {"CPU": {"bead": TWO}, "GPU": {"bead": TWO}, "TPU": {"bead": selection(("mpm", 2, 1.0, 0.0, 0.0))}}
    found = choices(studies, [0.03, 0.04, 0.1])
    assert sentence(studies, found, "bead") == (
        "bead: CPU, GPU: MPM at 2 mm at 10 %, MPM at 1 mm at 4 % and 3 %; TPU: MPM at 2 mm at 10 % and 4 % and 3 %"
    )


def test_times_read_in_their_unit():
    assert [time_of(t) for t in (0.123, 45.0, 119.0, 120.0, 7199.0, 7200.0)] == (
        ["0.12 s", "45 s", "119 s", "2 min", "120 min", "2 h"]
    )


def test_nothing_of_a_chart_is_cut(monkeypatch):
    """However many jobs and machines, every text lies within the picture."""
    from fluidbench.study import guide_chart

    seen = []
    monkeypatch.setattr(guide_chart, "figure_of", lambda *size: seen.append(figure_of(*size)) or seen[-1])
    for machines, jobs in ((1, 1), (1, 5), (2, 5)):
        studies = {f"machine {m}": {f"a job of kind {j}": TWO for j in range(jobs)} for m in range(machines)}
        chart(choices(studies, [0.02, 0.05, 0.1]))
        seen[-1].draw_without_rendering()
        box, (axes,) = seen[-1].bbox, seen[-1].axes
        for text in (*axes.texts, *axes.get_yticklabels()):
            own = text.get_window_extent()
            assert own.x0 >= box.x0 and own.x1 <= box.x1 and own.y0 >= box.y0 and own.y1 <= box.y1, text


def test_jobs_are_named_by_their_scenarios():
    assert list(subjects_of(None, False)) == list(JOBS)
    assert list(subjects_of([BEAD, "honey_line"], False)) == ["paste bead", "honey"]
    with pytest.raises(UserError, match="paste bead is named twice"):
        subjects_of([BEAD, "line_bead"], False)


def test_the_chosen_machine_is_named_where_nothing_was_run():
    assert where([finished(device="cuda:0", verdict="refused"), finished(machine={"device": "H200"})]) == "H200"
    assert where([finished(machine={"device": "NVIDIA H100 80GB HBM3"})]) == "NVIDIA H100"
    assert where([finished(device="cuda:0", verdict="refused")]) == "cuda:0" and where([]) == "CPU"


def answer(job):
    d, m = job.scenario["spacing"], job.method
    more = {"input": job.scenario, "cpu_s": d**-4}
    return finished(m, measures={"bead_width_m": 0.01 + (0.1 if m == "mpm" else 0.5) * d}, spacing=d, **more)


def test_a_guide_is_made_again_from_what_it_keeps(tmp_path, monkeypatch):
    calls = working(monkeypatch, answer)
    made = guide([BEAD], ["mpm", "sph"], tolerances=[0.2, 0.01], out=tmp_path / "a", progress=False)
    assert [call.workers for call in calls] == [cores()] and made.ok and len(made.runs) == 8
    assert made.table.tolerance.tolist() == [0.01, 0.2] and made.table.met.tolist() == [False, True]
    for i, run in enumerate(made.runs):
        object.__setattr__(run, "folder", tmp_path / "a" / "runs" / str(i))
    made.studies["CPU"]["paste bead"].untried.append("pbd: left out")
    assert "CPU: pbd: left out." not in made.report.files["guide.md"]
    told = report(made.studies, [0.01, 0.2], tmp_path / "a").files["guide.md"]
    made.keep(tmp_path / "a")
    again = published(tmp_path, [0.2, 0.01], tmp_path / "b")
    assert again.report.files["guide.md"] == told and "CPU: pbd: left out." in told and again.table.equals(made.table)
    assert again.save().exists() and not (tmp_path / "b" / f"{NAME}.json").exists()
    again.keep(tmp_path / "c")
    with pytest.raises(UserError, match="a second study of CPU"):
        published(tmp_path)
    (tmp_path / "c" / f"{NAME}.json").write_text("{}")
    with pytest.raises(UserError, match="is not as it was written"):
        published(tmp_path / "c")
    with pytest.raises(UserError, match=r"no selections\.json"):
        published(tmp_path / "b")


def keep_as(machine, made, folder):
    """Keep a study as one that was made on a machine, in a folder."""
    for i, run in enumerate(made.runs):
        change(run, machine={"device": machine})
        object.__setattr__(run, "folder", folder / "runs" / str(i))
    made.keep(folder)


def test_runs_that_ended_badly_are_kept_too_and_said(tmp_path, monkeypatch):
    """The first of all refused, the finest too slow: neither has a scenario of its own."""

    def broken(job):
        verdict = {3e-3: "refused", 1.125e-3: "timeout"}.get(round(job.scenario["spacing"], 9))
        return finished(job.method, verdict, spacing=job.scenario["spacing"]) if verdict else answer(job)

    working(monkeypatch, broken)
    made = guide([BEAD], ["mpm"], tolerances=[0.1], out=tmp_path / "a", progress=False)
    assert not made.ok and len(made.missing) == 1 and made.report.failures == made.missing
    keep_as("GPU", made, tmp_path / "a")
    again = published(tmp_path, [0.1])
    assert not again.ok and again.missing == made.missing and made.missing[0] in again.report.files["guide.md"]
    assert again.report.details[0].lines == [line.replace("CPU", "GPU") for line in made.report.details[0].lines]


def test_studies_of_other_scenarios_are_not_put_side_by_side(tmp_path, monkeypatch):
    working(monkeypatch, answer)
    keep_as("CPU", guide([BEAD], ["mpm"], out=tmp_path / "a", progress=False), tmp_path / "a")
    other = BEAD.model_copy(update={"duration": 9.0})
    keep_as("GPU", guide([other], ["mpm"], out=tmp_path / "b", progress=False), tmp_path / "b")
    with pytest.raises(UserError, match="paste bead is another scenario than elsewhere"):
        published(tmp_path)


def test_what_was_measured_counts(tmp_path, monkeypatch):
    working(monkeypatch, answer)
    wide = BEAD.model_copy(update={"measured": (Measured(quantity="width", value=0.02),)})
    made = guide([wide], ["mpm"], tolerances=[0.1], out=tmp_path, progress=False)
    assert not made.table.met.any() and made.table.error.iloc[0] == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("given", [[], [math.nan], [0.0], ["5 mm"], "five", None, [0.05, -1.0], [5]])
def test_tolerances_are_shares_above_nothing(given, tmp_path):
    for call in (lambda: guide([BEAD], tolerances=given, out=tmp_path), lambda: published(tmp_path, given)):
        with pytest.raises(UserError, match="tolerance"):
            call()


def test_no_scenario_is_not_every_job(tmp_path):
    with pytest.raises(UserError, match="scenarios: none is named"):
        guide([], out=tmp_path)


def test_a_tolerance_named_twice_is_one():
    assert tolerances_of([0.05, 0.02, 0.05]) == [0.02, 0.05] and tolerances_of(0.1) == [0.1]
    assert tolerances_of("5%") == [0.05] and tolerances_of(["10%", 0.02]) == [0.02, 0.1]
