"""The material law on single points, against exact answers; and its Warp binding against float64 Python."""

import math

import numpy as np
import pytest
import warp as wp
from hypothesis import given
from hypothesis import strategies as st

from solvers import constitutive as law
from solvers.bind import warp_func

UNIT = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def shear_path(rate, time, steps, g, threshold, consistency, index=1.0, relaxation=0.0):
    """Shear stress history [Pa] under constant shear rate from rest."""
    b, dt, tau = UNIT, time / steps, []
    for _ in range(steps):
        b = law.strain_and_flow(0, rate, 0, 0, 0, 0, 0, 0, 0, *b, g, threshold, consistency, index, relaxation, dt)[:6]
        tau.append(g * b[3])
    return np.array(tau)


def test_elastic_shear_is_linear_in_strain():
    """Below yield tau = G gamma."""
    tau = shear_path(1.0, 0.01, 100, 1e4, 1e30, 0.0)
    assert tau[-1] == pytest.approx(1e4 * 0.01, rel=1e-3)


def test_maxwell_start_up_and_order_one():
    """tau = eta rate (1 - exp(-t / lambda)), and the error halves with dt."""
    g, lam, rate = 1e4, 0.1, 0.1
    errors = []
    for steps in (50, 100, 200):
        tau = shear_path(rate, 0.2, steps, g, 1e30, 0.0, relaxation=1 / lam)
        errors.append(abs(tau[-1] / (g * lam * rate * (1 - math.exp(-2.0))) - 1))
    assert errors[2] < 5e-3
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.2)


def test_maxwell_relaxation():
    """After a step strain the stress decays as exp(-t / lambda)."""
    g, lam, steps = 1e4, 0.1, 2000
    b = (1.0, 1.0, 1.0, 0.01, 0.0, 0.0)
    for _ in range(steps):
        b = law.strain_and_flow(0, 0, 0, 0, 0, 0, 0, 0, 0, *b, g, 1e30, 0.0, 1.0, 1 / lam, 0.1 / steps)[:6]
    assert b[3] / 0.01 == pytest.approx(math.exp(-1.0), rel=2e-3)


@pytest.mark.parametrize("index", [0.4, 0.7, 1.0, 1.5])
def test_herschel_bulkley_steady_shear(index):
    """tau -> yield + k rate^n in steady flow."""
    g, threshold, k, rate = 1e4, 50.0, 8.0, 5.0
    tau = shear_path(rate, 1.0, 4000, g, threshold, k, index)
    assert tau[-1] == pytest.approx(threshold + k * rate**index, rel=0.02)


def test_uniaxial_yield_is_von_mises():
    """Slow uniaxial stretching of a perfectly plastic solid saturates at sigma_zz - sigma_xx = sqrt(3) tau_y."""
    g, threshold, b = 1e4, 50.0, UNIT
    for _ in range(4000):
        b = law.strain_and_flow(-0.05, 0, 0, 0, -0.05, 0, 0, 0, 0.1, *b, g, threshold, 1e-6, 1.0, 0.0, 1e-3)[:6]
    assert g * (b[2] - b[0]) == pytest.approx(math.sqrt(3) * threshold, rel=5e-3)


def test_rotation_makes_no_stress():
    """A full turn in small steps leaves an unstrained point unstrained."""
    b, w, steps = UNIT, 2 * math.pi, 4000
    for _ in range(steps):
        b = law.strain_and_flow(0, -w, 0, w, 0, 0, 0, 0, 0, *b, 1e4, 1e30, 0.0, 1.0, 0.0, 1 / steps)[:6]
    assert np.allclose(b, UNIT, atol=1e-2)


@given(
    trial=st.floats(1e-2, 1e5),
    threshold=st.floats(0, 1e4),
    consistency=st.floats(1e-3, 1e4),
    index=st.sampled_from([0.3, 0.5, 1.0, 1.7]),
    stiffness=st.floats(1e-2, 1e4),
)
def test_flow_stress_solves_its_equation(trial, threshold, consistency, index, stiffness):
    """tau = threshold + k r^n with r = (trial - tau) / S, never above the trial nor below the threshold."""
    tau = law.flow_stress(trial, threshold, consistency, index, stiffness)
    if trial <= threshold:
        assert tau == trial
        return
    assert threshold * (1 - 1e-9) <= tau <= trial
    rate = (trial - tau) / stiffness
    if rate * stiffness < 1e-9 * trial:  # the difference of two floats says nothing of the rate
        return
    assert threshold + consistency * rate**index == pytest.approx(tau, rel=2e-3, abs=2e-3 * (trial - threshold))


@given(st.floats(-0.1, 0.2))
def test_tait_agrees_with_its_closed_form(c):
    assert law.pressure(c, 7.0, 1.0, 1e30) == pytest.approx((1 + c) ** 7 - 1, abs=1e-12)
    assert law.pressure(c, 7.0, 0.0, 0.0) == max(7.0 * c, 0.0)


PRESSURE = warp_func(law.pressure)
STRAIN = warp_func(law.strain_and_flow, law.flow_stress)


@wp.kernel
def evaluate(c: wp.array(dtype=float), p: wp.array(dtype=float), shear: wp.array(dtype=float)):
    i = wp.tid()
    p[i] = PRESSURE(c[i], 1.0e5, 1.0, 1.0e30)
    l = 10.0 * c[i]
    xx, yy, zz, xy, xz, yz, kept = STRAIN(
        0.0, l, 0.0, 0.0, 0.0, l, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.02, 0.0, 0.0, 1.0e4, 50.0, 3.0, 0.5, 0.0, 1.0e-3
    )
    shear[i] = xx + 2.0 * yy + 3.0 * zz + xy + xz + yz + kept


def test_warp_binding_agrees_with_python():
    """The same code in float32 and float64."""
    c = np.linspace(-0.02, 0.05, 64)
    arrays = [wp.array(c, dtype=float, device="cpu"), *(wp.zeros(64, dtype=float, device="cpu") for _ in range(2))]
    wp.launch(evaluate, 64, arrays, device="cpu")
    python = [law.pressure(float(x), 1e5, 1.0, 1e30) for x in c]
    assert np.allclose(arrays[1].numpy(), python, rtol=2e-6, atol=1e-3)
    for x, got in zip(c, arrays[2].numpy(), strict=True):
        b = law.strain_and_flow(
            0, 10 * x, 0, 0, 0, 10 * x, 0, 0, 0, 1, 1, 1, 0.02, 0, 0, 1e4, 50.0, 3.0, 0.5, 0.0, 1e-3
        )
        assert got == pytest.approx(b[0] + 2 * b[1] + 3 * b[2] + b[3] + b[4] + b[5] + b[6], rel=1e-6)
