"""Beads, layers, slump and spread of deposits whose size is known to the cell, and what they are averaged over."""

import numpy as np
import pytest

from fluidbench.measure.bead import Bead, laid_share, layer_heights, measure_bead
from fluidbench.measure.deposit import Deposit
from fluidbench.measure.slump import front, measure_slump, radial_heights, spread_radius

from ..conftest import bead, scenario

D = 0.002
FLOOR = 0.1
DOMAIN = {"lower": [-0.02, -0.04, FLOOR], "upper": [0.06, 0.04, FLOOR + 0.03]}
LINE = {"kind": "line", "start": [0.0, 0.0], "end": [0.031, 0.0], "speed": 0.1}


def paste(**more):
    return bead(**{"domain": DOMAIN, "toolpath": LINE, **more})


def block(x=(0, 40), y=(16, 24), z=(0, 5)):
    """A block of full cells of edge D, numbered from the domain's lower corner; it is wide open to every side."""
    fill = np.zeros((40, 40, 8))
    fill[slice(*x), slice(*y), slice(*z)] = 1.0
    return Deposit(np.array(DOMAIN["lower"]) + D / 2, D, fill)


def test_a_block_under_the_path_has_its_width_height_and_area():
    """8 cells wide and 5 high; the blur takes a third less from sharp edges than is given back to round ones."""
    made = measure_bead(block(), paste())
    assert made.width == pytest.approx(np.full(15, 8 * D)) and made.height == pytest.approx(np.full(15, 5 * D))
    assert made.area == pytest.approx(np.full(15, 40 * D**2), rel=0.01)
    assert made.matter == pytest.approx(np.full(15, 40 * D**2), rel=1e-3)
    assert made.station == pytest.approx(np.linspace(0.0, 0.031, 15))
    assert made.middle.width == pytest.approx(8 * D) and made.middle.area == made.area[7]
    summary = made.summary(1)
    assert summary["bead_width_m"] == pytest.approx(8 * D) and summary["bead_height_m"] == pytest.approx(5 * D)
    assert summary["bead_area_m2"] == pytest.approx(made.area[7]) and summary["bead_continuity"] == 1.0
    assert made.summary(4)["bead_area_m2"] == pytest.approx(made.area[7] / 4)


def test_each_section_is_taken_at_its_own_place_on_the_path():
    """8 cells wide up to x = 14 mm, 12 beyond; the middle one of 15 lies at 15.5 mm, a third of the way at 11."""
    deposit = block()
    deposit.fill[17:, 14:26, :5] = 1.0
    made = measure_bead(deposit, paste())
    near = np.abs(made.station - 0.014) < 2 * D
    assert made.width[~near] == pytest.approx(np.where(made.station < 0.014, 8, 12)[~near] * D) and near.sum() == 4
    assert made.middle.width == made.width[7] > made.width[5]
    begun = measure_bead(deposit, paste(), laid=0.5)  # the middle of what was laid
    assert begun.middle.width == made.width[3] < begun.width[7] and begun.laid == 0.5 and made.laid == 1.0


def test_sections_stand_square_to_the_leg_they_lie_on():
    """A strip along x: cut across by the first leg, lengthwise by the second, to the reach of 2.5 diameters."""
    path = {"kind": "polyline", "points": [[0.0, 0.0], [0.03, 0.0], [0.03, 0.02]], "speed": 0.1}
    made = measure_bead(block(y=(16, 40)), paste(toolpath=path))
    first = made.station < 0.03
    # 25 are a spacing apart; those within a nozzle's diameter, 0.012, of the corner would cut both legs
    assert len(made.station) == 13 and (~first).sum() == 4
    assert made.station[first].max() <= 0.018 and made.station[~first].min() >= 0.042
    assert made.width[first] == pytest.approx(np.full(9, 12.0 * D + 0.014), abs=D)  # from -0.008 to the reach of 0.03
    assert made.width[~first] == pytest.approx(np.full(4, 0.06), abs=D / 3)


