"""Moments of the kernels: unity, symmetry, and slopes that are the derivative."""

import numpy as np
import pytest
from scipy.integrate import quad

from solvers import smoothing


def volume_integral(f, reach):
    return quad(lambda r: 4 * np.pi * r * r * f(r), 0, reach)[0]


def test_wendland_is_normalised_and_its_slope_is_its_derivative():
    h = 0.7
    assert volume_integral(lambda r: smoothing.wendland(r / h, h), 2 * h) == pytest.approx(1.0, abs=1e-8)
    for r in (0.1, 0.5, 1.0, 1.3):
        numeric = (smoothing.wendland((r + 1e-6) / h, h) - smoothing.wendland((r - 1e-6) / h, h)) / 2e-6
        assert smoothing.wendland_slope(r / h, h) * r == pytest.approx(numeric, rel=1e-6, abs=1e-8)
    assert smoothing.wendland(2.0, h) == smoothing.wendland_slope(2.1, h) == 0.0


def test_wendland_gradient_moment():
    """-integral of r r^T W' / r is the unit tensor: linear fields are differentiated exactly."""
    h = 0.7
    moment = volume_integral(lambda r: -smoothing.wendland_slope(r / h, h) * r * r / 3, 2 * h)
    assert moment == pytest.approx(1.0, abs=1e-8)


def test_spiky_gradient_integrates_to_minus_three():
    """Integral of r W' over space is -3 by parts."""
    H = 0.9
    assert volume_integral(lambda r: smoothing.spiky_slope(r, H) * r, H) == pytest.approx(-3.0, rel=1e-6)


def test_the_cusp_is_normalised_and_its_slope_is_its_derivative():
    H = 0.9
    assert volume_integral(lambda r: smoothing.cusp(r, H), H) == pytest.approx(1.0, rel=1e-6)
    assert volume_integral(lambda r: smoothing.cusp_slope(r, H) * r, H) == pytest.approx(-3.0, rel=1e-6)


@pytest.mark.parametrize("x", np.linspace(0.5, 1.5, 7))
def test_spline_moments(x):
    """Weights are positive, sum to 1, reproduce x, and have second moment x^2 + 1/4."""
    w = np.array(smoothing.quadratic_spline(x))
    nodes = np.arange(3)
    assert (w >= 0).all()
    assert w.sum() == pytest.approx(1.0)
    assert w @ nodes == pytest.approx(x)
    assert w @ nodes**2 == pytest.approx(x * x + 0.25)
