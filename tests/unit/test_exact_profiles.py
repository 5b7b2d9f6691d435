"""Norms, moments, amplitudes, periods and the ledger, by hand."""

import numpy as np
import pytest

from fluidbench.measure.deposit import Deposit
from fluidbench.measure.ledger import deposit_of, final_lengths, ledger, lengths
from fluidbench.measure.profiles import (
    crossings,
    damped_swing,
    kinetic_energy,
    period,
    relative_l1,
    relative_l2,
    semi_axes,
    sine_amplitude,
    widest_diameter,
)
from fluidbench.measure.tower import family_spread, measure_tower, standing
from fluidbench.method.frame import CARRIED, CLAMPED
from fluidbench.scenario.layout import emitted

from ..conftest import bead, scenario


def test_norms_are_relative_to_the_reference():
    values, reference = np.array([4.0, -1.0, 2.0]), np.array([1.0, 3.0, 2.0])
    assert relative_l2(values, reference) == pytest.approx(5.0 / np.sqrt(14.0))
    assert relative_l1(values, reference) == pytest.approx(7.0 / 6.0)
    assert relative_l1(values, -reference) == pytest.approx(11.0 / 6.0)


def test_semi_axes_weigh_by_mass_about_the_centre():
    """Masses 1 and 3 at 0 and 4: centre 3, second moment (9 + 3) / 4 = 3."""
    position = np.array([[0, 5, 1], [4, 5, 1]], np.float32)
    frame = {"mass": np.array([1, 3], np.float32), "position": position, "volume": np.array([8, 27], np.float32)}
    assert semi_axes(frame) == pytest.approx([np.sqrt(15.0), 0.0, 0.0])
    cubes = (4.0 + 3 * 9.0) / 4.0 / 12.0
    assert semi_axes(frame, cubes=True) == pytest.approx(np.sqrt(5.0 * (np.array([3.0, 0, 0]) + cubes)))


def test_kinetic_energy_and_the_amplitude_of_a_sine():
    position = np.array([[0.3, 0, 0], [0.9, 0, 0], [1.7, 0, 0]])
    velocity = np.array([[0, 3, 4], [0, 0, 2], [1, 0, 0]], float)
    frame = {"position": position, "velocity": velocity, "mass": np.array([2.0, 5.0, 8.0])}
    assert kinetic_energy(frame) == pytest.approx(25.0 + 10.0 + 4.0)
    for phase in (0.0, 0.4):
        shape = np.sin(2.5 * position[:, 0] + phase)
        frame["velocity"] = np.stack([0 * shape, 0.7 * shape, 9 + 0 * shape], axis=1)
        assert sine_amplitude(frame, 1, 0, 2.5, phase) == pytest.approx(0.7)
    shape = np.sin(2.5 * position[:, 0])
    frame["velocity"][:, 2] = [1.0, 2.0, 3.0]
    assert sine_amplitude(frame, 2, 0, 2.5) == pytest.approx(shape @ [1, 2, 3] / (shape @ shape))


def test_the_widest_section_as_a_circle():
    """9 cells in the fuller of two layers, one of them overfull: 4 * 9 h^2 / pi, and four times that for a quarter."""
    fill = np.zeros((4, 4, 2))
    fill[:3, :3, 1], fill[0, 0, 1], fill[:2, :2, 0], fill[3, 3, 1] = 1.0, 1.3, 1.0, -0.2
    deposit = Deposit(np.zeros(3), 0.1, fill)
    assert widest_diameter(deposit) == pytest.approx(np.sqrt(36 * 0.01 / np.pi))
    assert widest_diameter(deposit, 0.25) == pytest.approx(2 * np.sqrt(36 * 0.01 / np.pi))


