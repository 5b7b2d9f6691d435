"""Where the nozzle is at every moment, how fast it moves and what it has fed, knot by knot."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from fluidbench.scenario.toolpath import Toolpath
from fluidbench.scenario.track import Track

# An L of two legs, 3 m and 4 m, at 2 m/s; 1 s of pause after the first of two layers, 0.5 m high.
ELL = Toolpath(kind="polyline", points=((1, 1), (4, 1), (4, 5)), speed=2.0, layers=2, layer_height=0.5, pause=1.0)
TRACK = Track.of(ELL, floor=10.0, standoff=0.25)


def test_a_polyline_there_and_back_with_a_pause():
    assert ELL.length() == 7.0
    assert TRACK.time.tolist() == [0.0, 1.5, 3.5, 4.5, 6.5, 8.0]
    assert TRACK.position.tolist() == [
        [1, 1, 10.25],
        [4, 1, 10.25],
        [4, 5, 10.25],
        [4, 5, 10.75],
        [4, 1, 10.75],
        [1, 1, 10.75],
    ]
    assert TRACK.extruding.tolist() == [0.0, 1.5, 3.5, 3.5, 5.5, 7.0]
    assert TRACK.layer.tolist() == [0, 0, 0, 1, 1]
    assert TRACK.end == 8.0


def test_places_between_knots_and_beyond_both_ends():
    assert TRACK.at(0.75).tolist() == [2.5, 1, 10.25] and TRACK.at(4.25).tolist() == [4, 5, 10.625]
    assert TRACK.at(-1.0).tolist() == [1, 1, 10.25] and TRACK.at(99.0).tolist() == [1, 1, 10.75]
    assert TRACK.at(np.array([0.75, 2.5])).tolist() == [[2.5, 1, 10.25], [4, 3, 10.25]]


def test_velocity_from_corner_to_corner_and_in_the_pause():
    assert TRACK.velocity_in.tolist() == [[2, 0, 0], [0, 2, 0], [0, 0, 0.5], [0, -2, 0], [-2, 0, 0]]
    assert TRACK.speed_in.tolist() == [2, 2, 0.5, 2, 2] and TRACK.flow_in.tolist() == [1, 1, 0, 1, 1]


def test_what_is_laid_in_one_go_stroke_by_stroke():
    """There and back over the same corners; the first is what beads are measured along."""
    assert [rows.tolist() for rows in TRACK.strokes] == [[0, 1, 2], [3, 4, 5]] and TRACK.repeats
    assert TRACK.stroke.points.tolist() == [[1, 1], [4, 1], [4, 5]] and TRACK.stroke.distance.tolist() == [0, 3, 7]
    assert TRACK.stroke.fed.tolist() == [0.5, 0.5]
    apart = Toolpath(kind="polyline", points=((0, 0), (1, 0), (2, 0), (5, 0)), speed=1.0, flows=(2.0, 0.0, 1.0))
    track = Track.of(apart, 0.0, 0.1)
    assert [rows.tolist() for rows in track.strokes] == [[0, 1], [2, 3]] and not track.repeats
    assert track.stroke.points.tolist() == [[2, 0], [5, 0]]


def test_of_two_times_at_which_as_much_was_fed_the_first_counts():
    """At the end of the first stroke, not when the pause is over; the interval is that of the stroke."""
    assert TRACK.release_time(3.5) == 3.5 and TRACK.interval(3.5) == 1
    assert TRACK.interval(np.array([0.0, 1.5, 3.6, 7.0])).tolist() == [0, 0, 3, 4]


def test_fed_time_stands_still_in_pauses_and_release_time_inverts_it():
    times, fed = [0.5, 3.5, 4.0, 4.5, 5.0, 8.0, 9.0], [0.5, 3.5, 3.5, 3.5, 4.0, 7.0, 7.0]
    assert TRACK.extruded(np.array(times)).tolist() == fed and TRACK.extruded(-1.0) == 0.0
    assert TRACK.release_time(7.0 + 1e-9) == pytest.approx(8.0)  # rounding may ask for a little more than there is
    assert TRACK.release_time(np.array([0.0, 0.5, 1.5, 3.5, 4.0, 7.0])) == pytest.approx([0.0, 0.5, 1.5, 3.5, 5.0, 8.0])


def test_the_layer_of_each_moment():
    times = np.array([-1.0, 0.0, 3.4, 4.4, 4.5, 7.9, 8.0, 20.0])
    assert TRACK.layer_at(times).tolist() == [0, 0, 0, 0, 1, 1, 1, 1]


def test_the_nozzle_never_rises_faster_than_it_travels():
    wall = {"kind": "wall", "start": (0, 0), "end": (1, 0), "speed": 0.5, "layers": 2, "layer_height": 0.1}
    assert Track.of(Toolpath(**wall), 0.0, 0.1).time.tolist() == pytest.approx([0, 2, 2.2, 4.2])
    assert Track.of(Toolpath(**wall, pause=0.1), 0.0, 0.1).time.tolist() == pytest.approx([0, 2, 2.2, 4.2])
    assert Track.of(Toolpath(**wall, pause=0.3), 0.0, 0.1).time.tolist() == pytest.approx([0, 2, 2.3, 4.3])


def test_every_second_layer_of_an_open_path_goes_back():
    wall = {"kind": "wall", "start": (0, 0), "end": (1, 0), "speed": 0.5, "layers": 4, "layer_height": 0.1}
    track = Track.of(Toolpath(**wall), 0.0, 0.1)
    assert track.position[:, 0].tolist() == [0, 1, 1, 0, 0, 1, 1, 0]
    assert track.release_time(np.array([1.0, 3.0, 5.0, 7.0])) == pytest.approx([1.0, 3.2, 5.4, 7.6])


def test_a_fixed_nozzle_feeds_for_its_dwell_on_every_layer():
    path = Toolpath(kind="line", start=(1, 2), end=(5, 5), speed=0.0, dwell=3.0, layers=2, layer_height=0.1, pause=0.5)
    track = Track.of(path, 0.0, 0.2)
    assert track.time.tolist() == [0.0, 3.0, 3.5, 6.5] and track.extruding.tolist() == [0.0, 3.0, 3.0, 6.0]
    assert track.position[:, :2].tolist() == [[1, 2], [1, 2], [5, 5], [5, 5]]  # open paths go back and forth
    assert track.position[:, 2] == pytest.approx([0.2, 0.2, 0.3, 0.3])
    assert track.layer_at(np.array([2.9, 3.4, 3.6, 6.4])).tolist() == [0, 0, 1, 1]
    hasty = Toolpath(start=(1, 2), speed=0.0, dwell=3.0, layers=2, layer_height=0.1)
    assert Track.of(hasty, 0.0, 0.2).time.tolist() == [0.0, 3.0, 3.0, 6.0]
    single = Track.of(Toolpath(start=(1, 2), speed=0.0, dwell=3.0), 0.0, 0.2)
    assert single.time.tolist() == [0.0, 3.0] and single.velocity_in.tolist() == [[0, 0, 0]]
    assert single.at(2.0).tolist() == [1, 2, 0.2] and single.layer.tolist() == [0]


def test_a_ring_is_180_chords_and_always_goes_the_same_way_round():
    path = Toolpath(kind="ring", center=(1, 2), radius=0.5, speed=2.0, layers=2, layer_height=0.1)
    corners = path.corners()
    assert corners.shape == (181, 2)
    assert corners[[0, 45, 90, 135, 180]] == pytest.approx(np.array([[1.5, 2], [1, 2.5], [0.5, 2], [1, 1.5], [1.5, 2]]))
    assert path.length() == pytest.approx(180 * 2 * 0.5 * math.sin(math.pi / 180))
    track, turn = Track.of(path, 0.0, 0.1), path.length() / 2.0
    assert track.at(turn / 4)[:2] == pytest.approx([1, 2.5])
    assert track.at(turn + 0.05 + turn / 4) == pytest.approx([1, 2.5, 0.2])
    assert track.velocity_in[0] == pytest.approx([-2 * math.sin(math.pi / 180), 2 * math.cos(math.pi / 180), 0])


def test_corners_of_lines_and_walls():
    assert Toolpath(kind="wall", start=(0, 1), end=(2, 3), speed=1.0).corners().tolist() == [[0, 1], [2, 3]]
    assert Toolpath(start=(0, 1), speed=0.0, dwell=1.0).corners().tolist() == [[0, 1], [0, 1]]


NOWHERE = {"start": None, "end": None}
LINE = {"kind": "line", "start": (0, 0), "end": (1, 0), "speed": 1.0}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": None}, "a line needs start"),
        ({"kind": "wall", "end": None}, "a wall needs end"),
        ({"kind": "wall", "start": None, "end": None}, "a wall needs start and end"),
        ({"kind": "polyline", **NOWHERE}, "a polyline needs points"),
        ({"kind": "ring", "radius": 1.0, **NOWHERE}, "a ring needs center"),
        ({"kind": "ring", "center": (0, 0), **NOWHERE}, "a ring needs radius"),
        ({"dwell": 1.0}, "dwell has no effect"),
        ({"kind": "polyline", "points": ((0, 0),), **NOWHERE}, "at least two points"),
        ({"kind": "polyline", "points": (), "speed": 0.0, "dwell": 1.0, **NOWHERE}, "at least two points"),
        ({"kind": "polyline", "points": ((0, 0), (1, 0)), "end": None}, "start has no effect"),
        ({"kind": "polyline", "points": ((0, 0), (1, 0)), "start": None}, "end has no effect"),
        ({"points": ((0, 0), (1, 0))}, "points has no effect"),
        ({"center": (0, 0)}, "center has no effect"),
        ({"kind": "wall", "radius": 1.0}, "radius has no effect"),
        ({"layers": 2}, "more than one layer needs layer_height"),
        ({"speed": 0.0}, "needs dwell"),
        ({"end": None}, "the path has no length"),
        ({"end": (0, 0)}, "the path has no length"),
        ({"speed": -1.0}, "greater than or equal to 0"),
        ({"layers": 0}, "greater than or equal to 1"),
        ({"layers": 10_001, "layer_height": 0.1}, "less than or equal to 10000"),
        ({"layer_height": 0.0}, "greater than 0"),
        ({"pause": -0.1}, "greater than or equal to 0"),
        ({"dwell": 0.0}, "greater than 0"),
        ({"detour": 1.0}, "Extra inputs"),
    ],
)
def test_paths_that_make_no_sense_are_refused(change, words):
    with pytest.raises(ValidationError, match=words):
        Toolpath(**{**LINE, **change})


def test_paths_at_the_edge_of_sense_are_accepted():
    path = Toolpath(**LINE)
    assert path.layers == 1 and path.pause == 0.0 and path.length() == 1.0
    assert Toolpath(**{**LINE, "layers": 10_000, "layer_height": 1e-9}).layers == 10_000
    assert Toolpath(start=(0, 0), end=(1, 0), speed=0.0, dwell=1.0).length() == 1.0
    assert Toolpath(kind="polyline", points=((0, 0), (3, 4)), speed=1.0).length() == 5.0
    assert Toolpath(kind="polyline", points=((3, 4),), speed=0.0, dwell=1.0).corners().tolist() == [[3, 4]]
    with pytest.raises(ValidationError, match="frozen"):
        path.speed = 2.0