@pytest.mark.parametrize(
    ("more", "reach"),
    [
        ({}, 0.03),
        ({"material": {"density": 100.0, "expansion": {"ratio": 8.0}}}, 0.06),
        ({"toolpath": {"kind": "ring", "center": [0.02, 0.0], "radius": 0.015, "speed": 0.1}}, 0.015),
        ({"toolpath": {"kind": "ring", "center": [0.02, 0.0], "radius": 0.031, "speed": 0.1}}, 0.03),
    ],
)
def test_sections_reach_two_and_a_half_diameters_and_no_ring_to_its_other_side(more, reach):
    domain = {"lower": [-0.1, -0.1, FLOOR], "upper": [0.1, 0.1, FLOOR + 0.03]}
    wide = Deposit(np.array(domain["lower"]) + D / 2, D, np.ones((100, 100, 8)))
    made = measure_bead(wide, paste(domain=domain, **more))
    assert made.width == pytest.approx(np.full(len(made.width), 2 * reach), abs=D / 3)


@pytest.mark.parametrize(("length", "count"), [(0.01, 12), (0.0251, 12), (0.0271, 13), (0.2, 100), (0.5, 160)])
def test_there_is_a_section_a_spacing_within_limits(length, count):
    domain = {"lower": [-0.02, -0.04, FLOOR], "upper": [0.6, 0.04, FLOOR + 0.03]}
    thin = Deposit(np.array(DOMAIN["lower"]) + D / 2, D, np.ones((3, 3, 1)))
    made = measure_bead(thin, paste(domain=domain, toolpath={**LINE, "end": [length, 0.0]}))
    assert len(made.station) == count and made.station[-1] == pytest.approx(length)


def test_no_bead_without_a_moving_nozzle():
    assert measure_bead(block(), scenario()) is None
    fixed = {"kind": "line", "start": [0.0, 0.0], "speed": 0.0, "dwell": 1.0}
    assert measure_bead(block(), paste(toolpath=fixed)) is None


def by_hand(width, area, laid=1.0, begun=0.0):
    station, width = np.linspace(0.0, 2.0, len(width)), np.array(width, float)
    area = np.array(area, float)
    return Bead(station, width, 10.0 * width, area, 0.9 * area, middle=None, laid=laid, begun=begun)


@pytest.mark.parametrize("count", [11, 201])
def test_averages_run_over_the_middle_three_fifths(count):
    share = np.arange(count) / (count - 1)
    inner = (share > 0.199) & (share < 0.801)
    made = by_hand(np.where(inner, 8.0 * share, 1e3), np.where(inner, 6.0 * share, 1e3))
    summary = made.summary(3)
    assert summary["bead_width_m"] == pytest.approx(4.0) and summary["bead_height_m"] == pytest.approx(40.0)
    assert summary["bead_area_m2"] == pytest.approx(3.0 / 3) and summary["bead_matter_m2"] == pytest.approx(0.9)


def test_averages_run_over_the_middle_of_what_was_laid():
    """Of half of the path: stations from a tenth to four tenths of it; of next to nothing: nothing."""
    share = np.arange(201) / 200
    inner = (share > 0.099) & (share < 0.401)
    values = np.where(inner, 8.0 * share, 1e3)
    summary = by_hand(values, values, laid=0.5).summary(1)
    assert summary["bead_width_m"] == pytest.approx(2.0) and summary["bead_area_m2"] == pytest.approx(2.0)
    assert by_hand(values, values, laid=0.004).summary(1) == {}
    whole = Bead(*[np.ones(3)] * 5, middle=None)
    assert whole.laid == 1.0 and whole.begun == 0.0


def test_averages_begin_where_the_strand_no_longer_feels_its_begin():
    """Of 2 m the stations from 0.7 on instead of 0.4; not if that leaves less than half of the path."""
    station = np.linspace(0.0, 2.0, 201)
    for begun, mean in ((0.3, 1.0), (0.7, 1.15), (1.0, 1.3), (1.01, 1.0)):
        assert by_hand(station, station, begun=begun).summary(1)["bead_width_m"] == pytest.approx(mean)
    begun = measure_bead(block(), paste()).begun
    assert begun == pytest.approx(3 * paste().nozzle.diameter)


