"""Sectors, coordinates, quantiles, layers, heights and criteria of a print, each by hand."""

import math

import numpy as np
import pytest

from fluidbench.measure import tower
from fluidbench.measure.tower import layer_of, measure_tower
from fluidbench.method.frame import CARRIED, CLAMPED, FREE

from ..conftest import scenario
from .made import DIAMETER, PASTE, RATE, RING, RISE, tower_of, wall

ELL = tower_of({"kind": "polyline", "points": [[0.0, 0.0], [0.3, 0.0], [0.3, 0.1]]})


def test_a_tower_has_several_layers_of_a_nozzle_that_moves():
    assert tower.is_tower(wall()) and not tower.is_tower(scenario())
    assert tower.is_tower(tower_of({"kind": "line", "start": [0, 0], "end": [0.1, 0], "layers": 2}))
    assert not tower.is_tower(tower_of({"kind": "line", "start": [0, 0], "end": [0.1, 0], "layers": 1}))
    fixed = {"kind": "line", "start": [0, 0], "speed": 0.0, "dwell": 1.0}
    assert not tower.is_tower(tower_of(fixed))
    assert tower.plan_height(wall()) == pytest.approx(3 * RISE)
    assert (
        tower.plan_height(
            tower_of({"kind": "wall", "start": [0, 0], "end": [0.1, 0], "layers": 1, "layer_height": None})
        )
        == 0.01
    )


@pytest.mark.parametrize(
    ("made", "margin", "count"),
    [
        (wall(0.2), 0.064, 38),  # (0.2 - 2 x 0.0128) / 4.5 mm = 38.76
        (wall(0.11605), 0.0128 / 0.11605, 20),  # 20.1
        (wall(0.04), 0.25, 4),  # a quarter at either end; 20 mm
        (wall(0.04, spacing=6e-3), 0.25, 1),
        (wall(0.02, spacing=6e-3), 0.25, 1),  # shorter than a sector
        (wall(1.0, spacing=6e-3), 0.0128, 48),
        (RING, 0.0, 48),
    ],
)
def test_sectors_are_three_spacings_and_leave_the_ends_out(made, margin, count):
    edges = tower._sector_edges(made)
    assert len(edges) == count + 1 and edges[0] == pytest.approx(margin) and edges[-1] == pytest.approx(1 - margin)
    assert np.ptp(np.diff(edges)) < 1e-12
    inside = tower._in_middle(np.array([edges[0] - 1e-9, edges[0], 0.5, edges[-1], edges[-1] + 1e-9]), made)
    assert inside.tolist() == [False, True, True, True, False]


def test_coordinates_along_a_path_of_legs():
    """Left of the direction of travel is positive; the nearest leg counts."""
    points = {
        (0.15, 0.02, 0.0): (0.375, 0.02, 0.01),
        (0.15, -0.02, 0.005): (0.375, -0.02, 0.015),
        (0.28, 0.06, -0.01): (0.9, 0.02, 0.0),
        (0.33, 0.05, 0.0): (0.875, -0.03, 0.01),
        (-0.05, 0.01, 0.0): (0.0, 0.01, 0.01),
        (0.29, 0.15, 0.0): (1.0, 0.01, 0.01),
        (0.28, 0.019, 0.0): (0.7, 0.019, 0.01),
    }
    got = np.stack(tower._path_coordinates(np.array(list(points)), ELL), axis=1)
    assert got == pytest.approx(np.array(list(points.values())))


def test_coordinates_around_a_ring():
    """A quarter turn is a quarter of the path; outside is positive; just before the start the share is nearly 1."""
    points = {
        (0.15, -0.2): (0.0, 0.0),
        (0.1, -0.12): (0.25, 0.03),
        (0.07, -0.2): (0.5, -0.02),
        (0.1, -0.25): (0.75, 0.0),
        (0.1 + 0.05 * math.cos(-0.1), -0.2 + 0.05 * math.sin(-0.1)): (1 - 0.1 / (2 * math.pi), 0.0),
    }
    x = np.array([[*p, 0.02] for p in points])
    along, across, up = tower._path_coordinates(x, RING)
    assert np.stack([along, across], axis=1) == pytest.approx(np.array(list(points.values())), abs=1e-12)
    assert up == pytest.approx(np.full(5, 0.03))


def test_quantiles_are_of_mass():
    values, weights = np.array([3.0, 1.0, 2.0, 4.0]), np.array([1.0, 1.0, 2.0, 4.0])
    got = {
        share: tower._quantile(values, weights, share) for share in (0.01, 0.125, 0.13, 0.375, 0.4, 0.5, 0.51, 1.0, 1.1)
    }
    assert got == {0.01: 1.0, 0.125: 1.0, 0.13: 2.0, 0.375: 2.0, 0.4: 3.0, 0.5: 3.0, 0.51: 4.0, 1.0: 4.0, 1.1: 4.0}
    hundred = np.arange(100.0)[::-1]
    ones = np.ones(100)
    assert tower._spread(hundred, ones) == 90.0  # from 4 to 94
    assert tower._trimmed_mean(hundred, ones) == pytest.approx(49.0)
    heavy = np.where(hundred == 50.0, 11.0, 1.0)  # of 110: from 5 to 94 lie 90 values and ten more at 50
    assert tower._trimmed_mean(hundred, heavy) == pytest.approx((90 * 49.5 + 10 * 50.0) / 100)


