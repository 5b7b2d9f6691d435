"""G-code line by line, by hand: units, modes, arcs, retraction, what is refused and what is named as ignored; and what
becomes of it in a scenario."""

import math

import numpy as np
import pytest

from fluidbench.errors import UserError
from fluidbench.scenario import gcode
from fluidbench.scenario.library import define, load
from fluidbench.scenario.stream import Stream
from fluidbench.study.route import draw, picture, route

PASTE = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "yield_stress": 60.0}
# As FullControl 0.1.2 writes a bead 2 mm wide and 1 mm high: an L, a travel, a second line one layer up.
FULLCONTROL = """
; Time to print!!!!!
; GCode created with FullControl - tell us what you're printing!
M83 ; relative extrusion
G0 F8000 X10 Y10 Z2
G1 F1000 X60 E41.575169
G1 Y40 E24.945101
G0 F8000 X10 Z4
G1 F1000 X60 E41.575169
"""


def printed(tmp_path, text=FULLCONTROL, path=None, **table):
    (tmp_path / "part.gcode").write_text(text)
    path = {"kind": "gcode", "file": str(tmp_path / "part.gcode"), **(path or {})}
    base = {"material": PASTE, "nozzle": {"diameter": 2e-3}, "spacing": 2.5e-4}
    return define("part", **{**base, "toolpath": path, **table})


def test_units_and_modes():
    """10 mm at 600 mm/min take a second; an inch at 60 in/min, too."""
    for text, end, time in (
        ("G1 X10 F600", [0.01, 0, 0], 1.0),
        ("g1x10.f600", [0.01, 0, 0], 1.0),
        ("N7 G1 X10 F600*33", [0.01, 0, 0], 1.0),
        ("G20\nG1 X1 F60", [0.0254, 0, 0], 1.0),
        ("G1 F600\nG91\nG1 X4\nG1 X6 (a remark) ; and more", [0.01, 0, 0], 1.0),
        ("G1 F600\nG92 X5\nG1 X15", [0.01, 0, 0], 1.0),
        ("M220 S50\nG1 X10 F600", [0.01, 0, 0], 2.0),
        ("G01 Z3 F180\nG04 P500\nG4 S2", [0, 0, 0.003], 3.5),
    ):
        program = gcode.understand(text)
        assert program.points[-1] == pytest.approx(end, abs=1e-15), text
        assert program.seconds.sum() == pytest.approx(time), text


@pytest.mark.parametrize("text", ["G90 G20 G1 X1 Y0 Z0 F60 E1", "N7 G20G90G1X1Y0Z0F60E1"])
def test_a_line_may_have_several_commands(text):
    assert gcode.understand(text).points[-1] == pytest.approx([0.0254, 0, 0])


def test_extrusion_absolute_relative_and_drawn_back():
    absolute = gcode.understand("G1 F600\nG1 X1 E2\nG1 X2 E3\nG92 E0\nG1 X3 E4")
    assert absolute.fed.tolist() == [2, 1, 4]
    relative = gcode.understand("M83\nG1 F600\nG1 X1 E2\nG1 X2 E3\nM221 S200\nG1 X3 E4")
    assert relative.fed.tolist() == [2, 3, 8]
    back = gcode.understand("M83\nG1 F600\nG1 X1 E2\nG1 E-5\nG0 X9\nG1 E5\nG1 X1 E2\nG1 E-1\nG1 X2 E3")
    assert back.fed.tolist() == [2, 0, 2, 2]  # what was drawn back is given again, and lays nothing
    assert gcode.understand("G1 F600\nG91\nG1 X1 E2\nG1 X1 E2").fed.tolist() == [2, 2]  # G91 makes E relative, too
    assert gcode.understand("M83\nG1 F60\nG1 E2\nG1 X1 E1").seconds.tolist() == [2, 1]  # in place, E at F


