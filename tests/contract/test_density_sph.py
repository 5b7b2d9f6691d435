"""What SPH's densities follow, and what pressure makes of them: exact answers from a substep or a few."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from solvers.aging import DISORDER

from ..conftest import PERIODIC, scenario

PASTE = {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 100.0}


@pytest.mark.parametrize("start", [1.2, 0.8, 0.98])
def test_the_density_of_sph_follows_that_of_a_crowd_at_its_rate(start):
    """d rho = dt f (c / h) (rho_lattice - 1.1 rho) where that is positive, in a full period at rest."""
    edge = 0.12
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [edge] * 3, "walls": PERIODIC},
        gravity=[0, 0, 0],
        spacing=0.01,
        bodies=[{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3}],
        material={"density": 1000.0, "sound_speed": 4.0},
    )
    sim, dt = Simulation(s, "sph"), 1e-4
    sim.pool.density.fill_(1000.0 * start)
    sim.march(dt, 1)
    crowd = max(1000.0 * (1.0 - (1.0 + DISORDER) * start), 0.0)
    expected = dt * sim.config.density_feedback * 4.0 / (1.8 * 0.01) * crowd
    change = sim.pool.density.numpy()[: sim.pool.counts[0]] - np.float32(1000.0 * start)
    assert change == pytest.approx(np.full(len(change), expected), rel=0.02, abs=2e-4)
    assert bool(expected != 0.0) is (start == 0.8)


@pytest.mark.parametrize(("tension", "seen"), [(1e6, False), (0.0, True)])
def test_a_liquid_under_tension_sees_no_volume_in_a_flow_that_has_none(tension, seen):
    """A drop that is drawn out and sheared in the air, up to its faces and edges; in a corner too few neighbours span
    space. A plain sum, good enough for what feels no tension, takes a tenth of the rate for volume there."""
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.2] * 3},
        gravity=[0, 0, 0],
        spacing=0.01,
        bodies=[{"kind": "box", "center": [0.1] * 3, "size": [0.08] * 3}],
        material={"density": 1000.0, "sound_speed": 4.0, "viscosity": 0.1, "tension_limit": tension},
    )
    sim, dt = Simulation(s, "sph"), 1e-4
    x = sim.frame()["position"].astype(float) - 0.1
    sim.kick(x @ np.array([[1.0, 0.5, -0.8], [1.2, 1.0, 0.3], [0.4, -0.6, -2.0]]).T)
    sim.march(dt, 1)
    rate = np.abs(sim.pool.density.numpy()[: len(x)].astype(float) / 1000.0 - 1.0) / dt
    corner = (np.abs(x) > 0.03).all(axis=1)
    assert bool(rate[~corner].max() > 0.1) is seen
    assert rate[~corner].max() < (1.0 if seen else 5e-3) and rate[corner].max() < (1.0 if seen else 0.5)
    assert corner.sum() == 8


@pytest.mark.parametrize("tension", [1e6, 0.0])
def test_pressure_does_the_work_of_the_density_that_it_comes_of(tension):
    """sum m v.a = -sum m p / rho^2 d rho / dt: force and density are each other's transpose, in a cluster of any shape
    and disorder, at its corners as within; momentum stays, too."""
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.2] * 3},
        gravity=[0, 0, 0],
        spacing=0.01,
        bodies=[{"kind": "box", "center": [0.1] * 3, "size": [0.04, 0.05, 0.03]}],
        material={"density": 1000.0, "sound_speed": 4.0, "tension_limit": tension},
    )
    config = get_method("sph").Config(artificial_viscosity=0.0, density_diffusion=0.0, density_feedback=0.0)
    sim, dt, rng = Simulation(s, "sph", config=config), 1e-5, np.random.default_rng(3)
    n = sim.pool.counts[0]
    for name, to in (("position", 3e-3), ("velocity", 1.0), ("density", 40.0)):
        values = sim.pool.fields[name].numpy()
        values[:n] += to * rng.uniform(-1.0, 1.0, values[:n].shape)
        sim.pool.fields[name].assign(values)
    if tension == 0.0:  # nothing cavitates
        sim.pool.density.assign(sim.pool.density.numpy() + np.float32(50.0))
    sim.pool.stale = True
    mass, before = sim.pool.mass.numpy()[:n].astype(float), sim.pool.density.numpy()[:n].astype(float)
    v = sim.pool.velocity.numpy()[:n].astype(float)
    sim.march(dt, 1)
    rho = sim.pool.density.numpy()[:n].astype(float)
    a = sim.solver.acceleration.numpy()[:n].astype(float)
    pressure = 16.0 * (rho - 1000.0)
    work = -np.sum(mass * pressure / (rho * rho) * (rho - before) / dt)
    assert np.sum(mass[:, None] * v * a) == pytest.approx(work, rel=5e-3)
    assert np.abs(mass @ a).max() < 1e-4 * np.sum(mass * np.linalg.norm(a, axis=1))


@pytest.mark.parametrize("backend", ["warp", "taichi"])
@pytest.mark.parametrize(
    "material", [{"viscosity": 1.0, "tension_limit": 1e6}, {"youngs_modulus": 2e4, "yield_stress": 1e-3}]
)
def test_densities_level_as_matter_shears_or_grows_and_what_varies_evenly_stays(material, backend):
    """Of what carries tension: what differs from particle to particle goes at a rate of shears and growth; where
    nothing shears nothing does, and an even gradient, whatever carries it, stays up to the faces."""
    edge, uneven, gradient = 0.12, 20.0, 300.0

    def levelled(shear, unlike, even, growth=None):
        """By diffusion [kg/m^3/s], beside what densities are off [kg/m^3], and on or near how many faces each is."""
        rates, foams = [], {} if growth is None else {"expansion": {"ratio": 2.0, "delay": 9.0}}
        s = scenario(
            domain={"lower": [-0.1] * 3, "upper": [edge + 0.1] * 3},
            gravity=[0, 0, 0],
            spacing=0.01,
            bodies=[{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3}],
            material={"density": 1000.0, "sound_speed": 160.0} | material | foams,
        )
        for diffusion in (0.1, 0.0):
            config = get_method("sph").Config(density_diffusion=diffusion, density_feedback=0.0, viscosity="explicit")
            sim, dt = Simulation(s, "sph", Target("cpu", backend), config), 1e-5
            x = sim.frame()["position"].astype(float)
            rho = 1000.0 + even * (x[:, 0] - edge / 2) + unlike * (-1.0) ** np.rint(x.sum(axis=1) / 0.01)
            if growth is not None:
                sim.pool.growth.fill_(growth)
            for _ in range(2):  # the gradient is that of a substep before
                sim.pool.density.assign(rho.astype(np.float32))
                sim.kick(np.outer(x[:, 2], [shear, 0.0, 0.0]))
                sim.march(dt, 1)
            rates.append((sim.pool.density.numpy()[: len(x)].astype(float) - rho) / dt)
        outside = np.abs(x - edge / 2) > edge / 2 - 0.031
        return rates[0] - rates[1], rho - 1000.0, outside.sum(axis=1)

    slow, off, faces = levelled(5.0, uneven, 0.0)
    slow, off = slow[faces == 0], off[faces == 0]
    fast = levelled(10.0, uneven, 0.0)[0][faces == 0]
    assert (slow / off).max() < 0.0 and np.abs(slow / off).min() > 32 * 5.0 / 10
    assert fast == pytest.approx(2.0 * slow, rel=0.05)
    foam = [levelled(shear, uneven, 0.0, growth)[0][faces == 0] for shear, growth in ((5.0, 5.0), (10.0, 0.0))]
    assert foam[0] == pytest.approx(foam[1], rel=0.05)
    still = levelled(0.0, uneven, 0.0)[0]
    assert np.abs(still).max() < 0.01 * np.abs(slow).max()
    even, slope, faces = levelled(5.0, 0.0, gradient)
    assert np.abs(even[faces < 3]).max() < 1e-3 * np.abs(slow / off).max() * np.abs(slope).max()  # but in corners


@pytest.mark.parametrize(("crowded", "pushed"), [(1.3, True), (1.05, False), (0.8, False)])
@pytest.mark.parametrize("foams", [True, False])
def test_foam_that_rests_within_other_foam_is_told_so(foams, crowded, pushed):
    """d rho = dt f (c / h) (rho_lattice - 1.1 rho), in a full period that neither moves nor yields; a paste is left
    alone."""
    edge = 0.12
    material = PASTE | {"sound_speed": 4.0} | ({"expansion": {"ratio": 8.0, "delay": 9.0}} if foams else {})
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [edge] * 3, "walls": PERIODIC},
        gravity=[0, 0, 0],
        spacing=0.01,
        bodies=[{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3}],
        material=material,
    )
    sim, dt = Simulation(s, "sph"), 1e-4
    rest, sound = 1000.0, sim.scene.phases.numpy()["wave_speed"].flat[0]
    if foams:  # four times as light as it was
        rest, sound = rest / 4.0, sound * 2.0
        sim.pool.mass.assign(sim.pool.mass.numpy() / 4.0)
    sim.pool.mass.assign(sim.pool.mass.numpy() * np.float32(crowded))
    sim.pool.volume.assign(sim.pool.volume.numpy() * np.float32(crowded))
    sim.pool.density.fill_(rest)
    sim.march(dt, 1)
    change = sim.pool.density.numpy()[: sim.pool.counts[0]].astype(float) - rest
    h = sim.config.smoothing(s.material) * 0.01
    expected = dt * sim.config.density_feedback * sound / h * (crowded - 1.1) * rest if pushed and foams else 0.0
    assert change == pytest.approx(np.full(len(change), expected), rel=0.03, abs=1e-4)