def frame(position, birth, mass=1.0, held=FREE, **more):
    n = len(position)
    columns = {
        "position": np.array(position, float),
        "mass": np.broadcast_to(mass, n).astype(float),
        "birth_time": np.broadcast_to(birth, n).astype(float),
        "held": np.broadcast_to(held, n),
    }
    return columns | {key: np.broadcast_to(value, n).astype(float) for key, value in more.items()}


def test_material_is_of_the_layer_during_which_it_left_the_nozzle():
    """Layers of 2 s with a pause of 0.1 s between them; what leaves at the end of one is still of it."""
    births = [0.5, 2.0, 2.1, 2.1 + 1e-6, 4.0, 4.3, 6.2]
    made = frame(np.zeros((7, 3)), births)
    assert layer_of(made, wall()).tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert layer_of(
        made | {"held": np.array([CARRIED, FREE, CLAMPED, CARRIED, FREE, FREE, FREE])}, wall()
    ).tolist() == [-1, 0, 0, -1, 1, 2, 2]


def test_a_layer_is_measured_in_the_middle_of_its_path():
    """Twenty-one particles 1 mm apart across the path, at heights that rise by half a millimetre; ends do not count."""
    k = np.arange(21.0)
    middle = np.stack([np.full(21, 0.1), (k - 10) * 1e-3, -0.01 + 0.005 + k * 5e-4], axis=1)
    ends = np.array([[0.001, 0.0, 0.05], [0.199, 0.0, 0.05]])
    row = measure_tower(frame(np.concatenate([middle, ends]), 0.5, [1.0] * 21 + [1e-9] * 2), wall())
    assert row["layer_1_level_m"] == pytest.approx(0.010) and "layer_2_level_m" not in row
    assert row["layer_1_width_m"] == pytest.approx(0.018 / 0.9)  # from -9 mm to 9 mm lie nine tenths of the mass
    assert "layer_1_radius_m" not in row
    second = measure_tower(frame(middle, 3.0), wall())
    assert {name.split("_")[1] for name in second} == {"2"}
    outside = measure_tower(frame(ends, 0.5), wall())
    assert "layer_1_level_m" not in outside and outside["layer_1_continuity"] == 0.0


def test_a_ring_has_a_radius_and_a_drift():
    """Four points 3 mm outside and, of a third of the mass, 1 mm inside, moved by (3, 4) mm: the drift is 5 mm."""
    turn = np.arange(400) * 2 * np.pi / 400
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    flat = np.concatenate([0.053 * circle, 0.049 * circle]) + np.array([0.1, -0.2])
    mass = np.repeat([3.0, 1.0], 400)
    still = measure_tower(frame(np.column_stack([flat, np.zeros(800)]), 0.5, mass), RING)
    assert still["layer_1_radius_m"] == pytest.approx(0.052) and still["layer_1_drift_m"] == pytest.approx(
        0.0, abs=1e-12
    )
    moved = measure_tower(frame(np.column_stack([flat + np.array([3e-3, 4e-3]), np.zeros(800)]), 0.5, mass), RING)
    assert moved["layer_1_drift_m"] == pytest.approx(5e-3)


def held_in_sectors(made, share, across=0.0):
    """One particle in the middle of each sector, of so much of the mass that is laid there."""
    edges = tower._sector_edges(made)
    middle = 0.5 * (edges[1:] + edges[:-1])
    laid = made.material.density * RATE / 0.1 * 0.2 * np.diff(edges)
    return tower._continuity(middle, np.full(len(middle), across), share * laid, made)


def test_a_sector_holds_its_layer_with_two_fifths_of_what_is_laid():
    s = wall()
    n = len(tower._sector_edges(s)) - 1
    shares = np.full(n, 0.41)
    assert held_in_sectors(s, shares) == 1.0 and held_in_sectors(s, 0.39) == 0.0
    shares[:7] = 0.39
    assert held_in_sectors(s, shares) == pytest.approx((n - 7) / n)


def test_material_counts_within_one_and_a_half_nozzles_of_what_it_has_become():
    foam = wall(material={**PASTE, "expansion": {"ratio": 8.0}})
    reach = 1.5 * DIAMETER
    for made, wide in ((wall(), reach), (foam, 2 * reach)):
        assert [held_in_sectors(made, 1.0, side * wide) for side in (-0.999, 0.999, 1.0, -1.001, 1.001)] == [
            1,
            1,
            1,
            0,
            0,
        ]