@pytest.mark.parametrize(
    ("line", "at", "fed"),
    [
        ("G1 X1e-05 Y5 E2", (1e-5, 5), 2),  # as Python writes what is nearly nothing
        ("G1 X1E-05 Y5 E2", (1e-5, 5), 2),
        ("g1 x1e-05 y5 e2", (1e-5, 5), 2),
        ("G1 X1.5e+01 Y5e0 E2", (15, 5), 2),
        ("G1 X1e-05Y5E2", (1e-5, 5), 2),
        ("G1X1e-10Y5E2", (1e-10, 5), 2),
        ("G1X1e-05E2Y5", (1e-5, 5), 2),
        ("G1 X1e-05E2 Y5", (1e-5, 5), 2),  # a number has one exponent
        ("G1 X10 Y-.5e1 E.2E+1", (10, -5), 2),
        ("G1 X10 Y5 E2e-05", (10, 5), 2e-5),
        ("G1X10Y5E2.5", (10, 5), 2.5),  # as slicers write a line without blanks
        ("G1 X10E2.5 Y5", (10, 5), 2.5),
        ("G1 Y5 X10E.5", (10, 5), 0.5),
        ("G1X10E5Y5", (10, 5), 5),
        ("G1 X10Y5E5", (10, 5), 5),
        ("g1x10y5e12", (10, 5), 12),
        ("G1 X10 Y5 E12", (10, 5), 12),
        ("G1 X10 Y5 e12", (10, 5), 12),
        ("G1 X 10 Y 5 E 12", (10, 5), 12),
    ],
)
def test_an_e_is_a_word_or_an_exponent(line, at, fed):
    program = gcode.understand(f"M83\nG1 F6e2\n{line}")
    assert program.points[-1] == pytest.approx([1e-3 * at[0], 1e-3 * at[1], 0], abs=1e-15)
    assert program.fed.tolist() == pytest.approx([fed], rel=1e-12)
    assert program.seconds.tolist() == pytest.approx([math.hypot(*at) / 10.0])


def test_an_e_right_behind_a_command_is_a_word():
    back = "M83\nG1 F600\n{}\nG1E5\nG1 X1 E2"
    assert [gcode.understand(back.format(word)).fed.tolist() for word in ("G1E-5", "G1E-05", "g1e-5")] == [[2]] * 3


@pytest.mark.parametrize(
    ("text", "middle", "length"),
    [
        ("G3 X0 Y20 I0 J10", (10, 10), math.pi * 10),  # half a circle about (0, 10), counterclockwise
        ("G2 X0 Y20 I0 J10", (-10, 10), math.pi * 10),
        ("G3 X0 Y0 I0 J10", (0, 20), math.pi * 20),  # all of it
        ("G3 X10 Y10 R10", (10 * math.sin(math.pi / 4), 10 - 10 * math.cos(math.pi / 4)), math.pi * 5),
        ("G3 X10 Y10 R-10", (10 + 10 * math.cos(math.pi / 4), -10 * math.sin(math.pi / 4)), math.pi * 15),
    ],
)
def test_arcs_go_round_their_centre(text, middle, length):
    program = gcode.understand("M83\nG1 F600\n" + text + " E8")
    points = 1e3 * program.points
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(length, rel=1e-2)
    assert np.linalg.norm(points[:, :2] - middle, axis=1).min() < 0.7
    assert program.fed.sum() == pytest.approx(8) and program.seconds.sum() == pytest.approx(length / 10, rel=1e-2)


