"""The laws of matter against values worked out by hand and against their formulas in matrix form."""

import math

import numpy as np
import pytest

from solvers import smoothing
from solvers.constitutive import flow_stress, hardened, plastic_strain, pressure, relieved, strain_and_flow

exact = lambda value: pytest.approx(value, rel=1e-12)  # noqa: E731


@pytest.mark.parametrize(
    ("compression", "bulk", "tait", "limit", "expected"),
    [
        (0.2, 1e3, 0.0, 1e30, 200.0),
        (-0.05, 100.0, 0.0, 10.0, -5.0),
        (-0.5, 100.0, 0.0, 10.0, -10.0),
        (-0.5, 100.0, 0.0, 0.0, 0.0),
        (0.5, 14.0, 1.0, 0.0, 2.0 * (1.5**7 - 1.0)),
        (2.0, 7.0, 1.0, 0.0, 3.0**7 - 1.0),
        (-0.5, 7.0, 1.0, 1e30, 0.5**7 - 1.0),
    ],
)
def test_pressure(compression, bulk, tait, limit, expected):
    assert pressure(compression, bulk, tait, limit) == exact(expected)


@pytest.mark.parametrize(
    ("trial", "threshold", "consistency", "index", "stiffness", "expected"),
    [
        (90.0, 100.0, 3.0, 1.0, 2.0, 90.0),  # below the threshold nothing flows
        (100.0, 100.0, 3.0, 0.5, 2.0, 100.0),
        (300.0, 100.0, 3.0, 1.0, 2.0, 220.0),  # 100 + 200 * 3 / (3 + 2)
        (300.0, 100.0, 0.0, 0.5, 2.0, 100.0),  # perfectly plastic whatever the exponent
        (40.0, 10.0, 4.0, 0.5, 2.0, 22.0),  # r = 9: 10 + 4 * 3, and 40 - 2 * 9
        (51.2, 1.0, 0.04, 0.5, 2.0, 1.2),  # r = 25: 1 + 0.04 * 5, and 51.2 - 2 * 25
        (32.0, 10.0, 3.0, 2.0, 5.0, 22.0),  # r = 2: 10 + 3 * 4, and 32 - 5 * 2
        (1041.0, 1.0, 2.0, 2.0, 84.0, 201.0),  # r = 10: 1 + 2 * 100, and 1041 - 84 * 10
    ],
)
def test_flow_stress(trial, threshold, consistency, index, stiffness, expected):
    assert flow_stress(trial, threshold, consistency, index, stiffness) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("index", [0.2, 0.5, 0.9, 1.05, 1.3, 3.0])
@pytest.mark.parametrize("rate", [1e-4, 1e-2, 1.0, 50.0])
@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e3])
def test_flow_stress_meets_its_equation_over_seven_decades(index, rate, stiffness):
    """tau = 5 + 2 r^n where the trial is tau + S r; eight steps of Newton leave 1e-4 of what flows at most."""
    tau = 5.0 + 2.0 * rate**index
    trial = tau + stiffness * rate
    assert flow_stress(trial, 5.0, 2.0, index, stiffness) == pytest.approx(tau, abs=1e-4 * (trial - 5.0))


def matrix(values):
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def components(b):
    return b[0, 0], b[1, 1], b[2, 2], b[0, 1], b[0, 2], b[1, 2]


def dev(a):
    return a - np.trace(a) / 3.0 * np.eye(3)


def after_step(l, b, shear, threshold, consistency, relaxation, dt):
    """The docstring's formulas in matrices, for index = 1."""
    a = np.eye(3) + dt * dev(l)
    b = a @ b @ a.T
    mean, s = np.trace(b) / 3.0, dev(b)
    trial, keep = shear * math.sqrt(0.5 * (s * s).sum()), 1.0
    if trial > threshold:
        stiffness = shear * dt * mean
        keep = (threshold + (trial - threshold) * consistency / (consistency + stiffness)) / trial
    b = mean * np.eye(3) + keep * s
    if relaxation > 0:
        return np.eye(3) + (b - np.eye(3)) * math.exp(-relaxation * dt)
    return b * 3.0 / (2.0 + max(np.linalg.det(b), 0.0))


