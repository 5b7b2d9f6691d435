"""Measured numbers: what a table may say, and how runs stand beside it."""

import re

import numpy as np
import pytest

from fluidbench.errors import UserError
from fluidbench.measure.beside import computed
from fluidbench.runs.job import Job
from fluidbench.scenario.library import load
from fluidbench.scenario.measured import OF_ALL, Measured, read
from fluidbench.study.compare import compare
from fluidbench.study.compare_measured import against_measured, measured_plot, points_along, values_of
from fluidbench.study.lengths import LENGTHS
from fluidbench.study.select import select
from fluidbench.study.selection import assess
from fluidbench.study.workplace import measured_of

from ..conftest import bead
from .made import finished, working

TABLE = """\ufeff# a print of ours
Quantity, layer, place, value, uncertainty, source

width,, , 16 mm, 0.5 mm, "us, in May"
area, , , 1.1e-4, ,
width, 2, , 15.5 mm, ,
# half way
height, , 45 mm, 8 mm, 1 mm,
"""


def written(tmp_path, text):
    (tmp_path / "m.csv").write_text(text, encoding="utf-8")
    return read(tmp_path / "m.csv")


def test_rows_with_units_layers_and_places(tmp_path):
    rows = written(tmp_path, TABLE)
    assert [one.key for one in rows] == ["bead_width_m", "bead_area_m2", "layer_2_width_m", "bead_height_m"]
    assert [one.value for one in rows] == [0.016, 1.1e-4, 0.0155, 0.008]
    assert [one.uncertainty for one in rows] == [5e-4, None, None, 1e-3] and rows[3].place == 0.045
    assert rows[0].source == "us, in May" and rows[3].words == "bead height at 45 mm"
    assert rows[2].words == "layer 2 width"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no rows"),
        ("# only\n", "no rows"),
        ("quantity,value\n", "has no rows"),
        ("quantity,worth\nwidth,1\n", "line 1: no column is called 'worth'"),
        ("value\n1\n", "line 1: the column quantity is missing"),
        ("quantity,value\nwidth,1,2\n", "line 2: 3 values in 2 columns"),
        (
            "quantity,value\n\nwidht,1\n",
            "line 3: quantity: no measure of a run is called 'widht'; did you mean 'width'",
        ),
        ("quantity,value\nwidth,2 Pa\n", "line 2: '2 Pa' is of another kind than m"),
        (
            "quantity,value\nslump,16 mm\n",
            "line 2: '16 mm' is of another kind than a plain number; slump is a share",
        ),
        ("quantity,value\nwidth,wide\n", "line 2: value: input should be a valid number"),
        ("quantity,value,uncertainty\nwidth,1,0\n", "line 2: uncertainty: input should be greater than 0"),
        ("quantity,value,layer\nslump,1,2\n", "no measure of a layer is called 'slump'"),
        ("quantity,value,place\nslump,1,2\n", "place: only width, height, area without a layer"),
        ("quantity,value\nwidth,\n", "line 2: value: field required"),
        ("quantity,value\nwidth,-4 mm\n", "line 2: value: bead width is a size, and not below 0"),
        ("quantity,value,value\nwidth,1,2\n", "line 1: the column value is there twice"),
        ('quantity,value,source\nwidth,1,"us\n', "line 2: unexpected end of data"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, text, words):
    with pytest.raises(UserError, match=words):
        written(tmp_path, text)


def test_a_cell_may_have_several_lines(tmp_path):
    rows = written(tmp_path, 'quantity,value,source\nwidth,1,"us,\n\n# in May"\n# "\nheight,2,\n')
    assert [(one.key, one.source) for one in rows] == [("bead_width_m", "us,\n\n# in May"), ("bead_height_m", "")]


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(UserError, match="No such file"):
        read(tmp_path / "none.csv")


def test_a_scenario_may_hold_them_and_runs_do_not_depend_on_them():
    row = {"quantity": "width", "value": "16 mm", "uncertainty": "1 mm"}
    plain, told = bead(), bead(measured=[row])
    assert told.measured == (Measured(quantity="width", value=0.016, uncertainty=1e-3),)
    jobs = [Job(s.model_dump(mode="json"), "mpm") for s in (plain, told)]
    assert jobs[0].inputs() == jobs[1].inputs() and jobs[0].key == jobs[1].key
    with pytest.raises(UserError, match=r"measured\.0: quantity: no measure of a run is called 'girth'"):
        load("line_bead", {"measured": [{"quantity": "girth", "value": 1.0}]})


def test_each_method_has_its_error_in_per_cent_and_over_the_uncertainty():
    runs = [finished("mpm", measures={"bead_width_m": 0.0168, "bead_area_m2": 1.1e-4}), finished("sph", measures={})]
    rows = [
        Measured(quantity="width", value=0.016, uncertainty=4e-4, source="us"),
        Measured(quantity="area", value=1e-4),
    ]
    values = values_of([*runs, finished("pbd", "diverged"), finished("mpm", repeat=1)], rows)
    table = against_measured(values, rows)
    assert table.head == ["", "measured", "mpm", "sph"] and table.rows == [
        ["bead width [mm]", "16 ± 0.4", "16.8 (+5.0 %, +2.0 u)", "-"],
        ["bead area [mm²]", "100", "110 (+10.0 %)", "-"],
    ]
    assert "measured: us" in table.note and "not compared: sph has no bead width" in table.note
    for other in (values_of(runs, []), values_of([finished("pbd", "diverged")], rows)):
        assert against_measured(other, rows) is None and measured_plot(other, rows) == []
    plot = measured_plot(values, rows)[0]
    assert plot.traces[0].spread == pytest.approx([0.025, 0.0]) and plot.traces[1].y == pytest.approx([1.05, 1.1])
    assert len(plot.traces) == 2  # nothing of sph


