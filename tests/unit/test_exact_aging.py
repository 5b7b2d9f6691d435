"""Curing and growing by hand: stress, pressure, mass and present volume carry over to the new material."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.native.crew import Crew
from fluidbench.native.scene import Scene
from solvers import aging

from ..conftest import scenario

launch = Crew(wp.get_device("cpu")).launch

FRESH = {"density": 1000.0, "youngs_modulus": 2.6e4, "poisson_ratio": 0.3, "yield_stress": 9e3}
HARD = {"youngs_modulus": 10.4e4}
G, K = 1e4, 2.6e4 / 1.2
NORMAL, SHEAR = np.array([1.04, 0.97, 1.01]), np.array([0.02, -0.03, 0.01])


def numbers(*values):
    return wp.array(np.array(values, np.float32), dtype=float)


class Two:
    """Two particles of 1 g; the first is due to harden fourfold, the second stays as it is; a third slot is empty."""

    def __init__(self, density=1000.0, ratio=1.0):
        self.phases = Scene(scenario(material=FRESH | {"cure": HARD})).phases
        self.count = wp.array([2], dtype=int)
        self.due, self.phase = wp.array([1, 0, 1], dtype=int), wp.zeros(3, dtype=int)
        self.mass, self.volume = numbers(1e-3, 1e-3, 1e-3), numbers(1e-6, 1e-6, 1e-6)
        self.density, self.ratio = numbers(*[density] * 3), numbers(*[ratio] * 3)
        self.normal = wp.array(np.tile(NORMAL, (3, 1)).astype(np.float32), dtype=wp.vec3)
        self.shear = wp.array(np.tile(SHEAR, (3, 1)).astype(np.float32), dtype=wp.vec3)

    def check(self, relieved=True):
        """The first has hardened with its shear stress, the others are as they were."""
        assert self.phase.numpy().tolist() == [1, 0, 0]
        b, s = self.normal.numpy().astype(float), self.shear.numpy().astype(float)
        for i in (1, 2) if relieved else (0, 1, 2):
            assert b[i] == pytest.approx(NORMAL, rel=1e-6) and s[i] == pytest.approx(SHEAR, rel=1e-6)
        if relieved:
            assert 4 * G * (b[0] - b[0].mean()) == pytest.approx(G * (NORMAL - NORMAL.mean()), rel=1e-3)
            assert 4 * G * s[0] == pytest.approx(G * SHEAR, rel=1e-3)


def test_what_is_not_elastic_changes_its_phase_alone():
    two = Two()
    launch(aging.harden, 3, [3, two.count, two.due], [two.phase])
    two.check(relieved=False)


def test_what_pulls_back_strain_that_no_gradient_shows_carries_over():
    """G z stays, with G fourfold; the phases are those before."""
    two = Two()
    off = wp.array(np.tile(SHEAR, (3, 1)).astype(np.float32), dtype=wp.vec3)
    launch(aging.relieve_off_linear, 3, [3, two.count, two.phases, two.due, two.phase], [off])
    assert off.numpy() == pytest.approx(np.stack([SHEAR / 4.0, SHEAR, SHEAR]), rel=1e-6)


@pytest.mark.parametrize("ratio", [0.98, 1.02])
def test_pressure_and_present_volume_carry_over_where_j_is_integrated(ratio):
    """K (1 / J - 1) stays, with K fourfold; V0 J stays."""
    two = Two(ratio=ratio)
    launch(
        aging.harden_at_ratio,
        3,
        [3, two.count, two.phases, two.due],
        [two.phase, two.volume, two.ratio, two.normal, two.shear],
    )
    two.check()
    j, volume = two.ratio.numpy().astype(float), two.volume.numpy().astype(float)
    assert 4 * K * (1 / j[0] - 1) == pytest.approx(K * (1 / ratio - 1), rel=1e-4)
    assert volume[0] * j[0] == pytest.approx(1e-6 * ratio, rel=1e-6)
    assert j[1:] == pytest.approx([ratio] * 2) and volume[1:] == pytest.approx([1e-6] * 2)


@pytest.mark.parametrize("density", [980.0, 1020.0])
def test_pressure_carries_over_where_density_is_integrated(density):
    """K (rho / rho0 - 1) stays, with K fourfold and rho as it is: rho0 = m / V changes."""
    two = Two(density=density)
    off = wp.array([[1.0, 2.0, -3.0]] * 3, dtype=wp.vec3)
    launch(
        aging.harden_at_density,
        3,
        [1, 3, two.count, two.phases, two.due, two.mass, two.density],
        [two.phase, two.volume, two.normal, two.shear, off],
    )
    two.check()
    assert off.numpy().tolist() == [[0.25, 0.5, -0.75], [1.0, 2.0, -3.0], [1.0, 2.0, -3.0]]  # fourfold G, the same pull
    rest = 1e-3 / two.volume.numpy().astype(float)
    assert 4 * K * (density / rest[0] - 1) == pytest.approx(K * (density / 1000.0 - 1), rel=1e-3)
    assert rest[1:] == pytest.approx([1000.0] * 2) and two.density.numpy() == pytest.approx([density] * 3)


def test_rest_volumes_grow_by_their_rate():
    """exp(rate dt); what integrates J keeps V0 J."""
    count, dt, growth = wp.array([2], dtype=int), numbers(0.25), numbers(2.0, 0.0, 2.0)
    volume, ratio = numbers(3.0, 3.0, 3.0), numbers(0.9, 0.9, 0.9)
    launch(aging.swell, 3, [3, count, dt, growth], [volume])
    assert volume.numpy() == pytest.approx([3.0 * math.exp(0.5), 3.0, 3.0])
    volume = numbers(3.0, 3.0, 3.0)
    launch(aging.swell_at_volume, 3, [3, count, dt, growth], [volume, ratio])
    assert volume.numpy() == pytest.approx([3.0 * math.exp(0.5), 3.0, 3.0])
    assert ratio.numpy() == pytest.approx([0.9 * math.exp(-0.5), 0.9, 0.9])


def test_where_solids_alone_integrate_j_only_theirs_answers_growth():
    count, dt, growth = wp.array([2], dtype=int), numbers(0.25), numbers(2.0, 2.0, 2.0)
    phases = Scene(scenario(material=FRESH | {"cure": HARD | {"yield_stress": 1e6}})).phases
    volume, ratio, phase = numbers(3.0, 3.0, 3.0), numbers(0.9, 0.9, 0.9), wp.array([0, 1, 1], dtype=int)
    launch(aging.swell_by_phase, 3, [3, count, dt, phases, phase, growth], [volume, ratio])
    assert volume.numpy() == pytest.approx([3.0 * math.exp(0.5)] * 2 + [3.0])
    assert ratio.numpy() == pytest.approx([0.9, 0.9 * math.exp(-0.5), 0.9])
