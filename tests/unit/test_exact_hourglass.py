"""PBD's hourglass control by hand: what no gradient shows is pulled back as stiffly as said, and nothing else is."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import define
from fluidbench.scenario.material import Material
from solvers.lattice import lattice, opposed
from solvers.pbd.numbers import distances, second_moment, stiffest
from solvers.smoothing import drag_weight

from .test_exact_sph import PERIODIC, RATES, SIDE, zigzag

DT, YOUNG, DENSITY = 1e-4, 1e5, 1000.0
PASTE = {"density": 1000.0, "youngs_modulus": 1e4, "yield_stress": 10.0}
WEIGHTS = np.array([drag_weight(float(r) / 2.4, 2.4) for r in distances(2.4)])


def cube(zeta=1.0, periodic=False, side=6):
    """A cube of particles at rest, 1 m apart: a periodic lattice, or with free faces."""
    size, side = (SIDE, SIDE) if periodic else (20, side)
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
@pytest.mark.parametrize("zeta", [0.0, 0.5, 1.0])
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


@pytest.mark.parametrize(("support", "most"), [(2.0, 1.5), (2.4, 1.02), (3.0, 1.3), (3.5, 1.85)])
def test_viscosity_holds_what_is_explicit_in_it(support, most):
    """Of plane waves in a lattice: stress by corrected gradients and hourglass control at zeta = 1, over G times the
    pairs of a unit viscosity, weighed by their fullness. A step holds up to twice that."""
    places, r = lattice(support), distances(support)
    near = (r > 0) & (r < support)
    places, r = places[near], r[near]
    drag = np.array([drag_weight(float(x) / support, support) for x in r])
    slopes = (support - r) ** 2 / r
    slopes /= (slopes * r * r).sum() / 3.0
    fullness = (drag * r * r).sum() / 3.0
    ratios = []
    for k in np.stack(np.meshgrid(*[np.linspace(0.05, np.pi, 8)] * 3), axis=-1).reshape(-1, 3):
        phase = places @ k
        gradient = (places * (slopes * np.sin(phase))[:, None]).sum(axis=0)
        off = stiffest(support) * (drag * (1.0 - np.cos(phase))).sum()
        stiff = (gradient @ gradient + off * off) * np.eye(3) + np.outer(gradient, gradient) / 3.0
        pairs = np.einsum("n,na,nb->ab", 10.0 * drag * (1.0 - np.cos(phase)) / (r * r), places, places) / fullness
        ratios.append(np.linalg.eigvals(np.linalg.solve(pairs, stiff)).real.max())
    assert most - 0.15 < max(ratios) < most < 2.0


def test_what_is_packed_more_densely_is_pulled_back_by_as_much_less():
    """q is larger there for the same motion, and so is what the traction does: over the packing squared."""
    simulation, packed = cube(side=15), 0.85
    pool, places = simulation.pool, simulation.frame()["position"].astype(float)
    first = places.copy()
    places = 10.0 + packed * (places - 10.0)
    pool.position.assign(np.pad(places, ((0, pool.size - len(places)), (0, 0))).astype(np.float32))
    pool.stale = True
    velocity = zigzag(first)
    pulled = strained(simulation, velocity).pulled.numpy()[: len(places)].astype(float)
    middle = int(np.argmin(np.linalg.norm(places - 10.0, axis=1)))
    far = np.linalg.norm(places - places[middle], axis=1)
    near = (far > 0) & (far < 2.4)
    weights = np.array([drag_weight(float(x) / 2.4, 2.4) for x in far[near]])
    moment = sum(45.0 / (np.pi * 2.4**6) * (2.4 - x) ** 2 * x for x in far[near]) / 3.0
    packing = moment / second_moment(2.4)
    against = weights[np.abs(velocity[near] - velocity[middle]).max(axis=1) > 1e-3].sum()
    wanted = -YOUNG / 2.6 / DENSITY * (stiffest(2.4) * 2.0 * against / packing) ** 2 * DT * velocity[middle]
    assert packing > 1.4
    assert pulled[middle] == pytest.approx(wanted, rel=2e-2, abs=1e-9)


def test_what_expands_has_none():
    paste = PASTE | {"expansion": {"kind": "growth", "ratio": 2.0, "time": 1.0}}
    config = get_method("pbd").Config()
    assert config.zeta(Material(**PASTE)) == 1.0 and config.zeta(Material(**paste)) == 0.0
