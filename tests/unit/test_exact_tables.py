"""Cells of the tables as they are formatted, and of the page of the printed tower."""

import math
from collections import Counter
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from fluidbench.measure.collapse import Collapse, Mode
from fluidbench.measure.reference import Answer
from fluidbench.measure.tower import Criterion, Print
from fluidbench.paper import definitions, judged
from fluidbench.paper import table1_report as table1_page
from fluidbench.paper import table2_report as table2_page
from fluidbench.paper.rows import Row
from fluidbench.report.page import anchor
from fluidbench.report.table import Table, label, number, show, spread
from fluidbench.study import stability_report as stability_page
from fluidbench.study.compare_tables import against_reference, backends, costs, failed_prints, fidelity, successes
from fluidbench.study.points import AXES

from .made import case, change, evidence, finished, known, repeated, trial


def test_numbers_have_four_digits_and_spreads_one():
    assert (number(1234.56), number(0.000123456), number(2.0)) == ("1235", "0.0001235", "2")
    assert spread([1.23456]) == "1.235" and spread([8.0, 12.0]) == "10 ± 3" and spread([1.0, 1.0]) == "1 ± 0"


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("bead_width_m", "bead width [m]"),
        ("bead_area_m2", "bead area [m²]"),
        ("mass_kg", "mass [kg]"),
        ("kinetic_energy_J", "kinetic energy [J]"),
        ("wall_s", "wall [s]"),
        ("peak_memory_MiB", "peak memory [MiB]"),
        ("steps_per_s", "steps per s"),
        ("particle_substeps_per_cpu_s", "particle substeps per cpu s"),
        ("wall_per_simulated_s", "wall per simulated s"),
        ("creep_m_per_s", "creep [m/s]"),
        ("slump", "slump"),
        ("m", "m"),
        ("print_standing", "print standing"),
    ],
)
def test_keys_in_words(key, words):
    assert label(key) == words


def test_fidelity_has_a_column_a_method_and_hides_the_ledger():
    runs = [
        finished("mpm", measures={"bead_width_m": w, "momentum_x_kg_m_s": 1.0, "particles": 3, "center_x_m": 0.0})
        for w in (0.010, 0.012)
    ] + [finished("sph", "diverged"), finished("sph", measures={"slump": 0.5}, repeat=1, print="broken")]
    table = fidelity(runs)
    assert table.head == ["", "mpm", "sph"] and table.rows == [
        ["verdict", "completed", "completed, diverged"],
        ["print", "-", "broken"],
        ["bead width [mm]", "11 ± 1", "-"],
        ["slump", "-", "0.5"],
    ]
    assert [row[0] for row in fidelity(runs[:2]).rows] == ["verdict", "bead width [mm]"]
    odd = fidelity([finished(measures={"potential_energy_J": 1.0, "angular_momentum_x_kg_m2_s": 1.0, "top_m": 1.0})])
    assert [row[0] for row in odd.rows] == ["verdict", "top [m]"]


def answer(measure="relative"):
    return Answer("q", 1.2345678, 2.0, 0.125, measure, "s")


def test_errors_are_percents_but_where_they_are_absolute():
    runs = [
        finished(
            answers=[answer(), answer(measure="absolute, of T"), answer(measure="in discs"), answer(measure="RMS")],
            not_compared=["why"],
        ),
        finished(answers=[answer()], repeat=1, not_compared=["why", "also"]),
    ]
    table = against_reference(runs)
    assert [row[4] for row in table.rows] == ["12.50 %", "0.1250", "0.1250", "12.50 %"]
    assert table.rows[0] == ["q", "mpm", "1.235", "2", "12.50 %", "relative", "s"]
    assert table.note == "not compared: why\nnot compared: also"
    assert against_reference([finished()]) is None and against_reference([finished(not_compared=["x"])]).rows == []


def test_only_an_answer_that_reads_what_still_moves_is_marked():
    answers = [answer(), replace(answer(), reads="top_m"), replace(answer(), reads="slump")]
    run = finished(answers=answers, measures={"slump": 1.2345678, "top_m": 1.2345678}, moving=("slump",))
    assert [row[2] for row in against_reference([run]).rows] == ["1.235", "1.235", "1.235 ~"]