def test_the_share_that_was_laid_follows_from_the_last_release():
    """10 mm of 31 at 0.1 m/s after 0.1 s, and a disc of 2 mm, both of the path and of the column, that may be early."""
    births = np.array([0.05, 0.1, 0.02])
    assert laid_share(births, paste()) == pytest.approx((0.01 + 0.004) / 0.031)
    assert laid_share(np.array([0.28]), paste()) == 1.0 and laid_share(np.array([]), paste()) == 1.0
    slow = paste(nozzle={"diameter": 0.012, "exit_speed": 0.05, "standoff": 0.01})
    assert laid_share(births, slow) == pytest.approx((0.01 + 0.006) / 0.031)
    wall = {**LINE, "kind": "wall", "layers": 2, "layer_height": 0.005, "pause": 0.2}
    assert laid_share(np.array([0.6]), paste(toolpath=wall)) == 1.0  # whatever of the second layer
    fixed = {"kind": "line", "start": [0.0, 0.0], "speed": 0.0, "dwell": 1.0}
    assert laid_share(births, paste(toolpath=fixed)) == 1.0 == laid_share(births, scenario())


@pytest.mark.parametrize(
    ("inner", "continuity"),
    [
        ([2, 2, 2, 2, 2, 2, 2], 1.0),
        ([2, 2, 1.02, 2, 2, 2, 2], 1.0),
        ([2, 2, 0.98, 2, 2, 2, 2], 6 / 7),
        ([2, 2, 1.0, 2, 2, 2, 2], 6 / 7),
        ([2, 0.08, 0.08, 2, 2, 0.0, 2], 4 / 7),
        ([0, 0, 0, 0, 0, 0, 0], 0.0),
        ([0, 0, 0, 0, 0, 0, 3], 1 / 7),
        ([9, 9, 2, 2, 2, 0.98, 0.98], 5 / 7),  # the median, not the mean
    ],
)
def test_continuity_is_the_share_of_sections_above_half_the_median(inner, continuity):
    made = by_hand(np.ones(11), [0, 0, *inner, 0, 0])
    assert made.summary(1)["bead_continuity"] == pytest.approx(continuity)


def test_layers_rise_from_mean_to_mean_by_the_time_they_were_laid():
    """Layers of 0.31 s with pauses of 0.2 s: 0 .. 0.31, 0.51 .. 0.82, 1.02 .. 1.33."""
    path = {**LINE, "kind": "wall", "layers": 3, "layer_height": 0.005, "pause": 0.2}
    s = paste(toolpath=path, duration=1.4)
    birth = np.array([0.1, 0.2, 0.31, 0.52, 0.82, 1.03, 1.33])
    height = np.array([1.0, 2.0, 3.0, 7.0, 8.0, 10.0, 11.0])
    position = np.stack([np.zeros(7), np.zeros(7), height], axis=1)
    assert layer_heights(position, birth, s) == pytest.approx([5.5, 3.0])
    middle_missing = np.array([0, 1, 2, 5, 6])
    assert layer_heights(position[middle_missing], birth[middle_missing], s) == pytest.approx([8.5])
    assert layer_heights(position, birth, paste()) == [] == layer_heights(position, birth, scenario())
    two = paste(toolpath={**path, "layers": 2}, duration=1.4)
    assert layer_heights(position, np.minimum(birth, 0.8), two) == pytest.approx([7.0])


def heap(heights, origin=(0.01, 0.01, 0.01), spacing=0.01, cells=8):
    """A deposit whose columns are this high, in cells."""
    heights = np.array(heights, float)[..., None]
    return Deposit(np.array(origin), spacing, np.clip(heights - np.arange(cells), 0.0, 1.0))


def test_heights_of_rings_about_an_axis():
    """About the middle of 5 x 5 columns: 1 at the axis, 8 at one, 12 at two and 4 corners at three spacings."""
    heights = np.zeros((5, 5))
    heights[2, 2], heights[1:4, 2], heights[0, 0] = 5.0, [4.0, 5.0, 2.0], 8.0
    radius, mean = radial_heights(heap(heights), 0.03, 0.03)
    root = np.sqrt
    expected = [0, (4 + 4 * root(2)) / 8, (4 * 2 + 8 * root(5)) / 12, 2 * root(2)]
    assert radius == pytest.approx(0.01 * np.array(expected))
    assert mean == pytest.approx(0.01 * np.array([5, 6 / 8, 0, 8 / 4]))
    radius, _ = radial_heights(heap(heights[:1]), 0.04, 0.03)  # no column within the first rings
    assert radius == pytest.approx(0.01 * np.array([(3 + 2 * root(10)) / 3, root(13)]))