def test_upward_passages_through_the_mean():
    time = np.array([0.0, 2.0, 3.0, 4.0, 5.0, 7.0, 7.5, 9.0])
    signal = np.array([-1.0, 3.0, -3.0, 0.0, 1.0, -2.0, 4.0, -2.0])
    assert signal.mean() == 0.0
    assert crossings(time, signal + 5.0) == pytest.approx([0.5, 4.0, 7.0 + 1 / 6])
    assert period(time, signal) == pytest.approx((7.0 + 1 / 6 - 0.5) / 2)
    assert np.isnan(period(np.arange(3.0), np.array([-1.0, 2.0, -1.0])))
    assert period(np.arange(5.0), np.array([-1.0, 1.0, -1.0, 1.0, 0.0])) == pytest.approx(2.0)


@pytest.mark.parametrize("drift", [0.0, 0.3])
def test_a_damped_swing_gives_back_what_made_it(drift):
    t = np.linspace(0.0, 6.0, 200)
    signal = 2.0 + drift * t - 1.5 * np.exp(-0.4 * t) * np.cos(2 * np.pi * t / 1.9)
    for guess in (1.8, 2.05):
        rest, cycle, decay = damped_swing(t, signal, guess)
        assert (rest, cycle, decay) == pytest.approx((2.0, 1.9, 0.4), rel=1e-6)


FRAME = {
    "held": np.array([0, int(CLAMPED), int(CARRIED)]),
    "mass": np.array([2.0, 3.0, 50.0], np.float32),
    "volume": np.array([2.0, 3.0, 50.0], np.float32) / 1e9,
    "position": np.array([[1, 2, 3], [-1, 0, 2], [7, 7, 7]], np.float32) / 100,
    "velocity": np.array([[1, 0, 2], [0, 3, -1], [9, 9, 9]], np.float32),
    "spin": np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [9, 9, 9]]),
    "birth_time": np.zeros(3),
    "origin": np.arange(3),
}


def test_the_ledger_leaves_out_what_is_in_the_nozzle():
    row = ledger(FRAME, scenario(gravity=[0.5, 0.0, -4.0]))
    x, v = FRAME["position"][:2].astype(float), FRAME["velocity"][:2]
    turn = 2 * np.cross(x[0], v[0]) + 3 * np.cross(x[1], v[1]) + [0.5, 0.7, 0.9]
    assert row["particles"] == 2 and row["mass_kg"] == 5.0
    assert [row[f"momentum_{a}_kg_m_s"] for a in "xyz"] == [2.0, 9.0, 1.0]
    assert [row[f"angular_momentum_{a}_kg_m2_s"] for a in "xyz"] == pytest.approx(turn)
    assert row["kinetic_energy_J"] == pytest.approx(0.5 * (2 * 5 + 3 * 10))
    assert row["potential_energy_J"] == pytest.approx(-0.5 * (0.02 - 0.03) + 4.0 * (0.06 + 0.06))
    assert [row[f"center_{a}_m"] for a in "xyz"] == pytest.approx([-0.01 / 5, 0.04 / 5, 0.12 / 5])
    assert len(row) == 13
    empty = ledger({name: values[2:] for name, values in FRAME.items()}, scenario())
    assert empty["mass_kg"] == empty["center_x_m"] == 0.0 and empty["particles"] == 0
    light = ledger({**FRAME, "mass": FRAME["mass"] / 10}, scenario())
    assert light["center_z_m"] == pytest.approx(0.12 / 5)


RING = {"kind": "ring", "center": [0.02, 0.0], "radius": 0.01, "speed": 0.1, "layers": 3, "layer_height": 0.002}


