"""What one substep makes of simple fields on a lattice: a compression, a gradient of pressure or of stress, a parabola.

A layer 24 particles thick, periodic along x and y, without gravity; only its middle, far from both surfaces, is judged.
"""

import math

import numpy as np
import pytest

from fluidbench.native.simulation import Simulation
from solvers.lattice import lattice
from solvers.readout import shear_stress
from solvers.smoothing import drag_weight

from ..conftest import scenario

D, LAYERS, RHO, C = 0.01, 24, 1000.0, 5.0
WALLS = {f"{axis}_{end}": "periodic" for axis in "xy" for end in ("lower", "upper")}
MIDDLE = 0.5 * LAYERS * D + 8 * D


def layer(method, **material):
    """(simulation, heights above the middle of all slots, slots of the middle)."""
    top = (LAYERS + 16) * D
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [8 * D, 8 * D, top], "walls": WALLS},
        gravity=[0, 0, 0],
        bodies=[{"kind": "box", "center": [4 * D, 4 * D, MIDDLE], "size": [8 * D, 8 * D, LAYERS * D]}],
        material={"density": RHO, **material},
        spacing=D,
        duration=1.0,
        tick=0.1,
    )
    sim = Simulation(s, method, graphs=False)
    sim.prepare()
    z = sim.pool.position.numpy()[:, 2].astype(float) - MIDDLE
    active = np.arange(len(z)) < sim.pool.counts[0]
    return sim, np.where(active, z, 0.0), active & (np.abs(z) < 2 * D)


def put(sim, field, values, component=None):
    """Add to a field of the pool."""
    now = sim.pool.fields[field].numpy().copy()
    if component is None:
        now += values.astype(np.float32)
    else:
        now[:, component] += values.astype(np.float32)
    sim.pool.fields[field].assign(now)


def gained(sim, dt):
    """Acceleration of every slot over one substep."""
    before = sim.pool.velocity.numpy().astype(float)
    sim.march(dt, 1)
    return (sim.pool.velocity.numpy() - before) / dt


@pytest.mark.parametrize(
    "material", [{"sound_speed": C}, {"youngs_modulus": 1e4, "yield_stress": 1e3}], ids=["liquid", "paste"]
)
def test_sph_becomes_denser_at_the_rate_of_its_compression(material):
    """v_z = -a z: rho grows by rho a dt."""
    sim, z, middle = layer("sph", **material)
    put(sim, "velocity", -2.0 * z, 2)
    sim.march(1e-3, 1)
    assert sim.pool.density.numpy()[middle] / RHO - 1 == pytest.approx(np.full(middle.sum(), 2e-3), rel=0.02)


@pytest.mark.parametrize("method", ["mpm", "sph"])
def test_pressure_pushes_by_its_gradient(method):
    """p = K e z about no pressure, on average over the middle: an acceleration of -c^2 e."""
    sim, z, middle = layer(method, sound_speed=C, tension_limit=1e18)
    if method == "sph":
        put(sim, "density", RHO * 0.2 * z)
    else:
        put(sim, "volume_ratio", -0.2 * z)
    a = gained(sim, 1e-5)[middle].mean(axis=0)
    assert a == pytest.approx([0.0, 0.0, -0.2 * C**2], rel=0.01, abs=1e-3)


@pytest.mark.parametrize("method", ["mpm", "sph", "pbd"])
def test_shear_stress_pulls_by_its_gradient(method):
    """tau_xz = G k z: an acceleration of G k / rho along x, G = 20 Pa; by PBD once its own passes have seen it."""
    sim, z, middle = layer(method, youngs_modulus=52.0, yield_stress=15.0)
    put(sim, "elastic_shear", 0.5 * z, 1)
    if method == "pbd":
        sim.march(1e-5, 1)
    a = gained(sim, 1e-5)[middle]
    assert a[:, 0] == pytest.approx(np.full(middle.sum(), 0.5 * 20.0 / RHO), rel=0.02)


def test_viscosity_of_sph_flattens_a_parabola():
    """v_x = k z^2 / 2: an acceleration of nu k, times what a lattice makes of sums that are 1 in the continuum.
    Artificial viscosity, alpha h c / 10, adds half of its own: it acts on those that approach."""
    r = lattice(3.6)
    r2 = np.maximum((r * r).sum(axis=1), 1e-9)
    w = np.array([drag_weight(math.sqrt(v) / 3.6, 3.6) for v in r2])
    shear, full = 5.0 * (w * r[:, 0] ** 2 * r[:, 2] ** 2 / r2).sum(), (w * r2).sum() / 3.0
    artificial = 0.5 * 0.01 * 1.8 * D * C / 10.0
    sim, z, middle = layer("sph", viscosity=4.0, sound_speed=C)
    put(sim, "velocity", 0.5 * 3.0 * z**2, 0)
    assert gained(sim, 1e-4)[middle, 0].mean() == pytest.approx((shear / full * 4.0 / RHO + artificial) * 3.0, rel=1e-3)


@pytest.mark.parametrize("method", ["mpm", "sph", "pbd"])
def test_gravity_is_felt_in_full(method):
    """Free fall, but for rounding of the sums."""
    sim, _, middle = layer(method, sound_speed=C)
    force = sim.scene.force.numpy()
    force["uniform"] = [0.0, 1.0, -3.0]
    sim.scene.force.assign(force)
    a = gained(sim, 1e-3)[middle]
    assert a == pytest.approx(np.tile([0.0, 1.0, -3.0], (middle.sum(), 1)), abs=1e-3)


@pytest.mark.parametrize("method", ["mpm", "sph", "pbd"])
def test_what_has_yielded_before_yields_later(method):
    """A shear of 0.1 in a step: stress returns to the yield stress that plastic strain has raised, and raises it on."""
    before, shear, dt = 0.1, 100.0, 1e-3
    law = {"youngs_modulus": 2.6e4, "yield_stress": 100.0, "saturated_yield_stress": 700.0, "hardening": 10.0}
    sim, z, middle = layer(method, **law)  # G = 10 kPa: a trial stress of 1 kPa
    put(sim, "plastic_strain", np.full(len(z), before))
    put(sim, "velocity", shear * z, 0)
    if method == "mpm":
        sim.pool.affine.assign(np.tile(np.float32([[0, 0, shear], [0, 0, 0], [0, 0, 0]]), (len(z), 1, 1)))
    sim.march(dt, 1)
    tau = shear_stress(sim.scene, sim.pool)
    assert tau is not None
    assert tau[middle] == pytest.approx(700.0 - 600.0 * np.exp(-10.0 * before), rel=1e-2)
    more = sim.pool.plastic_strain.numpy()[middle] - before
    assert more == pytest.approx((0.1 - tau[middle].mean() / 1e4) / np.sqrt(3.0), rel=2e-2)
