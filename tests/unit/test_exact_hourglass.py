"""PBD's hourglass control by hand: what no gradient shows is pulled back as stiffly as said, and nothing else is."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import define
from solvers.lattice import lattice, opposed
from solvers.pbd.numbers import distances, stiffest
from solvers.smoothing import drag_weight

from .test_exact_sph import PERIODIC, RATES, SIDE, zigzag

DT, YOUNG, DENSITY = 1e-4, 1e5, 1000.0
WEIGHTS = np.array([drag_weight(float(r) / 2.4, 2.4) for r in distances(2.4)])


def cube(zeta=1.0, periodic=False):
    """A cube of particles at rest, 1 m apart: a periodic lattice, or with free faces."""
    size, side = (SIDE, SIDE) if periodic else (20, 6)
    walls = {"walls": PERIODIC} if periodic else {}
    scenario = define(
        "cube",
        domain={"lower": [0, 0, 0], "upper": [size] * 3} | walls,
        bodies=[{"kind": "box", "center": [size / 2] * 3, "size": [side] * 3}],
        material={"density": DENSITY, "youngs_modulus": YOUNG, "poisson_ratio": 0.3},
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=1.0,
    )
    return Simulation(scenario, "pbd", Target(), get_method("pbd").Config(hourglass=zeta))


def disordered(simulation):
    """Its places, moved by up to 0.15 spacings."""
    pool, places = simulation.pool, simulation.frame()["position"].astype(float)
    places += np.random.default_rng(1).uniform(-0.15, 0.15, places.shape)
    pool.position.assign(np.pad(places, ((0, pool.size - len(places)), (0, 0))).astype(np.float32))
    pool.stale = True
    return places


def strained(simulation, velocity):
    """Its pool after the passes of elastic stress at a velocity, without the rest of a substep."""
    solver = simulation.solver
    simulation.kick(velocity)
    simulation.scene.dt.fill_(DT)
    solver.refresh()
    for name in ("lists", "pack", "strain", "pull"):
        getattr(solver, name)()
    return simulation.pool


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("zeta", [0.0, 1.0, 2.0])
def test_the_shortest_wave_is_pulled_back_as_stiffly_as_zeta_says(axes, zeta):
    """4 zeta (c_s f / d)^2 on what a step has displaced; without zeta nothing resists it."""
    simulation = cube(zeta, periodic=True)
    velocity = zigzag(simulation.frame()["position"].astype(float), axes)
    pulled = strained(simulation, velocity).pulled.numpy()[: len(velocity)].astype(float)
    f = opposed(lattice(2.4), WEIGHTS, axes) * stiffest(2.4)
    shear = YOUNG / 2.6 / DENSITY  # c_s^2
    assert pulled == pytest.approx(-4.0 * zeta * shear * f * f * DT * velocity, abs=1e-3 * 8.0 * shear * DT * 1e-3)


@pytest.mark.parametrize("name", RATES)
def test_a_linear_flow_is_not_pulled_back_wherever_particles_lie(name):
    """A disordered cube with free faces; beside it the same cube in a flow that is not linear."""
    seen = []
    for bend in (0.0, 1.0):
        simulation = cube()
        places = disordered(simulation)
        velocity = (places - 10.0) @ RATES[name].T + [3.0, -1.0, 2.0]
        velocity[:, 0] += bend * 0.1 * (places[:, 1] - 10.0) ** 2
        seen.append(np.abs(strained(simulation, velocity).off_linear.numpy()[: len(places)]).max() / DT)
    assert seen[0] < 1e-4 and seen[1] > 0.05


def test_what_pulls_back_has_neither_thrust_nor_torque():
    simulation = cube()
    places = disordered(simulation)
    z = np.zeros((simulation.pool.size, 3), np.float32)
    z[: len(places)] = np.random.default_rng(2).normal(size=places.shape)
    simulation.pool.off_linear.assign(z)
    a = strained(simulation, np.zeros_like(places)).pulled.numpy()[: len(places)].astype(float)
    size = np.abs(a).sum()
    assert size > 0.0
    assert np.abs(a.sum(axis=0)).max() < 1e-5 * size
    assert np.abs(np.cross(places - 10.0, a).sum(axis=0)).max() < 1e-5 * size * 3.0


def test_viscosity_is_as_stiff_as_what_is_explicit_in_it():
    """Of plane waves in a lattice: stress by corrected gradients and hourglass control at zeta = 1, over G times the
    pairs of a unit viscosity. A step holds up to twice that."""
    places, r = lattice(2.4), distances(2.4)
    near = r > 0
    places, r, drag = places[near], r[near], WEIGHTS[near]
    slopes = np.maximum(2.4 - r, 0.0) ** 2 / r
    slopes /= (slopes * r * r).sum() / 3.0
    ratios = []
    for k in np.stack(np.meshgrid(*[np.linspace(0.05, np.pi, 8)] * 3), axis=-1).reshape(-1, 3):
        phase = places @ k
        gradient = (places * (slopes * np.sin(phase))[:, None]).sum(axis=0)
        off = stiffest(2.4) * (drag * (1.0 - np.cos(phase))).sum()
        stiff = (gradient @ gradient + off * off) * np.eye(3) + np.outer(gradient, gradient) / 3.0
        pairs = np.einsum("n,na,nb->ab", 10.0 * drag * (1.0 - np.cos(phase)) / (r * r), places, places)
        ratios.append(np.linalg.eigvals(np.linalg.solve(pairs, stiff)).real.max())
    assert 0.98 < max(ratios) < 1.02
