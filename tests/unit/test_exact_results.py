"""What a verb returns: kept beside its runs or with them elsewhere, shown, and as long-lived as whoever holds it."""

import gc
import json
import math
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from fluidbench.errors import UserError
from fluidbench.report.page import interactive
from fluidbench.report.plot import COLOURS, LIGHTER, Plot, Trace, colour
from fluidbench.report.report import Image, Report, Section, write
from fluidbench.report.table import Link, Table
from fluidbench.runs.execute import as_executor
from fluidbench.runs.record import Record, Run, keep
from fluidbench.study import compare as module
from fluidbench.study import compare_report
from fluidbench.study.result import Result
from fluidbench.study.workplace import Workplace, as_scenario

from ..conftest import scenario
from .made import BEAD, HEADING, finished, working

LINE = Plot("line", "a line", "x [m]", "y [s]", [Trace("mpm", [1.0, 2.0], [3.0, 4.0], colour="#0072B2")])
POINTS = Plot("points", "points", "x", "y", [Trace("", [1.0], [1.0], "points")], equal=True, log=True)
BARS = Plot("bars", "bars", "", "y", [Trace("a", ["a"], [1.0], "bar")])


def made(root, **more):
    data = pd.DataFrame({"method": ["mpm"], "error": [0.5]})
    table = Table("A <table>", ["", "of"], [["one & two", Link("three", "#there")]], "a note")
    return Report("verb", "a title", "a subtitle", ["found this"], [table], data, [LINE], **more)


def runs_in(root, count=2):
    """Runs with their files, below a folder."""
    found = []
    for i in range(count):
        folder = root / "runs" / f"r{i}"
        folder.mkdir(parents=True)
        np.savez(folder / "final.npz", time=float(i))
        record = Record(**HEADING | {"repeat": i}, method="mpm", verdict="completed")
        found.append(Run(keep(folder, record, ["final.npz"]), folder))
    return found


def files(root):
    return {p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()}


WRITTEN = {"verb.parquet", "verb.csv", "verb.json", "line.png", "report.html"}
RUNS = {f"runs/r{i}/{name}" for i in range(2) for name in ("record.json", "final.npz")}


def test_a_result_is_saved_beside_its_runs_or_takes_them_along(tmp_path, monkeypatch):
    here = tmp_path / "here"
    result = Result(made(here), here, runs_in(here))
    assert result.save() == here / "report.html" and files(here) == WRITTEN | RUNS
    there = tmp_path / "there" / "deep"
    assert result.save(there) == there / "report.html" and files(there) == WRITTEN | RUNS
    for path in RUNS:
        assert (there / path).read_bytes() == (here / path).read_bytes()
    assert result.save(str(there)) == there / "report.html"  # once more, over what is there
    monkeypatch.chdir(tmp_path)
    assert result.save("here") == here / "report.html" and result.save("other") == tmp_path / "other" / "report.html"
    assert float(Run(result.runs[1].record, tmp_path / "other" / "runs" / "r1").frame()["time"]) == 1.0


def test_what_is_written_is_what_was_found(tmp_path):
    image = Image("views", "the views", "what they show", lambda: b"a picture")
    part = Section("one part", "Part", "its text", Table("", ["q"], [["value of q"]]), [BARS], ["mind this"])
    report = made(
        tmp_path,
        images=[image],
        sections=[part],
        files={"more.md": "# more\n"},
        prefix="run-",
        alarms=["look out"],
        failures=["it failed"],
        notes=["nearly"],
        runs={"records": [("first", "runs/x/record.json")]},
        machine="CPU",
    )
    assert write(report, tmp_path) == tmp_path / "run.html"
    assert files(tmp_path) == {
        "verb.parquet",
        "verb.csv",
        "verb.json",
        "run-line.png",
        "run-bars.png",
        "run-views.png",
        "run.html",
        "more.md",
    }
    assert (tmp_path / "more.md").read_text() == "# more\n" and (
        tmp_path / "run-views.png"
    ).read_bytes() == b"a picture"
    assert (tmp_path / "run-line.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads((tmp_path / "verb.json").read_text()) == {
        "findings": ["found this"],
        "rows": [{"method": "mpm", "error": 0.5}],
    }
    assert pd.read_parquet(tmp_path / "verb.parquet").equals(report.data) and [p.name for p in report.every_plot()] == [
        "line",
        "bars",
    ]
    html = (tmp_path / "run.html").read_text()
    for words in (
        "A &lt;table&gt;",
        "one &amp; two",
        '<a href="#there">three</a>',
        "look out",
        "it failed",
        "nearly",
        "value of q",
        "mind this",
        'id="one-part"',
        "its text",
        "runs/x/record.json",
        "YSBwaWN0dXJl",
    ):
        assert words in html, words


