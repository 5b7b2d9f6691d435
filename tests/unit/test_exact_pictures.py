"""What pictures show: sizes in the sketch, colours of particles, clouds on the page, scale bars, films in real time."""

import io

import numpy as np
import pytest
from matplotlib.image import imread

from fluidbench.errors import UserError
from fluidbench.report import figures
from fluidbench.report.figures import draw, figure_of, number_points
from fluidbench.report.page import interactive, turning
from fluidbench.report.plot import Cloud, Plot, Trace
from fluidbench.report.render import ruler, shown_at
from fluidbench.report.table import in_millimetres
from fluidbench.scenario.library import load
from fluidbench.study import compare_views as views
from fluidbench.study import sketch

from ..conftest import scenario
from .made import BEAD, finished


def test_a_sketch_tells_the_sizes_in_millimetres():
    assert sketch.sizes(BEAD) == ["bore 12 mm", "gap 10 mm", "exit 100 mm/s", "nozzle 100 mm/s", "spacing 1.5 mm"]
    assert sketch.sizes(load("wall"))[4] == "3 layers"
    assert len(sketch.sizes(load("dam_break"))) == 1
    assert sketch.sketch(BEAD).opens and "gap 10 mm" in sketch.sketch(BEAD).alt


@pytest.mark.parametrize("name", ["line_bead", "ring_tower_drone", "column_slump", "foam_tower"])
def test_what_is_sketched_lies_within_the_picture(name, monkeypatch):
    seen = []
    monkeypatch.setattr(sketch, "figure_of", lambda *size: seen.append(figure_of(*size)) or seen[-1])
    made = load(name)
    assert sketch.draw(made)[:4] == b"\x89PNG"
    for axes, up in zip(seen[0].axes, (2, 1), strict=True):
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        if made.track is not None:
            x, y = 1e3 * made.track.position[:, [0, up]].T
            assert left < x.min() and x.max() < right and low < y.min() and y.max() < high
        for cloud in axes.collections:
            x, y = np.asarray(cloud.get_offsets()).reshape(-1, 2).T
            assert not len(x) or (left < x.min() and x.max() < right and low <= y.min() and y.max() < high)


@pytest.mark.parametrize("height", [4.0, 8.6, 8.8, 12.0])
def test_nothing_of_a_plot_to_scale_is_cut_off(height):
    """A bead as wide and as high as the picture lost its title, others did not."""
    section = Trace("mpm", [-8.0, 0.0, 8.0], [0.1, height, 0.1])
    drawn = draw(Plot("section", "middle of the path", "y [mm]", "z [mm]", [section], equal=True))
    picture = imread(io.BytesIO(drawn))
    for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
        assert np.all(edge == 1.0)


def numbered():
    """Three points almost in one place, and one apart, of two methods."""
    near = Trace(
        "mpm", [1.0, 1.001, 1.002], [2.0, 2.001, 2.0], "points", "#0072B2", names=["softer", "larger dt", "no yield"]
    )
    return Plot("p", "p", "x", "y", [near, Trace("sph", [5.0], [9.0], "points", "#D55E00", names=["larger dt"])])


def test_points_with_names_have_numbers_that_cover_nothing_and_a_key(monkeypatch):
    plot, seen = numbered(), []
    assert plot.key == {"softer": 1, "larger dt": 2, "no yield": 3} and Plot("p", "p", "x", "y").key == {}
    monkeypatch.setattr(figures, "number_points", lambda *given: seen.extend(number_points(*given)))
    assert draw(plot)[:4] == b"\x89PNG"
    assert [(note.get_text(), note.get_color()) for note in seen] == [
        *((text, "#0072B2") for text in "123"),
        ("2", "#D55E00"),
    ]
    axes = seen[0].axes
    boxes = [note.get_window_extent() for note in seen]
    points = [axes.transData.transform(xy) for t in plot.traces for xy in zip(t.x, t.y, strict=True)]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert not any(box.contains(*point) for box in boxes for point in points)
    (key,) = [text.get_text() for text in axes.texts if text not in seen]
    assert key.splitlines() == ["1  softer", "2  larger dt", "3  no yield"]


def test_points_with_names_have_them_on_the_page_too():
    near, apart, *key = interactive(numbered()).data
    assert list(near.text) == ["1", "2", "3"] and list(near.hovertext) == ["softer", "larger dt", "no yield"]
    assert list(apart.text) == ["2"] and near.mode == "markers+text"
    assert [entry.name for entry in key] == ["1 softer", "2 larger dt", "3 no yield"]


def test_what_is_faded_keeps_its_colour():
    plain, faded = (
        interactive(Plot("p", "p", "x", "y", [Trace("mpm", [1.0], [1.0], "points", "#0072B2", faded=faded)])).data[0]
        for faded in (False, True)
    )
    assert (plain.opacity, faded.opacity) == (1.0, 0.3) and plain.line.color == faded.line.color == "#0072B2"
    at = imread(
        io.BytesIO(draw(Plot("p", "p", "x", "y", [Trace("mpm", [1.0], [1.0], "points", "#0072B2", faded=True)])))
    )
    mixed = 1.0 - 0.3 * (1.0 - np.array([0x00, 0x72, 0xB2]) / 255)
    assert np.any(np.all(np.abs(at[..., :3] - mixed) < 0.01, axis=-1))