def test_criteria_have_a_row_each():
    def criteria(*rows):
        return [Criterion(n, m, ">= 1", met, Print.COLLAPSED) for n, m, met in rows]

    runs = [
        finished("mpm", success=criteria(("height", 0.51234, False), ("laid", 3, True))),
        finished("sph"),
        finished("pbd", success=criteria(("height", 1.0, True), ("laid", 2, False))),
        finished("pbd", success=criteria(("height", 9.0, True), ("laid", 9, False)), repeat=1),
    ]
    table = successes(runs)
    assert table.head == ["", "wanted", "mpm", "pbd"]
    assert table.rows == [["height", ">= 1", "0.5123 NO", "1 yes"], ["laid", ">= 1", "3 yes", "2 NO"]]
    assert successes([finished()]) is None


def test_prints_that_failed_are_told_with_what_they_did_not_meet():
    unmet = [
        Criterion("height", 0.51234, ">= 1", False, Print.COLLAPSED),
        Criterion("laid", 3, "3", True, Print.INCOMPLETE),
        Criterion("radius", 0.25, "<= 0.1", False, Print.DEFORMED),
    ]
    runs = [
        finished("mpm", print="collapsed", success=unmet),
        finished("sph", print="sound", success=unmet),
        finished("pbd"),
        finished("pbd", "diverged", print="broken", success=unmet),
    ]
    (line,) = failed_prints(runs)
    assert line.startswith("mpm") and line.endswith(
        "collapsed: height 0.5123 (wanted >= 1); radius 0.25 (wanted <= 0.1)"
    )
    fall = Collapse(1.5, 3, Mode.BUCKLING)
    (line,) = failed_prints([finished("mpm", print="collapsed", success=unmet[:1], collapse=fall)])
    assert line.endswith("collapsed: by buckling at 1.5 s, 3 layers whole; height 0.5123 (wanted >= 1)")


COSTLY = {
    "substeps": 5,
    "particle_substeps_per_s": 1e4,
    "particle_substeps_per_cpu_s": 2e4,
    "peak_particles": 7,
    "peak_memory_MiB": 3.0,
    "prepare_s": 0.5,
}


def costly(method="mpm", verdict="completed", **more):
    run = finished(method, verdict, **more)
    if verdict == "completed":
        change(run, COSTLY | {k: v for k, v in more.items() if k in COSTLY})
    return run


def test_costs_have_a_row_each():
    runs = [costly(wall_s=1.0, binding_s={"a": 1.0, "b": 2.0}), costly(wall_s=3.0), costly("sph", "error")]
    rows = {row[0]: row[1:] for row in costs(runs).rows}
    assert (
        rows["wall [s]"] == ["2 ± 1", "-"]
        and rows["binding bound"] == ["b", "-"]
        and rows["substeps"] == ["5 ± 0", "-"]
    )
    assert len(rows) == 14 and rows["mean dt [s]"] == ["0.0001 ± 0", "-"]


def test_backends_are_compared_where_there_are_two():
    def pair(second=None, **more):
        measures = {"bead_width_m": 0.010, "layer_1_height_m": 0.005, "slump": 0.1, "resolution_m": 1e-3}
        first = [costly(measures=measures, particle_substeps_per_s=1e4 * k) for k in (1, 3)]
        other = costly(
            measures=measures | {"bead_width_m": 0.0105, "layer_1_height_m": 0.0048, "slump": 0.9},
            backend="taichi",
            particle_substeps_per_s=5e4,
            **more,
        )
        return [*first, other]

    table = backends(pair(wall_s=4.0))
    assert table.head == ["", "warp", "taichi", "second / first"]
    assert table.rows == [
        ["mpm: particle substeps per s", "2e+04 ± 1e+04", "5e+04", "2.5"],
        ["mpm: particle substeps per cpu s", "2e+04 ± 0", "2e+04", "1"],
        ["mpm: wall [s]", "1 ± 0", "4", "4"],
        ["mpm: prepare [s]", "0.5 ± 0", "0.5", "1"],
        ["mpm: bead width [m], apart most", "0.01", "0.0105", "0.5 of the resolution"],
    ]
    assert backends(pair()[:2]) is None and backends([*pair()[:2], finished(verdict="error", backend="taichi")]) is None