def test_an_arc_may_rise():
    points = gcode.understand("G1 F600\nG3 X0 Y20 Z4 I0 J10").points
    assert np.all(np.diff(points[:, 2]) > 0) and points[-1, 2] == pytest.approx(0.004)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G1 X10", "line 1: a move before any F"),
        ("G1 X1O F600", "G1 has no word 'O'"),
        ("G1 X1.2.3 F600", "no words such as X10.5"),
        ("G1 X F600", "X without a number"),
        ("X10 Y20", "has no command"),
        ("G1 F-5", "a positive number is wanted"),
        ("G1 F600\nG18\nG2 X1 Z1 I1", "line 2: G18: arcs in other planes"),
        ("G1 F600\nG2 X10", "line 2: an arc needs I and J, or R"),
        ("G1 F600\nG2 X10 I1", "not as far from its centre"),
        ("G1 F600\nG2 X10 R1", "R is shorter"),
        ("G1 F600\nM200 D1.75", "E is a volume"),
        ("G1 F600\nG4 S-1", "less than nothing"),
        ("G28 X G1 X5 F600", "a second command, G"),
        ("; nothing", "no line of it moves anything"),
        ("G1 F600\nG1 X10E5", "line 2: X10E5 may be X10 and E5, or one number with an exponent; write a blank"),
        ("G1 F600\nG1 X10E-5 Y2", "line 2: X10E-5 may be X10 and E-5"),
        ("G1 F600\ng1 x1e5", "line 2: x1e5 may be x1 and e5"),
        ("G1 F600\ng1x1e-10", "line 2: x1e-10 may be x1 and e-10"),
        ("G1 F600\nG1 X1e400", "line 2: 'X1e400' is beyond any physics"),
        ("G1 F600\nG1 X1e30", "line 2: 'X1e30' is beyond any physics"),
        ("G1 X10 X20 F600", "line 1: X is there twice, X10 and X20"),
        ("G1 F600\nG1 X50 E53 X60", "line 2: X is there twice, X50 and X60"),
        ("G1 F600\nG28 X X", "line 2: X is there twice, X and X"),
        ("G1X1E2E3F600", "line 1: E is there twice, E2 and E3"),
    ],
)
def test_what_cannot_be_understood_is_said_with_its_line(text, words):
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        gcode.understand(text)


def test_what_has_no_effect_is_named_with_its_lines():
    text = "M104 S200\nM117 go to G1 X5\nSET_X A=1\nG1 F600\nG1 X1\nM104 S200\nT0\n%\nEXCLUDE_OBJECT NAME=G1_x"
    assert gcode.understand(text).ignored == {
        "M104 S200": [1, 6],
        "M117 GO TO G1 X5": [2],
        "SET_X A=1": [3],
        "T0": [7],
        "EXCLUDE_OBJECT NAME=G1_X": [9],
    }


def test_a_scenario_takes_layers_heights_speeds_and_flow_from_the_file(tmp_path):
    s = printed(tmp_path)
    track, path = s.track, s.toolpath
    assert (path.layers, path.layer_height, s.nozzle.standoff) == (2, pytest.approx(2e-3), pytest.approx(2e-3))
    assert path.file == "part.gcode" and not track.repeats
    laid = 1e-9 * 2.0 * (50 + 30 + 50)  # 2 mm^2 over the lengths in mm
    assert s.nozzle.rate * track.extruding[-1] == pytest.approx(laid, rel=1e-5)
    assert Stream(s).particles * Stream(s).volume == pytest.approx(laid, rel=2e-3)
    assert path.speed == pytest.approx(1 / 60) and s.reference_speed >= 8 / 60
    assert track.end == pytest.approx(0.13 * 60 + math.hypot(50, 2) / 8000 * 60)
    assert s.duration == pytest.approx(1.1 * track.end)
    assert [rows.tolist() for rows in track.strokes] == [[0, 1, 2], [3, 4]]
    assert track.stroke.points.tolist() == pytest.approx(np.array([[0.01, 0.01], [0.06, 0.01], [0.06, 0.04]]))
    assert track.layer.tolist() == [0, 0, 0, 1]
    assert s.domain.lower[2] == 0 and all(s.domain.contains(track.position))


def test_it_is_the_same_scenario_once_the_file_is_gone(tmp_path):
    s = printed(tmp_path)
    (tmp_path / "part.gcode").unlink()
    again = type(s).model_validate(s.model_dump(mode="json"))
    assert again == s and np.array_equal(again.track.time, s.track.time)
    assert str(tmp_path) not in s.model_dump_json()