def test_a_result_is_shown_in_words_and_in_notebooks(tmp_path):
    result = Result(made(tmp_path, alarms=["look <out>"]), tmp_path)
    text = StringIO()
    result.show(Console(file=text, width=100))
    for words in ("A <table>", "one & two", "three", "look <out>", "- found this"):
        assert words in text.getvalue()
    assert repr(result).startswith("a title\n") and "- found this" in repr(result)
    html = result._repr_html_()
    assert html.startswith("<h3>a title</h3><h4>A &lt;table&gt;</h4><table>") and "one &amp; two" in html
    assert "<li>look &lt;out&gt;</li><li>found this</li>" in html
    assert (
        result.table.equals(result.report.data)
        and result.findings == ["found this"]
        and list(result.figures) == ["line"]
    )
    assert list(result.figures["line"].data[0].y) == [3.0, 4.0]


def test_plots_open_as_they_are_drawn():
    line, points, bars = map(interactive, (LINE, POINTS, BARS))
    assert (line.data[0].mode, line.data[0].line.color, line.layout.xaxis.title.text) == ("lines", "#0072B2", "x [m]")
    assert (points.data[0].mode, points.layout.xaxis.type, points.layout.yaxis.scaleanchor) == ("markers", "log", "x")
    assert bars.data[0].type == "bar" and line.layout.xaxis.type is None


def test_a_methods_colour_goes_by_its_place():
    assert [colour(m) for m in ("mpm", "sph", "pbd")] == list(COLOURS[:3])
    assert colour("sph (taichi)") == LIGHTER[1] and colour("law") == colour("law") and colour("other") in COLOURS


# --- verbs


def test_a_comparison_holds_what_it_was_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(compare_report, "plots", lambda *_: [])
    monkeypatch.setattr(compare_report, "views", lambda _: [])
    monkeypatch.setattr(compare_report, "clouds", lambda _: [])
    calls = working(
        monkeypatch, lambda job: finished(job.method, repeat=job.repeat, backend=job.target.backend, prepare_s=1.0)
    )
    made = module.compare(
        BEAD,
        ["mpm", "sph"],
        repeats=2,
        frames=True,
        render_every=0.5,
        checkpoint_every=9.0,
        out=tmp_path,
        wall_limit=5.0,
        progress=False,
    )
    (call,) = calls
    assert [(j.method, j.repeat) for j in call] == [(m, r) for m in ("mpm", "sph") for r in (0, 1)]
    assert {(j.keep_frames, j.film_every, j.checkpoint_every, j.wall_limit) for j in call} == {(True, 0.5, 9.0, 5.0)}
    assert call.workers == 1 and made.ok and len(made.table) == 4 and made.root == tmp_path
    both = module.compare(BEAD, "mpm", backends=["warp", "taichi"], threads=2, out=tmp_path, progress=False)
    assert [run.label for run in both.runs] == ["mpm", "mpm (taichi)"] and calls[1][1].target.threads == 2
    one = module.run(BEAD, "pbd", out=tmp_path, progress=False)
    assert (one.method, calls[-1][0].film_every, len(calls[-1])) == ("pbd", None, 1)
    with pytest.raises(UserError, match="repeats: a whole number of at least 1"):
        module.compare(BEAD, repeats=0, out=tmp_path)