def test_a_table_is_printed_with_all_its_cells_and_its_note():
    wide, narrow = Console(width=120, record=True, file=StringIO()), Console(width=60, file=StringIO())
    table = Table("Title", ["", "head [s]"], [["row", "1.5"], ["another", "[x]"]], "a note with [brackets]")
    for console in (wide, narrow):
        show(console, table)
    text = wide.export_text()
    for words in ("Title", "head [s]", "row", "1.5", "[x]", "a note with [brackets]"):
        assert words in text
    (line,) = [line for line in text.splitlines() if "another" in line]
    assert line.index("another") < line.index("[x]") and "another " in line and "[x] │" in line  # left, and right
    bare = Console(width=120, record=True, file=StringIO())
    show(bare, Table("T", ["a"], [["b"]]))
    assert bare.export_text().rstrip().endswith("┘")
    long = Table("T", ["", "x"], [["n" * 70, "1"]])
    for width, folded in ((120, False), (99, False), (60, True)):
        console = Console(width=width, record=True, file=StringIO())
        show(console, long)
        assert ("n" * 70 not in console.export_text()) is folded


# --- pages of studies


def test_the_page_of_the_tower_has_a_row_a_variant(tmp_path):
    def runs(speeds, **more):
        made = [
            finished(steps_per_s=s, wall_per_simulated_s=s / 50, mean_dt_s=2e-4, key="k", folder=tmp_path / "r", **more)
            for s in speeds
        ]
        for run in made:
            change(run, {"peak_particles": 1234}, launches={"per_substep": 4}, bytes={"a": 10, "b": 32})
        return made

    broken = [
        finished(verdict="error", key="k", folder=tmp_path / "r"),
        finished(verdict="timeout", key="k", folder=tmp_path / "r"),
    ]
    rows = [
        Row("plain", None, "mpm", runs([90.0, 110.0], machine={"cores": "2"}), runs([40.0, 40.0]), "CPU"),
        Row("expansion + curing + drone", 5000, "mpm", broken, [], "CPU"),
        Row("curing", 5000, "mpm", [*runs([90.0]), broken[0]], [], "CPU"),
    ]
    made = table2_page.report(rows, tmp_path)
    plain = ["2.000 ± 0.283", "11.7 ± 0.2", "0.8000 ± 0.0000", "15.7 ± 0.1", "1234", "0.2", "100.0 ± 14.1"]
    assert made.tables[0].rows == [
        ["plain", "mpm", "as needed", *plain],
        ["expansion + curing + drone", "mpm", "5000", "error, timeout", "16.7 ± 0.1", "-", "59.3 ± 0.2", "-", "-", "-"],
        ["curing", "mpm", "5000", "error", "12.6 ± 0.2", "-", "34.2 ± 0.3", "1234", "0.2", "-"],
    ]
    first, second, _ = made.data.to_dict("records")
    paces = [f"{whose}wall_per_simulated_s{kind}" for whose in ("", "paper_") for kind in ("", "_pictures")]
    assert [first[key] for key in ("steps_per_s", *paces)] == [100.0, 2.0, 0.8, 11.7, 15.7]
    assert (first["repeats"], first["bytes"], first["launches_per_substep"], second["repeats"]) == (2, 42, 4, 0)
    assert made.machine == "CPU: cores 2" and [len(v) for v in made.runs.values()] == [4, 2, 2]
    assert [row[:2] for row in made.tables[1].rows] == [["mpm", "cost insensitive to the pool's size"]]
    assert made.findings[0].startswith("mpm: 'cost insensitive to the pool's size': not decidable")


def test_the_page_of_the_table_counts_its_verdicts(tmp_path):
    rows = [*known("mpm", 4, 0, "elastic"), trial(case("g0", "elastic"), "mpm", spacing=0.02, wall=2.0)]
    e = evidence(rows, repeats=repeated(mpm=4.0, sph=8.0, pbd=2.0))
    for run in e.runs():
        object.__setattr__(run, "folder", tmp_path / "runs" / "x")
    made = table1_page.report({"here": e}, tmp_path)
    found = judged.cells(e)
    counts = Counter(table1_page.verdict([table1_page.Entry("here", "CPU", c)]) for c in found)
    words = ", ".join(f"{n} {table1_page.WORDS[v]}" for v, n in counts.items())
    assert made.findings[0] == f"Of {len(found)} statements {words}."
    assert len(made.findings) == 1 + counts[definitions.OPEN] + counts[table1_page.DEPENDS]
    assert len(made.data) == len(found) and len(made.plots) == 1
    (table,) = made.tables
    assert table.head == ["", "mpm", "sph", "pbd"] and table.rows[0][0] == "fidelity"
    marks = [line[0] for row in table.rows for cell in row[1:] for line in cell if line[1:2] == " " and line[0] != " "]
    assert Counter(marks) == {table1_page.MARKS[v]: n for v, n in counts.items()}
    assert [d.anchor for d in made.details[:-1]] == [line.href[1:] for line in _heads(table, found)]