def test_a_file_lies_beside_the_scenario_that_names_it(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "part.gcode").write_text(FULLCONTROL)
    (tmp_path / "a" / "part.toml").write_text(
        'spacing = "0.25 mm"\nmaterial = { density = 1000 }\nnozzle = { diameter = "2 mm" }\n'
        'toolpath = { kind = "gcode", file = "part.gcode", offset = ["10 mm", 0, 0] }\n'
    )
    (tmp_path / "b.toml").write_text('extends = "a/part.toml"\nmaterial = { viscosity = "3 Pa s" }\n')
    monkeypatch.chdir(tmp_path)
    assert load("b.toml").material.viscosity == 3.0
    assert load("b.toml").track.position[0].tolist() == pytest.approx([0.02, 0.01, 0.002])


def test_a_file_may_begin_with_the_mark_of_an_editor(tmp_path):
    """Else its first line, here the one that makes E relative, would be none that is known."""
    (tmp_path / "a.gcode").write_text("M83\nG1 F600\nG1 X1 E2\nG1 X2 E2", encoding="utf-8-sig")
    found = gcode.read(tmp_path / "a.gcode")
    assert found.fed.tolist() == [2, 2] and not found.ignored


def test_what_e_counts(tmp_path):
    """As filament of 2 mm, as mm^3, or not at all."""
    total = 41.575169 * 2 + 24.945101
    fat = printed(tmp_path, path={"filament": 2e-3})
    assert fat.nozzle.rate * fat.track.extruding[-1] == pytest.approx(1e-9 * math.pi * total)
    volume = printed(tmp_path, path={"extrusion": "volume"})
    assert volume.nozzle.rate * volume.track.extruding[-1] == pytest.approx(1e-9 * total)
    own = printed(tmp_path, path={"extrusion": "nozzle"}, nozzle={"diameter": 2e-3, "exit_speed": 0.03})
    assert own.track.flow_in.tolist() == pytest.approx([1, 1, 0, 1]) and own.nozzle.speed == 0.03


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nozzle": {"diameter": 2e-3, "exit_speed": 0.1}}, r"nozzle\.exit_speed: the E words of the file say"),
        ({"nozzle": {"diameter": 2e-3, "standoff": 0.1}}, r"nozzle\.standoff: the file of G-code says it"),
        ({"nozzle": {}}, r"nozzle\.diameter is missing"),
        ({"path": {"speed": 0.1}}, r"toolpath\.speed: the file of G-code says it"),
        ({"path": {"extrusion": "nozzle"}}, r"nozzle\.exit_speed is missing"),
        ({"path": {"extrusion": "volume", "filament": 1e-3}}, r"toolpath\.filament has no effect"),
        ({"path": {"offset": [0, 0, -0.01]}}, "at or below the bed"),
        ({"path": {"file": "nowhere.gcode"}}, "No such file"),
        ({"path": {"start": [0, 0]}}, "start has no effect on kind = 'gcode'"),
        ({"text": "G1 X5 F600"}, "it has no E words"),
        ({"text": "G1 F600\nG1 E5"}, "no move of it extrudes"),
        ({"domain": {"lower": [0, 0, 0], "upper": [0.02, 0.1, 0.1]}}, "leaves the domain"),
    ],
)
def test_what_contradicts_the_file_is_refused(tmp_path, change, words):
    with pytest.raises(UserError, match=words):
        printed(tmp_path, **change)


def test_a_wall_that_a_slicer_repeats_is_a_tower(tmp_path):
    text = "M83\nG0 F6000 X0 Y0 Z1\nG1 F1200 X40 E20\nG0 Z2\nG1 X0 E20\nG0 Z3\nG1 X40 E20\n"
    assert printed(tmp_path, text).track.repeats
    assert not printed(tmp_path, text + "G0 Y5\nG1 X0 E20\n").track.repeats