L = np.array([[3.0, -7.0, 2.0], [5.0, 1.0, -4.0], [-6.0, 8.0, 2.5]])
B = matrix([1.3, 0.9, 1.25, 0.2, -0.15, 0.25])


@pytest.mark.parametrize("threshold", [1e30, 30.0, 0.0])
@pytest.mark.parametrize("consistency", [0.0, 4.0])
@pytest.mark.parametrize("relaxation", [0.0, 6.0])
def test_strain_and_flow_is_its_matrix_form(threshold, consistency, relaxation):
    got = strain_and_flow(*L.ravel(), *components(B), 200.0, threshold, consistency, 1.0, relaxation, 0.03)
    trial = (np.eye(3) + 0.03 * dev(L)) @ B @ (np.eye(3) + 0.03 * dev(L)).T
    left = np.linalg.norm(dev(matrix(got[:6]))) / np.linalg.norm(dev(trial))
    scaled = 1.0 if relaxation else sum(got[:3]) / np.trace(trial)  # back to det b = 1, which is no loss
    assert got[6] == pytest.approx(left / scaled, rel=1e-9)
    assert got[:6] == exact(components(after_step(L, B, 200.0, threshold, consistency, relaxation, 0.03)))


def test_strain_and_flow_hands_the_exponent_and_the_stiffness_to_the_flow_law():
    """r from tau_y + k r^n + G dt m r = trial, read back from the deviator that is left."""
    shear, threshold, consistency, index, dt = 200.0, 10.0, 3.0, 2.0, 0.03
    got = matrix(strain_and_flow(*L.ravel(), *components(B), shear, threshold, consistency, index, 1e-12, dt)[:6])
    a = np.eye(3) + dt * dev(L)
    trial = a @ B @ a.T
    before, after = (shear * math.sqrt(0.5 * (dev(t) ** 2).sum()) for t in (trial, got))
    rate = (before - after) / (shear * dt * np.trace(trial) / 3.0)
    assert after == pytest.approx(threshold + consistency * rate**index, rel=1e-9)


def test_a_tensor_of_negative_determinant_is_scaled_by_three_halves():
    b = np.diag([1.0, 1.2, -0.5])
    got = strain_and_flow(*np.zeros(9), *components(b), 1.0, 1e30, 0.0, 1.0, 0.0, 0.01)
    assert got[:6] == exact(components(1.5 * b)) and got[6] == 1.0


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0])
def test_relieved_has_the_mean_that_makes_the_determinant_one(ratio):
    b = B / np.cbrt(np.linalg.det(B))
    s = ratio * dev(b)
    roots = np.roots([1.0, 0.0, -0.5 * (s * s).sum(), np.linalg.det(s) - 1.0])
    mean = max(root.real for root in roots if abs(root.imag) < 1e-9)
    assert relieved(*components(b), ratio) == exact(components(mean * np.eye(3) + s))


@pytest.mark.parametrize("h", [0.5, 2.0])
def test_wendland_by_hand(h):
    peak = 21.0 / (16.0 * math.pi * h**3)
    expected = {0.0: 1.0, 1.0: 0.5**4 * 3.0, 1.5: 0.25**4 * 4.0, 2.0: 0.0, 3.0: 0.0}
    for q, share in expected.items():
        assert smoothing.wendland(q, h) == exact(peak * share)
    slope = -105.0 / (16.0 * math.pi * h**5)
    for q, share in {0.0: 1.0, 1.0: 0.125, 1.5: 0.25**3, 2.0: 0.0, 3.0: 0.0}.items():
        assert smoothing.wendland_slope(q, h) == exact(slope * share)


