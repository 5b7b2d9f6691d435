"""A solid of revolution: distances and normals about a ring of rectangular section, by hand."""

import numpy as np
import pytest

from fluidbench.scenario import Nozzle
from fluidbench.scenario.outline import Outline

RING = Outline(np.array([[0.5, -1.0], [0.5, 3.0], [1.5, 3.0], [1.5, -1.0]]))


@pytest.mark.parametrize(
    ("r", "z", "distance", "normal"),
    [
        (0.2, 0.0, 0.3, (-1, 0)),  # in the bore
        (0.7, 0.0, -0.2, (-1, 0)),  # in the body
        (1.0, -1.4, 0.4, (0, -1)),  # under the face
        (1.0, -0.9, -0.1, (0, -1)),
        (2.0, 1.0, 0.5, (1, 0)),  # beside it
        (1.8, -1.4, 0.5, (0.6, -0.8)),  # off the rim
        (0.2, -1.4, 0.5, (-0.6, -0.8)),  # off the mouth
        (1.0, 3.25, 0.25, (0, 1)),
    ],
)
def test_distance_and_normal(r, z, distance, normal):
    at = np.array(r), np.array(z)
    assert RING.distance(*at) == pytest.approx(distance, abs=1e-12)
    assert RING.normal(*at, 1e-4) == pytest.approx(np.array(normal, float), abs=1e-4)


def test_distance_never_grows_faster_than_way():
    rng = np.random.default_rng(0)
    a, b = rng.uniform([0.0, -3.0], [3.0, 4.0], (2, 4000, 2))
    grown = np.abs(RING.distance(*a.T) - RING.distance(*b.T))
    assert (grown <= np.linalg.norm(a - b, axis=1) + 1e-12).all()


def test_a_nozzles_body_is_seen_from_where_matter_is_let_go():
    """Bore of 20 mm, 10 mm wide, face of 30 mm."""
    nozzle = Nozzle(
        diameter=0.01, exit_speed=1.0, standoff=0.01, tip="flat", bore=0.02, outer_diameter=0.03, walls="slip"
    )
    assert nozzle.outline.slips and nozzle.rise == 0.02 and nozzle.face == 0.015
    r, z = np.array([0.0, 0.01, 0.004]), np.array([-0.021, -0.023, 0.0])
    assert nozzle.outline.distance(r, z) == pytest.approx([np.hypot(0.005, 0.001), 0.003, 0.001])
    assert Nozzle(diameter=0.01, exit_speed=1.0, standoff=0.01).outline is None


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"bore": 0.01}, "bore has no effect without a tip"),
        ({"walls": "slip"}, "walls has no effect without a tip"),
        ({"outer_diameter": 0.03}, "outer_diameter has no effect without a tip"),
        ({"tip": "flat", "outer_diameter": 0.01}, "outer_diameter must exceed diameter = 0.01"),
    ],
)
def test_keys_that_cannot_be_meant_are_refused(keys, words):
    with pytest.raises(ValueError, match=words):
        Nozzle(diameter=0.01, exit_speed=1.0, standoff=0.01, **keys)


@pytest.mark.parametrize(
    ("keys", "develops", "resistance"),
    [
        ({}, False, 1.0),
        ({"profile": "developed"}, True, 1.0),
        ({"tip": "flat"}, True, 32.0 + 1.5 * np.log(2.0)),
        ({"tip": "flat", "walls": "slip"}, False, 1.0),
        ({"tip": "flat", "walls": "slip", "standoff": 0.005}, False, 3.0 * np.log(2.0)),
        ({"tip": "flat", "profile": "plug", "bore": 0.03, "outer_diameter": 0.04}, False, 96.0 + 1.5 * np.log(4.0)),
    ],
)
def test_what_follows_from_the_keys(keys, develops, resistance):
    """A gap of a diameter: 6 ln(Ro / R) / pi times Q / (U D^2) = pi / 4."""
    nozzle = Nozzle(**{"diameter": 0.01, "exit_speed": 1.0, "standoff": 0.01, **keys})
    assert nozzle.develops is develops and nozzle.resistance == pytest.approx(resistance)