def _heads(table, found):
    """The heads of statements, in the order of the cells."""
    heads = {line.href: line for row in table.rows for cell in row[1:] for line in cell if hasattr(line, "href")}
    return [heads[f"#{anchor(c.name)}"] for c in found]


def placed(studies):
    return {place[0].cell.place: place for place in table1_page.gathered(studies)}


def test_studies_that_disagree_are_said_to(tmp_path):
    studies = {
        "CPU": evidence(repeats=repeated(mpm=4.0, sph=8.0, pbd=2.0)),
        "GPU": evidence(repeats=repeated(mpm=2.0, sph=8.0, pbd=4.0)),
    }
    for run in studies["GPU"].runs():
        change(run, machine={"device": "GPU"})
    places = placed(studies)
    low, high = places["cost", "at equal spacing", "pbd"], places["cost", "at equal spacing", "sph"]
    assert [entry.cell.verdict for entry in low] == ["confirmed", "refuted"]
    assert table1_page.verdict(low) == table1_page.DEPENDS and table1_page.verdict(high) == "confirmed"
    made = table1_page.report(studies, tmp_path)
    assert sorted(set(made.data.study)) == ["CPU", "GPU"]
    assert any("CPU: confirmed" in line and "GPU: refuted" in line for line in made.findings)
    text, tex = made.files["table1.md"], made.files["table1.tex"]
    assert "≠ low, at equal spacing<br>  ✓ CPU: 2 s a simulated s<br>  ✗ GPU: 4 s a simulated s" in text
    assert r"[depends] low, at equal spacing \newline [confirmed] CPU: 2 s" in tex and "✓" not in tex
    assert not any("studied" in line for line in made.findings)


def test_what_changes_when_a_study_is_made_again_is_not_robust(tmp_path):
    studies = {
        "CPU": evidence(repeats=repeated(mpm=4.0, sph=8.0, pbd=2.0)),
        "CPU, seed 1": evidence(repeats=repeated(mpm=2.0, sph=8.0, pbd=4.0)),
    }
    places = placed(studies)
    low, high = places["cost", "at equal spacing", "pbd"], places["cost", "at equal spacing", "sph"]
    assert table1_page.verdict(low) == table1_page.LOOSE and table1_page.verdict(high) == "confirmed"
    made = table1_page.report(studies, tmp_path)
    again = next(line for line in made.findings if "studied 2 times" in line)
    loose = [place[0].cell.name for place in places.values() if table1_page.verdict(place) == table1_page.LOOSE]
    assert again == f"CPU, studied 2 times: {len(loose)} of {len(places)} verdicts changed: {'; '.join(loose)}."
    assert "± low, at equal spacing<br>  ✓ CPU: 2 s" in made.files["table1.md"]
    assert "[not robust] low, at equal spacing" in made.files["table1.tex"]


def test_the_page_of_stability_draws_limits_and_marks_what_has_none():
    point = {
        "axis": "density",
        "method": "mpm",
        "verdict": "held",
        "reason": "",
        "dt_own_s": 1.0,
        "binding": "b",
        "dt_lump_s": 2.0,
        "lump_limit_found": True,
        "dt_theory_s": 3.0,
        "dt_block_s": math.inf,
    }
    points = [
        point | {"value": 10.0},
        point | {"value": 0.0, "lump_limit_found": False},
        {"axis": "density", "method": "sph", "value": 5.0, "verdict": "refused", "reason": "no"},
    ]
    assert stability_page._points(points).rows == [
        ["density", "10", "mpm", "held", "1", "b", "2", "-", "3"],
        ["density", "0", "mpm", "held", "1", "b", "> 2", "-", "3"],
        ["density", "5", "sph", "refused", "-", "-", "-", "-", "-"],
    ]
    (plot,) = stability_page._maps(points, AXES)
    assert [(t.label, list(t.x), list(t.y)) for t in plot.traces] == [
        ("mpm", [10.0], [2.0]),
        ("mpm, theory", [10.0], [3.0]),
        ("mpm, own bound", [10.0], [1.0]),
    ]
    block = {"kind": "acoustic", "method": "mpm", "dt_limit_s": 3.0, "dt_theory_s": 4.0, "dt_own_s": 1.5}
    assert stability_page._blocks([block]).rows == [["acoustic", "mpm", "3", "4", "0.75", "0.5"]]
