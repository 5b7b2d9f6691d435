"""Measures of fields against shapes that are known."""

import numpy as np
import pytest

from fluidbench.measure.deposit import Deposit
from fluidbench.measure.profiles import (
    kinetic_energy,
    period,
    relative_l1,
    relative_l2,
    semi_axes,
    sine_amplitude,
    widest_diameter,
)
from fluidbench.scenario import Domain
from solvers.mpm.grid import cells_of


def ball(radius: float, n: int = 24, quarter: bool = False) -> np.ndarray:
    axis = (np.arange(n) + 0.5) / n * 2 * radius - radius
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    points = points[np.linalg.norm(points, axis=1) <= radius]
    return points[(points[:, 0] > 0) & (points[:, 1] > 0)] if quarter else points


def test_norms():
    assert relative_l2(np.array([1.1, 2.2]), np.array([1.0, 2.0])) == pytest.approx(0.1)
    assert relative_l1(np.array([0.9, 2.2]), np.array([1.0, 2.0])) == pytest.approx(0.1)


def test_semi_axes_of_an_ellipsoid():
    points = ball(1.0) * [0.1, 0.2, 0.3] + [5.0, 0.0, 1.0]
    frame = {"position": points, "mass": np.ones(len(points))}
    assert semi_axes(frame) == pytest.approx([0.1, 0.2, 0.3], rel=0.01)


@pytest.mark.parametrize("cells", [2, 4, 7])
def test_a_box_of_cubes_has_its_exact_moment_however_finely_it_is_divided(cells):
    middle = (np.arange(cells) + 0.5) / cells
    points = np.stack(np.meshgrid(middle, middle, middle), axis=-1).reshape(-1, 3)
    frame = {"position": points, "mass": np.ones(cells**3), "volume": np.full(cells**3, cells**-3.0)}
    assert semi_axes(frame, cubes=True) == pytest.approx([np.sqrt(5.0 / 12.0)] * 3)


def test_energy_and_amplitude():
    z = np.linspace(0, 1, 200, endpoint=False)
    velocity = np.zeros((200, 3))
    velocity[:, 0] = 0.3 * np.sin(2 * np.pi * z)
    frame = {"position": np.stack([0 * z, 0 * z, z], axis=1), "velocity": velocity, "mass": np.full(200, 2.0)}
    assert sine_amplitude(frame, 0, 2, 2 * np.pi) == pytest.approx(0.3)
    assert kinetic_energy(frame) == pytest.approx(200 * 0.3**2 / 2)


def test_period_of_a_sampled_oscillation():
    t = np.linspace(0, 10, 400)
    assert period(t, 3.0 + np.cos(2 * np.pi * t / 1.7)) == pytest.approx(1.7, rel=1e-3)
    assert np.isnan(period(t, t))


def test_widest_diameter_of_a_quarter_ball():
    points = ball(0.01, 40, quarter=True) + np.array([0.0, 0.0, 0.015])
    domain = Domain(lower=(0, 0, 0), upper=(0.02, 0.02, 0.03))
    volume = np.full(len(points), (0.02 / 40) ** 3)
    deposit = Deposit.of(points, volume, domain, 0.0005)
    assert widest_diameter(deposit, 0.25) == pytest.approx(0.02, rel=0.01)


def test_cells_divide_the_domain():
    """Walls lie halfway between nodes whatever the domain's size: the cell gives way, along each axis by itself."""
    cells, edges = cells_of(Domain(lower=(0, 0, 0), upper=(0.02, 0.011, 0.003)), 0.003)
    assert cells.tolist() == [7, 4, 2] and np.allclose(cells * edges, [0.02, 0.011, 0.003])