def test_places_along_the_path_are_read_off_the_section_there(monkeypatch):
    from fluidbench.measure import beside

    class Laid:
        station, width = np.array([0.0, 0.1]), np.array([0.010, 0.020])

    monkeypatch.setattr(beside, "bead_of", lambda *_: Laid)
    monkeypatch.setattr(beside, "deposit_of", lambda *_: None)

    class Ended:
        scenario = None

        def frame(self):
            return {}

    at = computed(Ended(), [Measured(quantity="width", value=1.0, place=place) for place in (0.0, 0.025, 0.2)])
    assert at[:2] == pytest.approx([0.010, 0.0125]) and np.isnan(at[2])
    rows = [
        Measured(quantity="width", value=0.016, place=0.045, uncertainty=1e-3),
        Measured(quantity="width", value=1.0),
    ]
    (trace,) = points_along("width", rows)
    assert (trace.x, trace.y, trace.spread) == ([45.0], [16.0], [1.0]) and points_along("height", rows) == []


@pytest.mark.parametrize(
    ("name", "row", "words"),
    [
        ("line_bead", "width,,95 mm", "place: beads are measured from 0 to 90 mm along the path (got 95 mm)"),
        ("line_bead", "width,2,", "layer: the scenario has 1 layer (got 2)"),
        ("line_bead", "width,1,", "layer: layer 1 width is of layers on top of each other"),
        ("line_bead", "top,,", None),
        ("line_bead", "width,,90 mm", None),
        ("line_bead", "print height,,", "quantity: print height is of layers on top of each other"),
        ("line_bead", "slump,,", "quantity: slump is of a cylinder that is there at the start"),
        ("wall", "level,3,", None),
        ("wall", "height,2,", None),
        ("wall", "level,4,", "layer: the scenario has 3 layers (got 4)"),
        ("wall", "height,1,", "layer: a layer's height is its rise above the one below, from layer 2 on"),
        ("wall", "drift,2,", "quantity: layer 2 drift is of a ring"),
        ("wall", "ring drift,,", "quantity: ring drift is of a ring"),
        ("ring_tower", "drift,2,", None),
        ("ring_tower", "ring drift,,", None),
        ("column_slump", "slump,,", None),
        ("column_slump", "width,,1 mm", "quantity: bead width at 1 mm is of a bead, and the scenario has no path"),
        ("column_slump", "front_x,,", "quantity: front x is of a box"),
        ("column_slump", "level,1,", "layer: the scenario has no layers (got 1)"),
        ("dam_break", "front_x,,", None),
    ],
)
def test_what_no_run_of_a_scenario_has_is_refused_with_its_line(tmp_path, name, row, words):
    (tmp_path / "m.csv").write_text(f"# ours\nquantity,layer,place,value\ntop,,,1\n{row},1\n")
    if words is None:
        assert len(measured_of(load(name), tmp_path / "m.csv")) == 2
        return
    with pytest.raises(UserError, match=re.escape(f"m.csv, line 4: {words}")):
        measured_of(load(name), tmp_path / "m.csv")
    rows = read(tmp_path / "m.csv")
    for scenario, more in ((load(name), rows), (load(name).model_copy(update={"measured": rows}), ())):
        with pytest.raises(UserError, match=re.escape(f"measured.1: {words}")):
            measured_of(scenario, more)


def test_it_is_refused_before_anything_runs(tmp_path, monkeypatch):
    calls = working(monkeypatch, lambda work: None)
    (tmp_path / "m.csv").write_text("quantity,layer,value\nwidth,9,1\n")
    for study in (compare, select):
        with pytest.raises(UserError, match="line 2: layer: the scenario has 1 layer"):
            study("line_bead", measured=tmp_path / "m.csv", out=tmp_path / "out", progress=False)
    assert not calls and not (tmp_path / "out").exists()


def test_select_counts_errors_from_what_was_measured():
    """Widths of 15 mm at every spacing, measured as 10: half off, whatever they converge to."""
    runs = [
        finished("mpm", spacing=d, measures={"bead_width_m": 0.015, "bead_height_m": 0.008})
        for d in (0.004, 0.003, 0.002)
    ]
    free = assess(bead(), ["mpm"], runs)
    told = assess(bead(), ["mpm"], runs, [Measured(quantity="width", value=0.010, uncertainty=5e-4)])
    assert max(c.error for c in free.candidates) < 1e-9
    assert [c.error for c in told.candidates] == pytest.approx([0.5] * 3)
    assert any("bead width: errors are from the measured 0.01, known to 5.0%" in note for note in told.notes)
    two = [Measured(quantity="width", value=value) for value in (0.010, 0.014)]
    mean = assess(bead(), ["mpm"], runs, two)
    assert [c.error for c in mean.candidates] == pytest.approx([0.25] * 3)
    assert any("the measured 0.012 (mean of 2)" in note for note in mean.notes)
    lost = assess(bead(), ["mpm"], runs, [Measured(quantity="slump", value=0.3)])
    assert any("slump: measured, but no length that is judged here" in note for note in lost.notes)


def test_every_length_that_is_judged_can_be_measured():
    assert set(LENGTHS) <= set(OF_ALL)
