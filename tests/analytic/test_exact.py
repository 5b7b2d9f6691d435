"""Exact answers beside those of scenarios/analytic: rest, rotation, and bounds that hold at the extremes."""

import pytest

from fluidbench.errors import UserError
from fluidbench.method.verdict import Verdict
from fluidbench.native.simulation import Simulation

from ..conftest import drive, scenario

H, C = 0.2, 14.0


def tank(**table):
    """Water 0.2 m deep in a smooth tank 0.1 m square, c = 10 sqrt(g H)."""
    base = {
        "domain": {"lower": [0, 0, 0], "upper": [0.1, 0.1, 0.3], "walls": {"z_lower": "slip"}},
        "material": {"density": 1000.0, "sound_speed": C},
        "bodies": [{"kind": "box", "center": [0.05, 0.05, H / 2], "size": [0.1, 0.1, H]}],
        "duration": 0.4,
        "spacing": 0.01,
    }
    return scenario(**{**base, **table})


@pytest.mark.parametrize("name", ["mpm", "sph", "pbd"])
def test_a_tank_at_rest_keeps_its_volume(name):
    """The surface settles by about H e / 2 with e = g H / c^2 and no further; PBD by its own small compliance."""
    sim = Simulation(tank(), name)
    assert drive(sim).verdict is Verdict.COMPLETED
    top = sim.pool.snapshot()["position"][:, 2].max() + 0.005
    assert top == pytest.approx(H, abs=0.006)


def disc_momentum(sim) -> float:
    """Angular momentum about z through the disc's centre, the particles' own spin included."""
    frame = sim.frame()
    m, v = frame["mass"].astype(float), frame["velocity"].astype(float)
    x = frame["position"].astype(float) - [0.2, 0.2, 0.1]
    return (m * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])).sum() + frame["spin"][:, 2].astype(float).sum()


@pytest.mark.parametrize("name", ["mpm", "sph"])
def test_rigid_rotation_keeps_angular_momentum(name):
    """An elastic disc, four particles thick, spins half a turn: APIC and corrected gradients lose nothing but
    round-off (references.md, A)."""
    omega = 10.0
    body = {
        "kind": "cylinder",
        "center": [0.2, 0.2, 0.1],
        "radius": 0.1,
        "height": 0.05,
        "angular_velocity": [0.0, 0.0, omega],
    }
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.4, 0.4, 0.2]},
        bodies=[body],
        gravity=[0.0, 0.0, 0.0],
        material={"density": 1000.0, "youngs_modulus": 1e5, "poisson_ratio": 0.3},
        duration=0.314,
        spacing=0.0125,
    )
    sim = Simulation(s, name)
    sim.prepare()
    disc, started = s.bodies[0], None
    while sim.done < sim.ticks:
        sim.advance_tick()
        sim.look()
        started = disc_momentum(sim) if started is None else started
    assert started == pytest.approx(0.5 * 1000.0 * disc.volume * disc.radius**2 * omega, rel=0.1)  # coarse lattice
    assert abs(disc_momentum(sim) / started - 1) < 1e-3


@pytest.mark.parametrize("viscosity", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", ["mpm", "sph", "pbd"])
def test_default_bounds_hold_across_viscosities(name, viscosity):
    """No run may diverge under its own bounds; energy only falls (references.md, H)."""
    s = tank(material={"density": 1000.0, "sound_speed": C, "viscosity": viscosity}, duration=0.004, spacing=0.0125)
    assert drive(Simulation(s, name)).verdict is Verdict.COMPLETED


@pytest.mark.parametrize("youngs", [1e4, 1e6, 1e8])
@pytest.mark.parametrize("name", ["mpm", "sph", "pbd"])
def test_default_bounds_hold_across_stiffness(name, youngs):
    material = {"density": 1000.0, "youngs_modulus": youngs, "yield_stress": 100.0, "plastic_viscosity": 1.0}
    s = tank(material=material, duration=0.004, spacing=0.0125)
    assert drive(Simulation(s, name)).verdict is Verdict.COMPLETED


def test_sph_refuses_what_its_own_weight_would_crush():
    """Water 0.2 m deep as soft as 1 kPa: sqrt(g H) is above its speed of sound."""
    soft = tank(material={"density": 1000.0, "youngs_modulus": 1e3, "yield_stress": 100.0})
    with pytest.raises(UserError, match="too near its own sound"):
        Simulation(soft, "sph")
