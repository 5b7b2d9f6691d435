"""Known answers as they are published: the csv, the markdown, the lines, profiles and work-precision."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from typer import Exit

from fluidbench.cli.app import finish
from fluidbench.errors import Halted, Obstacle
from fluidbench.report.report import write
from fluidbench.study import trials
from fluidbench.study import validate_report as page
from fluidbench.study.case import Curve, Finding, Number
from fluidbench.study.validate import result_of

from .made import case, change, finished, trial, workplace_in

LIMITED = case(tolerance=0.1, fine_tolerance=0.02, tolerances={"sph": 0.3})


def known():
    """A method at two spacings, one that timed out, and a law."""
    of = case("drop", tolerance=0.1, causes={"mpm": "a|b"})
    rows = [
        trial(of, "mpm", 0.0421, wall=3.0),
        trial(of, "mpm", 0.168, wall=1.0, spacing=0.02, verdict="MISS", note="a|b"),
        trial(of, "sph", verdict="timeout", note="slow"),
        trial(case("law", "numerics", drive=lambda dt: None), "law", 1e-7),
    ]
    machine = {
        "time": "2026-01-02T03:04:05",
        "fluidbench": "0.1",
        "warp": "1.9",
        "python": "3",
        "device": "CPU",
        "cores": "2",
    }
    change(rows[0].runs["a"], machine=machine)
    return rows


def test_known_answers_are_published_as_they_were_found():
    lines = page.answers(known()).splitlines()
    assert lines[0].endswith("as OUT/known_answers.csv; 2026-01-02, fluidbench 0.1, CPU.")
    assert lines[1:] == [
        "case,physics,method,spacing_m,particles,error,tolerance,verdict,wall_s,wall_per_simulated_s",
        "drop,liquid,mpm,0.01,10,0.0421,0.1,pass,3,6",
        "drop,liquid,mpm,0.02,10,0.168,0.2,MISS,1,2",
    ]


def test_the_published_table_has_a_row_a_trial():
    text = page.markdown(known())
    assert "2026-01-02, fluidbench 0.1, Warp 1.9, Python 3, CPU (2 cores)." in text
    lines = [line for line in text.splitlines() if line.startswith("|")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert rows[0] == [
        "case",
        "physics",
        "method",
        "spacing [mm]",
        "particles",
        "error",
        "tolerance",
        "order",
        "wall s / sim. s",
        "verdict",
        "measure",
        "source",
    ]
    end = ["relative", "a book"]
    assert rows[2:] == [
        ["drop", "liquid", "mpm", "10", "10", "0.0421", "0.1", "2.00 (2)", "6", "pass", *end],
        ["drop", "liquid", "mpm", "20", "10", "0.168", "0.2", "2.00 (2)", "2", "MISS", *end],
        ["drop", "liquid", "sph", "10", "0", "-", "0.1", "-", "-", "timeout", *end],
        ["law", "numerics", "law", "10", "10", "1e-07", "0.1", "-", "2", "pass", *end],
    ]
    assert "- drop, sph: timeout: slow" in text and "2 pass, 1 MISS, 1 timeout; order:" in text
    escaped = known()
    object.__setattr__(escaped[0].case, "measure", "|x|")
    assert "\\|x\\|" in page.markdown(escaped)


def test_a_line_says_error_tolerance_and_note():
    first, second, third, _ = known()
    assert trials.line(first).split() == ["drop", "mpm", "d", "=", "0.01", "error", "0.0421", "of", "0.1", "pass"]
    assert trials.line(second).endswith("MISS  (a|b)") and "error         - of" in trials.line(third)


def test_results_are_written_with_their_numbers(tmp_path):
    rows = known()[:1]
    rows[0].finding = Finding(0.1, (Number("height", 1.0, 2.0),))
    rows[0].runs = {"a": finished(folder=tmp_path / "runs" / "x")}
    write(page.report(rows, tmp_path), tmp_path)
    for made in (
        json.loads((tmp_path / "validate.json").read_text())["rows"],
        pd.read_parquet(tmp_path / "validate.parquet").to_dict("records"),
    ):
        (row,) = made
        assert json.loads(row["numbers"]) == [{"quantity": "height", "measured": 1.0, "reference": 2.0}]
        assert json.loads(row["runs"]) == {"a": "runs/x"} and row["error"] == 0.1
    assert page._numbers(rows).rows == [["height", "mpm", "10", "1", "2"]]


def test_profiles_are_of_the_finest_and_work_precision_goes_by_cost():
    rows = known()
    for i, t in enumerate(rows[:2]):
        t.finding = Finding(
            t.error,
            (),
            (Curve("u of z", "z", "u", np.array([float(i)]), np.array([9.0]), np.array([5.0]), np.array([6.0])),),
        )
    (plot,) = page.profiles(rows[:3])
    assert [(t.label, list(t.x)) for t in plot.traces] == [("reference", [5.0]), ("mpm", [0.0])]
    (line,) = page.work_precision(rows[:3]).traces
    assert (list(line.x), list(line.y)) == ([1.0, 3.0], [0.168, 0.0421])


def test_a_validation_writes_everything_and_tells_notes(tmp_path, capsys):
    told = []
    quiet = SimpleNamespace(print=lambda *words, **__: told.append(words[0]), width=120)
    rows = known()
    for run in (run for t in rows for run in t.runs.values()):
        object.__setattr__(run, "folder", tmp_path / "runs" / "x")
    rows[0].finding = Finding(0.1, (Number("height of the drop", 1.0, 2.0),))
    made = result_of(rows, workplace_in(tmp_path))
    made.show(quiet)
    assert [w for w in told if isinstance(w, str)][1:] == ["drop mpm: MISS: a|b", "drop sph: timeout: slow"]
    with pytest.raises(Exit) as end:
        finish(made)
    said = capsys.readouterr().out
    assert end.value.exit_code == 1 and said.splitlines()[-1] == f"report: {tmp_path / 'report.html'}"
    assert "drop mpm: MISS: a|b" in said and "drop sph: timeout: slow" in said
    written = {path.name for path in tmp_path.iterdir()}
    assert {
        "validate.parquet",
        "validate.csv",
        "validate.json",
        "validate.md",
        "known_answers.csv",
        "report.html",
    } <= written
    assert (tmp_path / "validate.md").read_text() == page.markdown(rows)
    assert (tmp_path / "known_answers.csv").read_text() == page.answers(rows)
    html = (tmp_path / "report.html").read_text()
    assert html.index('<h2 id="drop"') < html.index("height of the drop") < html.index('<h2 id="law"')
    assert html.count("<h2 id=") == 2 + 1 and html.count('<h2 id="table-') == 1 and "error against cost" in html
    assert '<p class="bad">drop sph: timeout: slow' in html
    assert len(list(tmp_path.glob("*work_precision.png"))) == 1  # of the case, not of the law


@pytest.mark.parametrize(("runs", "kept", "kind"), [([1], False, Halted), ([1], True, Obstacle), ([], False, Obstacle)])
def test_a_report_that_cannot_be_written_leaves_runs_that_can_be_used_again(runs, kept, kind):
    def full():
        raise Obstacle("cannot write report.html: No space left on device")

    with pytest.raises(Obstacle, match="No space left") as met:
        finish(SimpleNamespace(save=full, runs=runs, kept=kept))
    assert type(met.value) is kind


def test_a_validation_of_which_nothing_missed_leaves_without_a_word(tmp_path, capsys):
    rows = [trial(case("law", "numerics", drive=lambda dt: None), "law", 1e-7)]
    rows[0].runs = {}
    finish(result_of(rows, workplace_in(tmp_path)))
    assert capsys.readouterr().err == ""
