"""Measures against particle sets of known shape."""

import numpy as np
import pytest

from fluidbench.measure.bead import measure_bead
from fluidbench.measure.deposit import Deposit
from fluidbench.measure.ledger import ledger
from fluidbench.measure.slump import front, spread_radius
from fluidbench.scenario import Domain

from ..conftest import bead

D = 1.5e-3
BOX = Domain(lower=(-0.03, -0.03, 0.0), upper=(0.12, 0.03, 0.04))


def lattice(low, high, jitter=0.0):
    axes = [np.arange(a + D / 2, b, D) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points + jitter * D * np.random.default_rng(1).uniform(-1, 1, points.shape)


def deposit(points, domain=BOX):
    return Deposit.of(points, np.full(len(points), D**3), domain, D)


def test_deposit_conserves_volume_and_fills_the_inside():
    points = lattice((0, -0.015, 0), (0.06, 0.015, 0.015))
    field = deposit(points)
    assert field.volume() == pytest.approx(len(points) * D**3)
    assert field.fill.max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_half_round_bead_has_its_area_width_and_height(jitter):
    points = lattice((-0.02, -0.021, 0), (0.11, 0.021, 0.021), jitter)
    radius = 8e-3
    points = points[np.hypot(points[:, 1], points[:, 2]) < radius]
    area = len(points) * D**3 / 0.13  # what is really there
    s = bead(spacing=D, domain=BOX.model_dump(), toolpath={"start": [0, 0], "end": [0.09, 0], "speed": 0.1})
    measured = measure_bead(deposit(np.abs(points) * [1, 0, 1] + points * [0, 1, 0]), s).summary(1)
    assert measured["bead_matter_m2"] == pytest.approx(area, rel=0.005)
    assert measured["bead_area_m2"] == pytest.approx(area, rel=0.01)
    assert measured["bead_width_m"] == pytest.approx(2 * radius, abs=D)  # the lattice is a staircase
    assert measured["bead_height_m"] == pytest.approx(radius, abs=D / 2)
    assert measured["bead_continuity"] == 1.0


def test_a_gap_breaks_continuity():
    points = lattice((-0.01, -0.006, 0), (0.1, 0.006, 0.009))
    points = points[(points[:, 0] < 0.04) | (points[:, 0] > 0.05)]
    s = bead(spacing=D, domain=BOX.model_dump(), toolpath={"start": [0, 0], "end": [0.09, 0], "speed": 0.1})
    assert measure_bead(deposit(points), s).summary(1)["bead_continuity"] < 0.95


def test_top_and_front_of_a_block():
    field = deposit(lattice((-0.03, -0.03, 0), (0.045, 0.03, 0.015)))
    assert field.top() == pytest.approx(0.015, abs=D / 4)
    assert front(field) == pytest.approx(0.045, abs=D)


def test_spread_radius_of_a_disc():
    points = lattice((-0.03, -0.03, 0), (0.03, 0.03, 0.012))
    points = points[np.hypot(points[:, 0], points[:, 1]) < 0.02]
    assert spread_radius(deposit(points), 0.0, 0.0) == pytest.approx(0.02, abs=D)


def test_nothing_deposited_measures_nothing():
    field = deposit(np.empty((0, 3)))
    assert field.top() == 0.0 and field.volume() == 0.0


def test_ledger_sums_in_double_precision():
    n = 1000
    frame = {
        "held": np.zeros(n, int),
        "mass": np.full(n, 1e-3, np.float32),
        "position": np.ones((n, 3), np.float32),
        "velocity": np.full((n, 3), 2.0, np.float32),
        "spin": np.zeros((n, 3)),
    }
    row = ledger(frame, bead())
    assert row["mass_kg"] == pytest.approx(1.0) and row["momentum_x_kg_m_s"] == pytest.approx(2.0)
    assert row["kinetic_energy_J"] == pytest.approx(6.0) and row["potential_energy_J"] == pytest.approx(9.81)
