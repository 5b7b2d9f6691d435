"""How near and how dense: numbers worked out by hand."""

import numpy as np
import pytest

from fluidbench.measure.order import departures, order
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


@pytest.mark.parametrize(("mean", "said"), [(1.0, 0), (1.049, 0), (0.94, 1), (1.06, 1)])
def test_volume_that_departs_is_told(mean, said):
    assert len(departures({"mean_density": mean})) == said
    assert departures({}) == []
