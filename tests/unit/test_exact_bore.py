"""Flow along a bore: stresses, pressures and profiles against the laws in closed form."""

import numpy as np
import pytest
from scipy.integrate import quad

from fluidbench.scenario.bore import Bore
from fluidbench.scenario.material import Material

D, U = 0.012, 0.03
R = D / 2


def paste(yield_stress, consistency=2.0, index=1.0):
    return Material(
        density=1000.0,
        youngs_modulus=1e5,
        poisson_ratio=0.45,
        yield_stress=yield_stress,
        plastic_viscosity=consistency,
        flow_index=index,
    )


def test_a_liquid_has_hagens_and_poiseuilles_parabola():
    bore = Bore(Material(density=1000.0, viscosity=5.0), D, U)
    assert bore.wall_stress == pytest.approx(8.0 * 5.0 * U / D, rel=1e-6)
    assert bore.pressure_drop(0.1) == pytest.approx(32.0 * 5.0 * U * 0.1 / D**2, rel=1e-6)
    r = np.array([0.0, 0.25, 0.5, 0.9, 1.0]) * R
    assert bore.profile(r) == pytest.approx(2.0 * (1.0 - (r / R) ** 2), abs=1e-6)


@pytest.mark.parametrize("bingham", [0.1, 1.0, 4.0, 30.0, 1e3])
def test_a_bingham_paste_obeys_buckingham_and_reiner(bingham):
    """Q = pi R^4 dp / (8 k L) (1 - 4/3 phi + phi^4 / 3)."""
    threshold = bingham * 2.0 * U / D
    bore = Bore(paste(threshold), D, U)
    gradient, phi = bore.pressure_drop(1.0), threshold / bore.wall_stress
    flow = np.pi * R**4 * gradient / (8.0 * 2.0) * (1.0 - 4.0 / 3.0 * phi + phi**4 / 3.0)
    assert flow == pytest.approx(np.pi * R**2 * U, rel=1e-5)
    plug = bore.profile(np.linspace(0.0, 0.99 * phi, 7) * R)
    assert np.ptp(plug) == pytest.approx(0.0, abs=1e-12) and plug[0] > 1.0
    assert bore.profile(np.array([R]))[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("threshold", "index"), [(20.0, 0.4), (20.0, 1.7), (0.5, 0.6)])
def test_a_herschel_bulkley_paste_obeys_its_law_at_every_radius(threshold, index):
    """tau_y + k |du/dr|^n = tau_w r / R where it flows, and the speeds' mean is U."""
    bore = Bore(paste(threshold, 3.0, index), D, U)
    flowing = max(threshold / bore.wall_stress, 0.05)
    r = np.linspace(flowing + 0.05, 0.97, 9) * R
    step = 1e-6 * R
    rate = -U * (bore.profile(r + step) - bore.profile(r - step)) / (2.0 * step)
    assert threshold + 3.0 * rate**index == pytest.approx(bore.wall_stress * r / R, rel=1e-4)
    mean = quad(lambda x: 2.0 * x * bore.profile(np.array([x * R]))[0], 0.0, 1.0, limit=200)[0]
    assert mean == pytest.approx(1.0, rel=1e-4)


def test_what_only_yields_moves_as_a_plug():
    bore = Bore(paste(100.0, 1e-12), D, U)
    assert bore.wall_stress == 100.0 and bore.pressure_drop(0.5) == pytest.approx(4.0 * 100.0 * 0.5 / D)
    assert (bore.profile(np.linspace(0.0, R, 5)) == 1.0).all()
