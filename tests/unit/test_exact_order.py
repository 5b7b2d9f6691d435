"""How near and how dense: numbers worked out by hand."""

import numpy as np
import pytest

from fluidbench.measure.order import departures, order, packing
from fluidbench.method.frame import CARRIED, FREE

from ..conftest import scenario


def frame(place, density=1000.0, held=FREE, edge=0.01):
    n = len(place)
    return {
        "position": np.asarray(place, np.float32),
        "volume": np.full(n, edge**3, np.float32),
        "mass": np.full(n, 1000.0 * edge**3, np.float32),
        "density": np.full(n, density, np.float32) if np.isscalar(density) else np.asarray(density, np.float32),
        "held": np.full(n, held) if np.isscalar(held) else np.asarray(held),
    }


def test_a_lattice_is_in_order():
    axis = 0.01 * (np.arange(6) + 0.5)
    found = order(frame(np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)), scenario(spacing=0.01))
    expected = {"least_distance": 1.0, "least_density": 1.0, "mean_density": 1.0, "largest_density": 1.0}
    assert found == pytest.approx(expected | {"most_in_cell": 1.0}, rel=1e-5)


def test_a_pair_is_seen_and_what_is_carried_is_not():
    places = [[0.0, 0.0, 0.0], [0.003, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.0, 0.001]]
    held = [FREE, FREE, FREE, CARRIED]
    found = order(frame(places, [900.0, 1100.0, 1300.0, 5000.0], held), scenario(spacing=0.01))
    assert found["least_distance"] == pytest.approx(0.3, rel=1e-5)
    assert [found[f"{k}_density"] for k in ("least", "mean", "largest")] == pytest.approx([0.9, 1.1, 1.3])
    assert found["most_in_cell"] == 2 / 8
    assert order(frame([[0.0, 0.0, 0.0]]), scenario(spacing=0.01)) == {}


def lattice(n, pitch, jitter=0.0):
    axis = pitch * (np.arange(n) + 0.5)
    place = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    return place + jitter * np.random.default_rng(0).uniform(-1, 1, place.shape)


@pytest.mark.parametrize("pitch", [0.01, 0.0105, 0.0115, 0.0095])
@pytest.mark.parametrize("jitter", [0.0, 0.003])
def test_packing_is_told_by_places_alone(pitch, jitter):
    """A lattice drawn apart, or pressed together: the same rest volumes in (pitch / edge)^3 times the room."""
    found = packing(lattice(20, pitch, jitter), np.full(20**3, 1e-6))
    assert found == pytest.approx((0.01 / pitch) ** 3, rel=0.05)


def test_packing_leaves_out_hollows_and_what_is_thin():
    place = lattice(20, 0.01)
    hollow = np.linalg.norm(place - 0.1, axis=1) < 0.035
    assert packing(place[~hollow], np.full((~hollow).sum(), 1e-6)) == pytest.approx(1.0, rel=0.02)  # it may be meant
    assert packing(lattice(11, 0.01), np.full(11**3, 1e-6)) is None  # 7^3 cells are too few
    assert packing(np.concatenate([place, [[9.0, 9.0, 9.0]]]), np.full(20**3 + 1, 1e-6)) is None
    grown = packing(2.0 * place, np.full(20**3, 8e-6))  # foam: what counts is the rest volume that it has now
    assert grown == pytest.approx(1.0, rel=0.02)
    assert order(frame(1.1 * place), scenario(spacing=0.01))["packing"] == pytest.approx(1.1**-3, rel=0.05)


def test_a_method_that_takes_loose_matter_for_dense_is_found_out():
    (line,) = departures({"mean_density": 1.001, "packing": 0.8})
    assert line.startswith("by where its particles are it is 0.8 times as dense as at rest (the method takes it for 1)")
    assert departures({"mean_density": 1.0, "packing": 0.91}) == []
    assert len(departures({"mean_density": 1.2, "packing": 1.2})) == 1  # a solid that is pressed together, and knows it


@pytest.mark.parametrize(("mean", "said"), [(1.0, 0), (1.049, 0), (0.94, 1), (1.06, 1)])
def test_volume_that_departs_is_told(mean, said):
    assert len(departures({"mean_density": mean})) == said
    assert departures({}) == []