@pytest.mark.parametrize("support", [0.5, 2.0])
def test_spiky_by_hand(support):
    for share in (0.0, 0.5, 1.0, 1.1):
        r, left = share * support, max(1.0 - share, 0.0)
        assert smoothing.spiky(r, support) == exact(15.0 / (math.pi * support**3) * left**3)
        assert smoothing.spiky_slope(r, support) == exact(-45.0 / (math.pi * support**4) * left**2)


@pytest.mark.parametrize("support", [0.5, 2.0])
def test_the_cusp_by_hand(support):
    for share in (0.0, 0.5, 1.0, 1.1):
        r, left = share * support, max(1.0 - share, 0.0)
        assert smoothing.cusp(r, support) == exact(7.5 / (math.pi * support**3) * left**2)
        assert smoothing.cusp_slope(r, support) == exact(-15.0 / (math.pi * support**4) * left)


@pytest.mark.parametrize("support", [0.5, 2.0])
def test_poly6_by_hand(support):
    for share, left in {0.0: 1.0, 0.5: 0.75, 1.0: 0.0, 1.1: 0.0}.items():
        peak = 315.0 / (64.0 * math.pi * support**3)
        assert smoothing.poly6(share * support, support) == exact(peak * left**3)


def test_the_spline_by_hand():
    assert smoothing.quadratic_spline(0.5) == exact((0.5, 0.5, 0.0))
    assert smoothing.quadratic_spline(1.0) == exact((0.125, 0.75, 0.125))
    assert smoothing.quadratic_spline(1.25) == exact((0.03125, 0.6875, 0.28125))


@pytest.mark.parametrize(
    ("strain", "expected"), [(0.0, 100.0), (math.log(2.0) / 8.0, 250.0), (math.log(4.0) / 8.0, 325.0), (1e9, 400.0)]
)
def test_yield_stress_saturates_with_plastic_strain(strain, expected):
    assert hardened(100.0, 400.0, 8.0, strain) == exact(expected)


def test_plastic_strain_of_a_step_is_what_its_stress_fell_short_of():
    """Simple shear of an unstrained point by 0.3: b_xy = 0.3, trial stress G sqrt(J2(b)), and det b is 1 again."""
    shear, threshold = 200.0, 30.0
    gradient = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    *b, keep = strain_and_flow(*gradient, *components(np.eye(3)), shear, threshold, 0.0, 1.0, 0.0, 1.0)
    trial = matrix(components(np.array([[1.09, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])))
    s = trial - np.trace(trial) / 3 * np.eye(3)
    tau = shear * math.sqrt(0.5 * (s * s).sum())
    lost = (tau - threshold) / (shear * np.trace(trial) / 3)
    assert plastic_strain(*b, keep) == pytest.approx(lost / math.sqrt(3.0), rel=1e-6)
    assert plastic_strain(*components(np.eye(3)), 1.0) == 0.0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_uniaxial_strain_is_elastic_and_plastic_and_stress_follows_the_second(way):
    """A bar drawn out or pressed by 30 %: logarithmic strains add up, and its stress is sqrt(3) the hardened yield."""
    shear, steps, total = 1e6, 3000, 0.3
    e, b, eps = way * total / steps, components(np.eye(3)), 0.0
    for _ in range(steps):
        threshold = hardened(100.0, 1000.0, 10.0, eps)
        *b, keep = strain_and_flow(-e / 2, 0, 0, 0, -e / 2, 0, 0, 0, e, *b, shear, threshold, 0.0, 1.0, 0.0, 1.0)
        eps += plastic_strain(*b, keep)
    assert eps + abs(0.5 * math.log(b[2])) == pytest.approx(total, rel=2e-3)
    assert way * shear * (b[2] - b[0]) == pytest.approx(math.sqrt(3.0) * hardened(100.0, 1000.0, 10.0, eps), rel=2e-3)
