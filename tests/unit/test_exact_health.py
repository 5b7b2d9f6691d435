"""The limits of health, on pools set up by hand just below and above each."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.method.vitals import mass_energy
from fluidbench.native.health import Health
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE

from ..conftest import scenario
from .made import place, pool_of

wp.set_module_options({"enable_backward": False})


def watched(*scenarios, velocity=(0.0, 0.0, 0.0), n=2):
    pool = pool_of(*scenarios)
    place(pool, n, velocity)
    return Health(pool.scene, pool), pool


def fast():
    """No gravity, c = 100 m/s, at 0.02 m/s."""
    body = {"kind": "box", "center": [0.1] * 3, "size": [0.08] * 3, "velocity": [2.0, 0, 0]}
    return scenario(material={"density": 1000.0, "sound_speed": 100.0}, bodies=[body], gravity=[0, 0, 0])


def test_energies_are_summed_over_particles_and_worlds():
    """Two particles of 1 g and of 3 g in worlds of g = 10 and 20 m/s^2, at 0.1 and 0.11 m, at 5 and 5 m/s."""
    health, _ = watched(
        scenario(gravity=[0, 0, -10.0]),
        scenario(gravity=[0, 0, -20.0], material={"density": 3000.0}),
        velocity=(3.0, 0.0, 4.0),
    )
    vital = health.read()
    assert vital.speed == pytest.approx(5.0)
    assert vital.kinetic == pytest.approx(0.5 * 25.0 * (2e-3 + 6e-3), rel=1e-5)
    assert vital.potential == pytest.approx(1e-3 * 10.0 * 0.21 + 3e-3 * 20.0 * 0.21, rel=1e-5)
    assert health.read() == vital  # each reading begins anew
    still = watched(scenario(gravity=[0, 0, -10.0]))[0].read()
    assert (still.speed, still.kinetic, still.potential) == (0.0, 0.0, pytest.approx(1e-3 * 10.0 * 0.21, rel=1e-5))


@pytest.mark.parametrize(("share", "sound"), [(0.999, True), (1.001, False)])
def test_speed_is_limited_to_three_times_sound_and_scenario(share, sound):
    """3 (100 + 2) m/s; heavy particles elsewhere in the pool's count make the energy no matter."""
    health, pool = watched(fast(), n=40)
    v = np.zeros((64, 3), np.float32)
    v[3] = [0.0, -share * 306.0, 0.0]
    pool.velocity.assign(v)
    pool.mass.fill_(1e-12)
    vital = health.read()
    assert (vital.complaint is None) is sound and vital.speed == pytest.approx(share * 306.0)
    if not sound:
        assert vital.complaint == "a particle moves at 306 m/s; more than 306 m/s cannot come from the scenario"


def supply(health):
    return mass_energy(health.scene.scenario, health.scene.top_wave_speed)


def test_energy_that_a_scenario_can_supply():
    """v^2 / 2, and what the forces do across the domain: |size| . |g| + |size| |D| |size|; spawned children press."""
    assert supply(watched(fast())[0]) == pytest.approx(2.0)
    size = {"lower": [0, -0.1, 0], "upper": [0.3, 0.1, 0.4]}
    body = [{"kind": "box", "center": [0.1, 0, 0.1], "size": [0.04] * 3}]
    falls = scenario(domain=size, bodies=body, gravity=[1.0, 0, -10.0], body_force=[0, -2.0, 0])
    assert supply(watched(falls)[0]) == pytest.approx(0.5 * falls.reference_speed**2 + 0.3 + 0.4 + 4.0)
    pull = [[-9.0, 1.0, 0.0], [1.0, 4.0, 0.0], [0.0, 0.0, -1.0]]
    pulled = scenario(domain=size, bodies=body, gravity=[0, 0, 0], body_force_gradient=pull)
    work = 9 * 0.09 + 2 * 0.3 * 0.2 + 4 * 0.04 + 0.16
    assert supply(watched(pulled)[0]) == pytest.approx(0.5 * pulled.reference_speed**2 + work)
    for kind, pressed in (("growth", 0.0), ("spawn", 0.05)):
        s = scenario(
            gravity=[0, 0, 0],
            material={"density": 1000.0, "sound_speed": 100.0, "expansion": {"ratio": 2.0, "kind": kind}},
        )
        made = watched(s)[0]
        assert supply(made) == pytest.approx(0.5 * s.reference_speed**2 + pressed * made.scene.top_wave_speed**2)