def test_the_path_is_told_and_drawn(tmp_path):
    tables, remarks = route(printed(tmp_path, "M104 S200\n" + FULLCONTROL))
    assert [row[:5] for row in tables[0].rows] == [["1", "1", "2", "80", "4.8"], ["2", "2", "4", "50", "3"]]
    assert [row[6] for row in tables[0].rows] == ["2", "2"]
    assert "without effect: M104 S200 (line 1)" in remarks and any("1 move before" in line for line in remarks)
    assert draw(printed(tmp_path), tmp_path).read_bytes().startswith(b"\x89PNG")
    with pytest.raises(UserError, match="has no nozzle"):
        route(load("dam_break"))


NARROW = """M83
G0 F1200 X0 Y0 Z2
G1 Y80 E40
G0 Z6
G0 X4
G0 Z2
G1 Y0 E40
G0 Z6
"""


@pytest.mark.parametrize("text", ["M83\nG0 F1200 X0 Y0 Z2\nG1 X60 E40\n", NARROW])
def test_the_picture_of_a_path_covers_none_of_it(tmp_path, text):
    """A straight line's plan had no height, a narrow one's legend lay over frame and end, and constant speeds were
    shown by their rounding, about an offset."""
    made = printed(tmp_path, text)
    figure = picture(made)
    figure.draw_without_rendering()
    plan, side, clock = figure.axes
    (legend,) = figure.legends
    for axes in figure.axes:
        assert axes.get_legend() is None and not axes.get_window_extent().overlaps(legend.get_window_extent())
        assert axes.yaxis.get_offset_text().get_text() == ""
    (left, right), (low, high) = plan.get_xlim(), plan.get_ylim()
    x, y, _ = 1e3 * made.track.position.T
    assert left < x.min() and x.max() < right and low < y.min() and y.max() < high
    assert min(right - left, high - low) >= 0.3 * max(np.ptp(x), np.ptp(y)) * (1 - 1e-9)
    assert side.get_xlabel() == ("y [mm]" if text == NARROW else "x [mm]")
    assert clock.get_ylim()[0] <= 0.0 and clock.get_ylim()[1] == pytest.approx(1.1 * 20.0)


def test_legs_of_a_polyline_have_speeds_and_flows_of_their_own():
    """3 s at half the flow, 2 s of travel, 1 s at double the flow; discs follow."""
    path = {"kind": "polyline", "points": [[0, 0], [0.3, 0], [0.3, 0.4], [0, 0.4]], "speed": 1.0}
    more = {"speeds": [0.1, 0.2, 0.3], "flows": [0.5, 0.0, 2.0]}
    s = define(
        "legs",
        domain={"lower": [-1, -1, 0], "upper": [1, 1, 1]},
        material=PASTE,
        nozzle={"diameter": 0.04, "exit_speed": 0.1, "standoff": 0.03},
        toolpath={**path, **more},
        spacing=0.01,
        duration=8.0,
    )
    assert s.track.time.tolist() == pytest.approx([0, 3, 5, 6])
    assert s.track.extruding.tolist() == pytest.approx([0, 1.5, 1.5, 3.5])
    assert s.track.release_time(np.array([0.5, 1.4, 2.5])).tolist() == pytest.approx([1, 2.8, 5.5])
    down = Stream(s).velocity[:, 2]
    assert set(np.round(down, 9)) == {-0.05, -0.2}
    assert s.feeding_speed == pytest.approx(math.hypot(0.2, 0.3))
    for wrong, words in (
        ({"flows": [1.0]}, "one for each of the 3 legs"),
        ({"flows": [0, 0, 0]}, "none of the legs extrudes"),
        ({"speeds": [1, 1]}, "one for each of the 3 legs"),
    ):
        with pytest.raises(UserError, match=words):
            define(**{"name": "a", **s.model_dump(exclude_unset=True), "toolpath": {**path, **wrong}})