@pytest.mark.parametrize(
    ("verdicts", "fine"),
    [
        (("completed", "completed"), True),
        (("completed", "refused"), True),
        (("refused", "refused"), False),
        (("completed", "error"), False),
        (("completed", "diverged"), True),
        (("diverged", "diverged"), False),
    ],
)
def test_a_comparison_is_whole_with_a_result_and_nothing_lacking(tmp_path, monkeypatch, verdicts, fine):
    monkeypatch.setattr(compare_report, "plots", lambda *_: [])
    monkeypatch.setattr(compare_report, "views", lambda _: [])
    monkeypatch.setattr(compare_report, "clouds", lambda _: [])
    ends = dict(zip(("mpm", "sph"), verdicts, strict=True))
    working(monkeypatch, lambda job: finished(job.method, ends[job.method]))
    assert module.compare(BEAD, ["mpm", "sph"], out=tmp_path, progress=False).ok is fine


def test_runs_without_a_folder_live_as_long_as_they_are_held(monkeypatch):
    monkeypatch.setattr(compare_report, "plots", lambda *_: [])
    monkeypatch.setattr(compare_report, "views", lambda _: [])
    monkeypatch.setattr(compare_report, "clouds", lambda _: [])
    working(monkeypatch)
    run = module.run(BEAD, "mpm", progress=False)  # its result is gone, its folder is not
    gc.collect()
    root = run.folder.parents[1]
    assert root.is_dir() and root.name.startswith("fluidbench-")
    del run
    gc.collect()
    assert not root.exists()


def test_options_that_there_are_not_are_refused():
    for given, words in (
        ({"wall_limt": 3}, "no option 'wall_limt'; did you mean 'wall_limit'"),
        ({"wall_limit": -1.0}, r"a number of at least 0\.001 is wanted \(got -1\.0\)"),
        ({"wall_limit": math.nan}, "a number of at least"),
        ({"repeats": 0}, "at least 1 is wanted"),
        ({"repeats": 1.5}, "a whole number"),
        ({"out": ""}, "a folder is wanted"),
        ({"backends": ["warp", "warp"]}, "named twice"),
        ({"backends": ["warp"], "backend": "taichi"}, "give one or the other"),
        ({"device": 0}, "a name is wanted"),
        ({"verb": "../evil"}, "a plain name"),
        ({"render_every": 0}, "render_every"),
    ):
        with pytest.raises(UserError, match=words):
            module.compare(BEAD, ["mpm"], **given)


def test_a_workplace_is_checked_before_anything_is_written(tmp_path):
    for options, words in (
        ({"device": "cuda:99"}, "no device 'cuda:99'"),
        ({"backend": "wrap"}, "backend: no 'wrap'"),
        ({"threads": 0}, "threads: a whole number of at least 1"),
        ({"threads": 10**6}, "1000000 threads are more than"),
        ({"jobs": 0}, "jobs: a whole number of at least 1"),
    ):
        with pytest.raises(UserError, match=words):
            Workplace.of({"out": tmp_path / "x", **options}, 5.0, ["mpm"])
    with pytest.raises(UserError, match=r"concurrent\.futures"):
        Workplace.of({"out": tmp_path / "x", "executor": 5}, 5.0)
    place = Workplace.of({"out": str(tmp_path / "x"), "jobs": 3, "fresh": True, "progress": False}, 5.0)
    assert (place.workers, place.wall_limit, place.store.root, place.store.fresh) == (3, 5.0, tmp_path / "x", True)
    assert not place.progress and place.executor is None and place.keeper is None and not list(tmp_path.iterdir())
    with pytest.raises(UserError):
        as_executor(None)


def test_a_scenario_is_given_as_it_is_or_meant(tmp_path):
    own = scenario()
    assert as_scenario(own) is own and as_scenario("line_bead").spacing == 1.5e-3
    with pytest.raises(UserError, match="quick: a scenario given as an object"):
        as_scenario(own, quick=True)
    assert as_scenario("line_bead", quick=True).spacing == pytest.approx(2e-3)
    path = Path(tmp_path / "mine.toml")
    path.write_text(
        'name = "mine"\nduration = 0.5\nspacing = 0.01\n[domain]\nlower = [0, 0, 0]\n'
        'upper = [0.1, 0.1, 0.1]\n[material]\ndensity = 10.0\n[[bodies]]\nkind = "box"\n'
        "center = [0.05, 0.05, 0.05]\n"
        "size = [0.05, 0.05, 0.05]\n"
    )
    assert as_scenario(path).name == as_scenario(str(path)).name == "mine"