def printed(low, high, d=0.002):
    """A frame of full cells between two corners, and one particle left in the nozzle above."""
    axes = [np.arange(a + d / 2, b, d) for a, b in zip(low, high, strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    x = np.append(x, [[0.0, 0.0, 0.022]], axis=0)
    held = np.append(np.zeros(len(x) - 1, int), int(CARRIED))
    zeros = np.zeros(len(x))
    return {
        "time": 0.0,
        "held": held,
        "position": x,
        "volume": np.full(len(x), d**3),
        "mass": np.full(len(x), d**3 * 1e3),
        "velocity": 0 * x,
        "spin": 0 * x,
        "birth_time": zeros,
        "origin": np.arange(len(x)),
    }


def test_lengths_come_from_the_free_particles_alone_and_count_from_the_floor():
    """Full cells 6 mm high on a floor at z = 2 mm: the spline leaves 7/8 in the last cell and 1/8 above it."""
    domain = {"lower": [-0.02, -0.02, 0.002], "upper": [0.05, 0.02, 0.027]}
    s, frame = bead(domain=domain), printed((-0.01, -0.01, 0.002), (0.04, 0.01, 0.008))
    assert deposit_of(frame, s).volume() == pytest.approx(0.05 * 0.02 * 0.006)
    row = lengths(frame, s)
    assert row["resolution_m"] == 0.002 and row["top_m"] == pytest.approx(0.006)
    assert "bead_width_m" not in row
    final = final_lengths(frame, s)
    assert lengths(frame | {"time": 0.299}, s) == row  # 30 mm at 0.1 m/s
    assert lengths(frame | {"time": 0.3}, s) == final
    assert row.items() <= final.items()
    assert final["bead_width_m"] == pytest.approx(0.02) and final["bead_height_m"] == pytest.approx(0.006)
    assert not measure_tower(frame, bead(toolpath=RING, duration=2.5)).keys() & final.keys()
    assert "layer_2_height_m" not in final and "ring_drift_m" not in final and "family_spread_m" not in final


def test_lengths_of_bodies_are_those_of_slump_and_front():
    frame = printed((0.0, 0.0, 0.0), (0.04, 0.2, 0.02), 0.01)
    row = lengths(frame, scenario())
    assert row["height_m"] == row["top_m"] == pytest.approx(0.02) and 0.035 < row["front_x_m"] < 0.05


def test_layers_are_numbered_from_the_second_and_a_ring_may_drift():
    s = bead(toolpath=RING, duration=2.5)
    frame = printed((0.0, -0.02, 0.0), (0.04, 0.02, 0.012))
    low, high = frame["position"][:, 2] < 0.004, frame["position"][:, 2] > 0.008
    turn = s.toolpath.length() / 0.1 + 0.02
    frame["birth_time"] = np.where(low, 0.1, np.where(high, 2 * turn + 0.1, turn + 0.1))
    row = final_lengths(frame, s)
    assert row["layer_2_height_m"] == pytest.approx(0.004) and row["layer_3_height_m"] == pytest.approx(0.004)
    tower, stands = measure_tower(frame, s), standing(deposit_of(frame, s), s)
    assert tower and {key: row[key] for key in tower} == pytest.approx(tower, nan_ok=True)
    assert stands and {key: lengths(frame, s)[key] for key in stands} == pytest.approx(stands, nan_ok=True)
    assert "layer_1_height_m" not in row and "layer_4_height_m" not in row
    assert row["ring_drift_m"] == pytest.approx(0.0, abs=1e-9)
    left = (frame["position"][:, 0] < 0.02) & (frame["held"] == 0)
    frame["mass"] = np.where(left, 3.0, 1.0)  # by mass: 3 * 0.01 + 1 * 0.03 over 4
    frame["position"][:, 1] += 0.003
    assert final_lengths(frame, s)["ring_drift_m"] == pytest.approx(np.hypot(0.005, 0.003), rel=1e-6)


def test_foam_tells_how_far_its_families_have_spread():
    s = bead(material={"density": 1000.0, "youngs_modulus": 1e3, "expansion": {"ratio": 4.0}})
    frame = printed((-0.01, -0.01, 0.0), (0.04, 0.01, 0.008))
    assert final_lengths(frame, s)["family_spread_m"] == pytest.approx(family_spread(frame, emitted(s)), nan_ok=True)