def test_the_front_lies_where_the_mean_height_falls_below_one_spacing():
    """Means over y of 4, 3, 1.5, 0.5 and 0 cells: one spacing is midway between the third and the fourth."""
    profile = np.array([4, 3, 1.5, 0.5, 0.0])
    assert front(heap(np.stack([profile, profile], axis=1))) == pytest.approx(0.035)
    assert front(heap(np.stack([profile + 0.25, profile - 0.25], axis=1).clip(0))) == pytest.approx(0.035)
    assert front(heap([[0.5], [0.2]])) == 0.01  # nowhere a spacing high: the first column
    assert front(heap([[2.0], [1.0], [1.0]])) == pytest.approx(0.03)  # nowhere lower: the last
    assert front(heap([[2.0], [0.5], [3.0], [0.0]])) == pytest.approx(0.03 + 0.01 * 2 / 3)  # the last fall counts
    assert front(heap([[2.0], [1.0], [0.0]])) == pytest.approx(0.02)


def test_the_spread_is_the_radius_of_that_fall():
    heights = np.zeros((7, 7))
    gx, gy = np.meshgrid(range(-3, 4), range(-3, 4))
    heights[np.rint(np.hypot(gx, gy)) <= 2] = 3.0
    inner, outer = (4 * 2 + 8 * 5**0.5) / 12, np.hypot(gx, gy)[np.rint(np.hypot(gx, gy)) == 3].mean()
    expected = 0.01 * (inner + 2 / 3 * (outer - inner))
    assert spread_radius(heap(heights), 0.04, 0.04) == pytest.approx(expected)


def test_slump_and_spread_of_a_cylinder_are_counted_from_the_floor():
    """It stood 0.08 m above a floor at 0.005 m; 5 columns within a quarter of its radius reach 6 cells, others 7. Their
    neighbours across the diagonal are 14.1 mm away."""
    body = {"kind": "cylinder", "center": [0.08, 0.07, 0.045], "radius": 0.042, "height": 0.08}
    domain = {"lower": [0, 0, 0.005], "upper": [0.2, 0.2, 0.2]}
    heights = np.full((15, 15), 7.0)
    heights[6:9, 6] = heights[7, 5:8] = 6.0
    deposit = heap(heights)
    got = measure_slump(deposit, scenario(bodies=[body], domain=domain))
    assert got["slump"] == pytest.approx(1.0 - 0.06 / 0.08)
    assert got["spread_radius_m"] == spread_radius(deposit, 0.08, 0.07) and len(got) == 2
    for radius, top in ((0.055, 0.06), (0.058, 0.07)):
        wide = measure_slump(deposit, scenario(bodies=[{**body, "radius": radius}], domain=domain))
        assert wide["slump"] == pytest.approx(1.0 - top / 0.08)


def test_front_and_height_of_a_box_are_counted_from_the_walls():
    body = {"kind": "box", "center": [0.04, 0.1, 0.02], "size": [0.04, 0.04, 0.04]}
    domain = {"lower": [0.004, 0, 0.005], "upper": [0.2, 0.2, 0.2]}
    deposit = heap([[4.0], [2.0], [0.0]])
    got = measure_slump(deposit, scenario(bodies=[body], domain=domain))
    assert got == pytest.approx({"front_x_m": 0.025 - 0.004, "height_m": 0.045 - 0.005})
    later = {**body, "start": 0.004}
    assert measure_slump(deposit, scenario(bodies=[body, later], domain=domain)) == {}
    ball = {"kind": "sphere", "center": [0.1, 0.1, 0.1], "radius": 0.03}
    assert measure_slump(deposit, scenario(bodies=[ball], domain=domain)) == {} == measure_slump(deposit, paste())
