"""Explicit viscosity of SPH: the operator of implicit viscosity, the rate at which it damps, and thin films."""

import math

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import define
from solvers.lattice import drag_rate, stiffest_drag
from solvers.smoothing import drag_weight, pair_drag, shared_viscosity
from solvers.sph.bounds import damping

PERIODIC = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}
STUCK = PERIODIC | {"y_lower": "stick", "y_upper": "stick", "z_lower": "stick", "z_upper": "stick"}
SLIPPERY = PERIODIC | {"z_lower": "slip", "z_upper": "slip"}
NOTHING_ELSE = {"artificial_viscosity": 0.0, "density_diffusion": 0.0, "density_feedback": 0.0, "shifting": 0.0}
NOTHING_ELSE |= {"artificial_viscosity_solid": 0.0, "artificial_viscosity_viscoelastic": 0.0, "hourglass": 0.0}
VISCOUS = {"density": 1000.0, "viscosity": 1e3, "sound_speed": 1.0}
SOFT = VISCOUS | {"youngs_modulus": 1.0, "poisson_ratio": 0.3}
SETTING = VISCOUS | {"cure": {"kind": "linear", "time": 1.0, "viscosity": 1e4}}
NAMES = ("tensile", "cavitating", "elastic", "growing", "setting")
GROWING = VISCOUS | {"expansion": {"ratio": 1.1, "time": 10.0, "split": False}}


def piece(size, walls=None, material=VISCOUS, jitter=0.2, spacing=1.0):
    """A block [spacings] that fills a box with such walls; without them it is in free space."""
    size = [n * spacing for n in size]
    around = {"lower": [0, 0, 0], "upper": size, "walls": walls}
    free = {"lower": [-40.0 * spacing] * 3, "upper": [40.0 * spacing] * 3}
    return define(
        "piece",
        domain=free if walls is None else around,
        material=material,
        bodies=[{"kind": "box", "center": [n / 2 for n in size], "size": size}],
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=spacing,
        jitter=jitter,
    )


def accelerations(scenario, velocity, growth=0.0):
    """Of SPH at once under explicit viscosity, with nothing else that damps."""
    simulation = Simulation(scenario, "sph", Target(), get_method("sph").Config(viscosity="explicit", **NOTHING_ELSE))
    simulation.kick(velocity)
    if growth:
        simulation.pool.growth.fill_(growth)
    simulation.march(1e-9, 1)
    return simulation.solver.acceleration.numpy()[: len(velocity)].astype(float)


def implicit(scenario, velocity):
    """Accelerations by viscosity, of a step so short that no iteration is needed: that of the velocities given."""
    config = get_method("sph").Config(viscosity="implicit", viscous_tolerance=1e-2, **NOTHING_ELSE)
    simulation = Simulation(scenario, "sph", Target(), config)
    simulation.kick(velocity)
    simulation.march(1e-3, 1)
    assert simulation.solver.solves()["iterations"] == 0.0
    return simulation.pool.drag.numpy()[: len(velocity)].astype(float)


def shaken(scenario):
    places = Simulation(scenario, "sph", Target()).frame()["position"].astype(float)
    return places, np.random.default_rng(1).normal(size=places.shape).astype(np.float32)


@pytest.mark.parametrize("walls", [PERIODIC, STUCK, SLIPPERY, None], ids=["periodic", "stuck", "slippery", "free"])
@pytest.mark.parametrize("material", [VISCOUS, VISCOUS | {"tension_limit": 0.0}, SOFT, GROWING, SETTING], ids=NAMES)
def test_explicit_and_implicit_viscosity_are_one_operator(walls, material):
    """What depends on velocity is odd in it. Where matter is thin the two differ by what each takes for its least
    fullness: none of this block is, but for its edges in free space."""
    scenario = piece((8, 8, 8), walls, material, jitter=0.1)
    places, v = shaken(scenario)
    explicit = 0.5 * (accelerations(scenario, v) - accelerations(scenario, -v))
    wanted = implicit(scenario, v)
    inner = slice(None) if walls is not None else np.abs(places - 4.0).max(axis=1) < 2.0
    assert np.abs(wanted).max() > 1.0
    assert explicit[inner] == pytest.approx(wanted[inner], abs=2e-3 * np.abs(wanted).max())


def test_matter_that_moves_apart_as_it_grows_feels_no_explicit_drag():
    scenario = piece((8, 8, 8), None, GROWING, jitter=0.1)
    places, _ = shaken(scenario)
    apart = ((places - places.mean(axis=0)) / 3.0).astype(np.float32)
    rest, moved = accelerations(scenario, 0.0 * apart), accelerations(scenario, apart)
    grown = accelerations(scenario, apart, growth=1.0)
    assert np.abs(moved - rest).max() > 1.0 and grown == pytest.approx(rest, abs=1e-3 * np.abs(moved - rest).max())


@pytest.mark.parametrize("size", [(6, 6, 6), (6, 6, 1), (6, 6, 2), (6, 1, 1), (6, 2, 2), (6, 3, 3)])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_sheets_and_threads_hold_at_their_own_step(size, jitter):
    scenario = piece(size, jitter=jitter)
    _, v = shaken(scenario)
    simulation = Simulation(scenario, "sph", Target(), get_method("sph").Config(viscosity="explicit"))
    bound = next(b.dt for b in simulation.bounds() if b.name == "viscous")
    simulation.kick(1e-3 * v)
    before = (1e-6 * v.astype(float) ** 2).sum()
    for _ in range(4):
        simulation.march(bound, 50)
        after = (simulation.frame()["velocity"].astype(float) ** 2).sum()
        assert after <= (1.0 + 1e-4) * before  # rigid motion is left, to rounding
        before = after