@pytest.mark.parametrize(("share", "sound"), [(0.999, True), (1.001, False)])
def test_kinetic_energy_is_limited_to_twice_of_twice_what_can_be_supplied(share, sound):
    """Two worlds of 2 g and 6 g, that could be given 2 J/kg: 64 mJ in all."""
    heavy = fast().model_copy(update={"material": fast().material.model_copy(update={"density": 3000.0})})
    health, _ = watched(fast(), heavy, velocity=(math.sqrt(share * 2 * 8.0), 0.0, 0.0))
    vital = health.read()
    assert vital.kinetic == pytest.approx(share * 0.064, rel=1e-5) and (vital.complaint is None) is sound
    if not sound:
        assert vital.complaint == "kinetic energy of 0.0641 J exceeds what the scenario can supply (0.032 J)"


def test_what_is_not_finite_is_counted_over_the_worlds():
    health, pool = watched(fast(), fast().model_copy(update={"seed": 1}), n=3)
    x, v = pool.position.numpy(), pool.velocity.numpy()
    v[1, 2], x[64, 0], v[65, 1] = np.nan, np.inf, np.inf
    v[3], v[67] = np.nan, np.nan  # beyond the count of their worlds
    pool.position.assign(x)
    pool.velocity.assign(v)
    assert health.read().complaint == "3 particles have a non-finite position or velocity"


def test_fault_bits_are_words():
    health, pool = watched(fast())
    assert health.broken() is None and health.read().complaint is None
    for bits, words in (
        (FAULT_STATE, "a particle's state is not finite, or beyond that of any matter"),
        (FAULT_ASTRAY, "a particle was thrown out of the domain, or faster than 306 m/s"),
        (int(FAULT_ASTRAY) | int(FAULT_STATE), "a particle was thrown"),
        (1, None),
    ):
        pool.fault.fill_(int(bits))
        assert (health.broken() or "").startswith(words or "") and health.read().complaint == health.broken()
        assert (health.broken() is None) is (words is None)
    assert (int(FAULT_ASTRAY), int(FAULT_STATE)) == (1024, 2048)


def audited(field, index, value, component=None):
    """(fault bits, the value afterwards) when one particle's field is set."""
    health, pool = watched(fast(), fast().model_copy(update={"seed": 1}))
    assert health.audit() is None and pool.fault.numpy()[0] == 0
    values = pool.fields[field].numpy().copy()
    if component is None:
        values[index] = value
    else:
        values[index, component] = value
    pool.fields[field].assign(values)
    health.audit()
    return int(pool.fault.numpy()[0]), pool.fields[field].numpy()[index]


@pytest.mark.parametrize(
    ("field", "good", "bad"),
    [
        ("volume", (1.01e-12, 0.99e-3), (0.99e-12, 1.01e-3, np.nan, -1e-6)),
        ("mass", (1.01e-9, 0.99), (0.99e-9, 1.01, np.inf)),
        ("birth_time", (0.0, 0.0199), (-1e-6, 0.0201)),
        ("held", (0, 1, 2), (-1, 3)),
        ("phase", (0,), (-1, 1)),
    ],
)
def test_every_field_is_audited_against_its_range(field, good, bad):
    for index in (0, 1, 64, 65):
        for value in good:
            assert audited(field, index, value)[0] == 0
        for value in bad:
            bits, after = audited(field, index, value)
            assert bits == FAULT_STATE
            if field in ("held", "phase"):
                assert after == 0  # lest it be used as an address
    assert audited(field, 2, bad[0])[0] == 0 and audited(field, 66, bad[0])[0] == 0  # nobody is there


@pytest.mark.parametrize("component", [0, 1, 2])
def test_vectors_are_audited_in_every_component(component):
    for value, bits in ((0.99e18, 0), (-0.99e18, 0), (1.01e18, FAULT_STATE), (np.nan, FAULT_STATE)):
        assert audited("velocity", 65, value, component)[0] == bits
    reach = 0.08
    for value, bits in (
        (-0.999 * reach, 0),
        (0.2 + 0.999 * reach, 0),
        (-1.01 * reach, FAULT_ASTRAY),
        (0.2 + 1.01 * reach, FAULT_ASTRAY),
        (np.nan, FAULT_ASTRAY),
    ):
        found, after = audited("position", 65, value, component)
        assert found == bits
        if bits:
            assert after == pytest.approx(
                [0.1 if k == component else 0.11 for k in range(3)]
            )  # the middle of the domain


def test_carried_particles_are_a_kind_of_their_own():
    assert (int(FREE), int(CARRIED)) == (0, 1)