def frame(speeds, births):
    n = len(speeds)
    x = np.linspace(0.0, 1.0, n)
    velocity = np.stack([speeds, np.zeros(n), np.zeros(n)], axis=1)
    return {"position": np.stack([x, x, x], axis=1), "velocity": velocity, "birth_time": births, "time": 1.05}


def run_of(made):
    return finished(input=made.model_dump(mode="json"))


def test_colours_are_speed_while_it_moves_then_layer_or_time_of_laying():
    births = np.array([0.1, 0.5, 0.8])
    still, moving = frame(np.zeros(3), births), frame(np.full(3, 0.05), births)
    scale = views._scale([run_of(BEAD)], [still])
    assert (scale.label, scale.limits) == ("laid at [s]", (0.0, BEAD.track.end)) and (
        scale.value(still) == births
    ).all()
    scale = views._scale([run_of(BEAD)], [still, moving])
    assert (scale.label, scale.limits) == ("speed [m/s]", (0.0, pytest.approx(0.05)))
    wall = load("wall")
    late = frame(np.zeros(2), np.array([0.1, wall.track.end]))
    scale = views._scale([run_of(wall)], [late])
    assert (scale.label, scale.limits) == ("layer", (1.0, 3.0)) and scale.value(late).tolist() == [1.0, 3.0]
    assert views._scale([run_of(scenario())], [still]).label == "speed [m/s]"


def test_one_fast_particle_leaves_the_others_their_colours():
    speeds = np.full(1000, 0.001)
    speeds[0] = 1.0
    assert views._scale([run_of(BEAD)], [frame(speeds, np.zeros(1000))]).label == "laid at [s]"


def test_a_cloud_is_thinned_and_says_so(monkeypatch):
    monkeypatch.setattr(views, "MOST", 2)
    run = run_of(BEAD)
    monkeypatch.setattr(type(run), "frame", lambda _: frame(np.zeros(3), np.array([0.1, 0.5, 0.8])))
    (cloud,) = views.clouds([run, finished("sph", "diverged")])
    assert cloud.title == "mpm, t = 1.05 s, 2 of 3 particles" and cloud.position.shape == (2, 3)
    assert cloud.position.max() <= 1e3 and cloud.size == 1.5


def test_a_cloud_on_the_page_is_to_scale():
    position = np.array([[0.0, 0.0, 0.0], [130.0, 10.0, 1.0]])
    figure = turning(Cloud("mpm", "mpm at the end", position, np.array([0.0, 1.0]), "layer", (1.0, 2.0), 1.5))
    (points,) = figure.data
    assert list(points.x) == [0.0, 130.0] and figure.layout.scene.aspectmode == "data"
    assert points.marker.size == pytest.approx(3.0) and (points.marker.cmin, points.marker.cmax) == (1.0, 2.0)
    assert figure.layout.scene.xaxis.title.text == "x [mm]"
    alone = turning(Cloud("mpm", "one", position[:1], np.zeros(1), "layer", (1.0, 2.0), 1.5))
    assert alone.data[0].marker.size == 14.0  # one particle, no larger than a thumb


@pytest.mark.parametrize(("longest", "length"), [(0.03, 0.02), (0.05, 0.05), (0.0499, 0.02), (1.0, 1.0), (9.0, 5.0)])
def test_a_scale_bar_is_a_round_length(longest, length):
    assert ruler(longest) == pytest.approx(length)


def test_a_film_takes_as_long_as_what_it_shows():
    times = np.array([0.0, 0.5, 0.6, 2.0])
    shown = shown_at(times, 1.0)
    assert len(shown) == 41 and shown[0] == 0 and shown[9] == 0 and shown[10] == 1 and shown[12] == 2
    assert shown[39] == 2 and shown[40] == 3
    assert len(shown_at(times, 2.0)) == 21 and len(shown_at(times, 0.5)) == 81
    assert len(shown_at(times, 100.0)) == 2
    with pytest.raises(UserError, match="4e\\+07 pictures; a film has 20000 at most"):
        shown_at(times, 1e-6)


def test_lengths_below_a_metre_read_in_millimetres():
    assert in_millimetres("front [m]", [0.2, -0.3]) == ("front [mm]", 1e3)
    assert in_millimetres("front [m]", [0.2, 1.0]) == ("front [m]", 1.0)
    assert in_millimetres("bead area [m^2]", [1e-4, float("nan")]) == ("bead area [mm²]", 1e6)
    assert in_millimetres("bead area [m²]", [1e-4]) == ("bead area [mm²]", 1e6)
    assert in_millimetres("energy [J]", [1e-4]) == ("energy [J]", 1.0)
    assert in_millimetres("front [m]", []) == ("front [m]", 1.0)