@pytest.mark.parametrize(
    ("size", "fullness", "against"),
    [((0, 0, 0), 2.0, 2), ((0, 0, 1), 4 / 3, 2), ((0, 1, 1), 2 / 3, 2), ((1, 1, 2), 1 / 3, 1)],
)
def test_rates_of_drag_by_hand(size, fullness, against):
    """Nearest neighbours alone, by their weight w: so many move against a particle along the fastest wave, and each
    damps what two move by at 10 w over the fullness."""
    w = drag_weight(1.0 / 1.2, 1.2)
    assert drag_rate(size, 1.2, 1e-6) == pytest.approx(2.0 * against * 10.0 / fullness)
    assert drag_rate(size, 1.2, 1e3) == pytest.approx(2.0 * against * 10.0 * w / 1e3)
    assert drag_rate(size, 0.9, 0.25) == 0.0


def test_the_stiffest_is_thin():
    """And no other shape is stiffer by 5 %, of 23 that a step leaves."""
    assert stiffest_drag(3.6, 1e3) == pytest.approx(drag_rate((0, 0, 0), 3.6, 1e3), rel=0.01)
    assert drag_rate((0, 0, 0), 3.6, 0.25) < stiffest_drag(3.6, 0.25) < stiffest_drag(3.6, 0.125)
    for support in (2.6, 3.0, 3.6):
        for size in ((7, 3, 2), (9, 3, 1), (4, 4, 4), (7, 7, 2), (12, 2, 2)):
            assert drag_rate(size, support, 0.25) <= 1.05 * stiffest_drag(support, 0.25)


def test_what_grows_without_splitting_is_damped_as_it_lies_apart():
    """At 8 times its volume it lies twice as far apart, and sees as far as before."""
    growth = {"ratio": 8.0, "time": 1.0}
    whole, split = (piece((2, 2, 2), material=VISCOUS | {"expansion": growth | {"split": s}}) for s in (False, True))
    fresh = 1.8**2 * stiffest_drag(3.6, 0.25)
    assert damping(split, 1.8) == pytest.approx(fresh)
    assert damping(whole, 1.8) >= max(fresh, 1.8**2 * stiffest_drag(1.8, 0.25) / 4.0) > fresh


def test_drag_of_a_pair_by_hand():
    w = drag_weight(0.5, 2.0)
    assert pair_drag(3.0, 1.0, 2.0, 0.1) == pytest.approx(0.1 * 5.0 * 3.0 * w)
    assert pair_drag(3.0, 1e18, 2.0, 1.0) == 0.0 < pair_drag(3.0, 0.0, 2.0, 1.0)
    assert shared_viscosity(3.0, 1.0) == 1.5 and shared_viscosity(3.0, 0.0) == shared_viscosity(0.0, 0.0) == 0.0


@pytest.mark.parametrize(("spacing", "viscosity"), [(1e-5, 1e5), (1e-6, 0.1)])
@pytest.mark.parametrize(("method", "scheme"), [("sph", "explicit"), ("sph", "implicit"), ("pbd", "implicit")])
def test_thick_matter_in_small_is_a_number(method, scheme, spacing, viscosity):
    """As mu / d^7 it was none."""
    scenario = piece((4, 4, 4), None, VISCOUS | {"viscosity": viscosity}, 0.1, spacing=spacing)
    config = get_method(method).Config(**({} if method == "pbd" else {"viscosity": scheme}))
    simulation = Simulation(scenario, method, Target(), config)
    simulation.kick(1e-3 * shaken(scenario)[1])
    simulation.march(1e-9 * spacing, 1)
    assert not simulation.look().complaint and np.isfinite(simulation.frame()["velocity"]).all()


@pytest.mark.parametrize(("layers", "tolerance"), [(1, 0.16), (2, 0.06), (4, 0.025)])
@pytest.mark.parametrize(("method", "scheme"), [("sph", "explicit"), ("sph", "implicit"), ("pbd", "implicit")])
def test_a_film_of_few_particles_runs_down_as_fast_as_it_should(method, scheme, layers, tolerance):
    """On a no-slip floor, mean velocity f h^2 / (3 nu) whatever the depth. Pairs that a free surface lacks are made up
    for, explicit or implicit: without, explicit films of 1, 2 and 4 ran 2.1, 1.2 and 1.03 times as fast."""
    mean, nu, side = 0.05 / layers, 1.0, 8
    walls = {f"{axis}_{end}": "periodic" for axis in "xy" for end in ("lower", "upper")}
    force = 3.0 * nu * mean / layers**2
    film = define(
        "film",
        domain={"lower": [0, 0, 0], "upper": [side, side, layers + 4], "walls": walls | {"z_lower": "stick"}},
        material={"density": 1000.0, "viscosity": 1000.0 * nu, "sound_speed": 20.0 * mean},
        bodies=[{"kind": "box", "center": [side / 2, side / 2, layers / 2], "size": [side, side, layers]}],
        gravity=[0.0, 0.0, -8.0 * mean**2 / layers],
        body_force=[force, 0.0, 0.0],
        duration=0.6 * layers**2 / nu,
        spacing=1.0,
    )
    config = {} if method == "pbd" else {"viscosity": scheme}
    simulation = Simulation(film, method, Target(), get_method(method).Config(**config))
    simulation.prepare()
    simulation.begin()
    z = simulation.frame()["position"][:, 2] / layers
    simulation.kick(np.stack([1.5 * mean * (2.0 * z - z * z), 0 * z, 0 * z], axis=1).astype(np.float32))
    simulation.advance(film.duration)
    ran = float(simulation.frame()["velocity"][:, 0].mean())
    assert math.isclose(ran, mean, rel_tol=tolerance)
