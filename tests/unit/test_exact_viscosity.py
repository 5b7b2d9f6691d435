"""Viscosity implicit in time: the weight of drag, the operator, and what a solve keeps, by hand."""

import copy
import math

import numpy as np
import pytest
import warp as wp
from scipy.integrate import quad

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import define
from fluidbench.scenario.numerics import configure
from solvers.smoothing import drag_weight
from solvers.viscosity import accuracy

from ..conftest import bead

PERIODIC = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}
STUCK = PERIODIC | {"z_lower": "stick", "z_upper": "stick"}
SLIPPERY = PERIODIC | {"z_lower": "slip", "z_upper": "slip"}
SIDE = 8
METHODS = {"sph": {"viscosity": "implicit"}, "pbd": {}}


def made(viscosity=100.0, walls=PERIODIC, jitter=0.0, height=SIDE, spacing=1.0, **more):
    side = SIDE * spacing
    return define(
        "block",
        domain={"lower": [0, 0, 0], "upper": [side, side, height], "walls": walls},
        material={"density": 1000.0, "viscosity": viscosity, "sound_speed": 10.0},
        bodies=[{"kind": "box", "center": [side / 2, side / 2, height / 2], "size": [side, side, height]}],
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=spacing,
        jitter=jitter,
        **more,
    )


def adrift(viscosity, **more):
    """The block in free space."""
    scenario = made(viscosity, **more)
    around = scenario.domain.model_copy(update={"lower": (-40.0, -40.0, -40.0), "upper": (40.0, 40.0, 40.0)})
    return scenario.model_copy(update={"domain": around})


def block(method, scenario, tolerance=1e-6, threads=1, backend="warp"):
    config = get_method(method).Config(viscous_tolerance=tolerance, **METHODS[method])
    return Simulation(scenario, method, Target("cpu", backend, threads), config)


def solved(simulation, velocity, dt, growth=None):
    """Velocities after one viscous solve alone, and how it went, while matter grows at a rate."""
    simulation.prepare()
    simulation.placed = False  # solved where it was shaken to, before it settles
    simulation.begin()
    simulation.kick(np.pad(velocity, ((0, simulation.pool.size - len(velocity)), (0, 0))))
    simulation.scene.set_dt(dt)
    if growth is not None:
        simulation.pool.growth.fill_(growth)
    solver = simulation.solver
    solver.lists()
    return velocity + dt * acceleration(simulation)[: len(velocity)], solver.solves()


def acceleration(simulation):
    """By viscosity alone [m/s^2]."""
    still, found = (wp.zeros(simulation.pool.size, dtype=wp.vec3) for _ in range(2))
    simulation.solver.viscosity.solve(still, found, impulse=False)
    return found.numpy().astype(float)


def noise(simulation, seed=0):
    return np.random.default_rng(seed).normal(0.0, 1.0, (simulation.pool.counts[0], 3)).astype(np.float32)


@pytest.mark.parametrize("support", [2.4, 2.6, 3.0, 3.6])
def test_drag_is_isotropic_in_a_lattice(support):
    axis = np.arange(-4, 5)
    places = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3).astype(float)
    r2 = np.maximum((places**2).sum(axis=1), 1e-9)
    w = np.array([drag_weight(min(math.sqrt(v) / support, 1.0), support) for v in r2])
    along, across = (w * places[:, 0] ** 4 / r2).sum(), (w * places[:, 0] ** 2 * places[:, 2] ** 2 / r2).sum()
    assert 5.0 * across == pytest.approx(1.0, abs=0.033) and 2.5 * (along - across) == pytest.approx(1.0, abs=0.033)
    whole, _ = quad(lambda r: drag_weight(r / support, support) * r**4 * 4.0 * math.pi / 15.0, 0.0, support)
    assert whole == pytest.approx(0.2, rel=1e-4)  # of x^2 z^2 / r^2 over all directions


@pytest.mark.parametrize("walls", [PERIODIC, STUCK, SLIPPERY])
@pytest.mark.parametrize("method", METHODS)
def test_the_operator_is_symmetric_whatever_the_walls(method, walls):
    """x . K y = y . K x of what lies in disorder: conjugate gradients need no more, and no less."""
    simulation = block(method, made(1e6, walls, jitter=0.3))
    a, b = noise(simulation, 1), noise(simulation, 2)
    solved(simulation, a, 1e-2)
    viscosity, n = simulation.solver.viscosity, len(a)
    images = []
    for direction in (a, b):
        rows = viscosity.rows.numpy().reshape(-1, 3, 4)
        rows[:n, 1, :3] = direction
        viscosity.rows.assign(rows.reshape(-1, 4))
        viscosity._over_pairs("image")
        images.append(viscosity.image.numpy()[:n].astype(float))
    (ka, kb), scale = images, np.abs(images[0] * b).sum()
    assert (b * ka).sum() == pytest.approx((a * kb).sum(), abs=2e-6 * scale)
    assert (a * ka).sum() >= (a * a).sum()  # drag only takes
    assert np.abs(ka - a).max() > 1.0


@pytest.mark.parametrize("strain", [np.diag([0.5, 0.5, -1.0]), [[0, 0, 0.5], [0, 0, 0], [0.5, 0, 0]]])
@pytest.mark.parametrize("method", METHODS)
def test_a_free_block_dissipates_what_its_viscosity_says(method, strain):
    """v . (K - 1) v dt^-1 = 2 mu D:D V of a uniform rate of strain: pairs that are missing at surfaces are made up for
    (16 % of it in stretching, 27 % in shear, without)."""
    simulation = block(method, adrift(1e6))
    x = simulation.frame()["position"].astype(float)
    v = (x - x.mean(axis=0)) @ np.float64(strain)
    solved(simulation, v.astype(np.float32), 1e-2)
    viscosity, n = simulation.solver.viscosity, len(x)
    rows = viscosity.rows.numpy().reshape(-1, 3, 4)
    rows[:n, 1, :3] = v
    viscosity.rows.assign(rows.reshape(-1, 4))
    viscosity._over_pairs("image")
    dissipated = 1000.0 * (v * (viscosity.image.numpy()[:n] - v)).sum() / 1e-2
    assert dissipated == pytest.approx(2.0 * 1e6 * np.square(strain).sum() * SIDE**3, rel=0.12)


@pytest.mark.parametrize(("viscosity", "rounding"), [(1e4, 1e-6), (1e6, 1e-6), (1e8, 1e-4)])
@pytest.mark.parametrize("method", METHODS)
def test_a_solve_keeps_momentum(method, viscosity, rounding):
    """To 1e-6, or what noise that is 1e4 times as large in K v rounds to."""
    simulation = block(method, made(viscosity, jitter=0.2), tolerance=1e-3)
    before = noise(simulation)
    after, went = solved(simulation, before, 1e-2)
    assert went["iterations"] >= 1 and went["unconverged"] == 0.0 and went["residual"] <= 1e-3
    assert np.abs(after.sum(axis=0) - before.sum(axis=0)).max() <= rounding * np.abs(before).sum()
    assert (after**2).sum() < (before.astype(float) ** 2).sum()


@pytest.mark.parametrize("method", METHODS)
def test_a_residual_is_measured_by_velocity_and_weight(method):
    """m (v*.v* + (g dt)^2): where g dt is 1e5 times as much, a rounding of velocity is left as it is."""
    heavy = made(jitter=0.2).model_copy(update={"gravity": (0.0, 0.0, -0.1)})
    for scenario, weight in ((heavy, 1e-3), (made(jitter=0.2), 0.0)):
        simulation = block(method, scenario, tolerance=1e-4)
        before = 1e-8 * noise(simulation)
        after, went = solved(simulation, before, 1e-2)
        total, m = simulation.solver.viscosity.iterations.totals.numpy()[0], simulation.frame()["mass"].astype(float)
        wanted = (m * ((before.astype(float) ** 2).sum(axis=1) + weight**2)).sum()
        assert total["right"] == pytest.approx(wanted, rel=1e-5)
        assert went["residual"] == pytest.approx(math.sqrt(total["left"] / total["right"]), rel=1e-4)
        assert (went["iterations"] == 0.0) == (weight > 0.0) and went["unconverged"] == 0.0
        assert np.abs(after.sum(axis=0) - before.sum(axis=0)).max() <= 1e-6 * np.abs(before).sum()


@pytest.mark.parametrize("method", METHODS)
def test_a_drop_in_free_flight_keeps_its_turn(method):
    scenario = adrift(1e6, jitter=0.2)
    simulation = block(method, scenario, tolerance=1e-2)
    before = noise(simulation)
    after, _ = solved(simulation, before, 1e-2)
    x = simulation.frame()["position"].astype(float)
    turn = [np.cross(x - x.mean(axis=0), v.astype(float)).sum(axis=0) for v in (before, after)]
    assert np.abs(turn[1] - turn[0]).max() <= 2e-6 * np.abs(np.cross(x - x.mean(axis=0), before)).sum()
    spin = np.cross([0.0, 0.0, 1.0], x - x.mean(axis=0)).astype(np.float32)
    kept, went = solved(block(method, scenario), spin, 1e-2)  # a rotation feels no drag
    assert kept == pytest.approx(spin, abs=1e-4) and went["iterations"] <= 3


@pytest.mark.parametrize("method", METHODS)
def test_a_first_guess_that_pulls_and_turns_leaves_momentum_alone(method):
    """Whatever it is, at a tolerance that lets much of it through."""
    simulation = block(method, adrift(1e4, jitter=0.2), tolerance=1e-2)
    before = noise(simulation)
    x = simulation.frame()["position"].astype(float)
    x -= x.mean(axis=0)
    guess = (np.cross([0.0, 3.0, 1.0], x) + np.array([1.0, 0.0, 2.0])).astype(np.float32)
    simulation.pool.drag.assign(np.pad(guess, ((0, simulation.pool.size - len(guess)), (0, 0))))
    after, _ = solved(simulation, before, 1e-2)
    assert np.abs(after.sum(axis=0) - before.sum(axis=0)).max() <= 1e-6 * np.abs(before).sum()
    turn = [np.cross(x, v.astype(float)).sum(axis=0) for v in (before, after)]
    assert np.abs(turn[1] - turn[0]).max() <= 2e-6 * np.abs(np.cross(x, before)).sum()


@pytest.mark.parametrize("rate", [1.0, 30.0])
@pytest.mark.parametrize("method", METHODS)
def test_growth_feels_no_drag(method, rate):
    """A block that moves apart at the rate at which it grows is left alone, and one at rest is drawn along."""
    growing = adrift(1e6)
    growth = {"ratio": 1.1, "time": 10.0, "split": False}
    material = growing.material.model_validate(growing.material.model_dump() | {"expansion": growth})
    simulation = block(method, growing.model_copy(update={"material": material}), tolerance=1e-5)
    x = simulation.frame()["position"].astype(float)
    apart = (rate / 3.0 * (x - x.mean(axis=0))).astype(np.float32)
    after, _ = solved(simulation, apart, 1e-2, rate)
    assert after == pytest.approx(apart, abs=1e-4 * float(np.abs(apart).max()))
    still = block(method, growing.model_copy(update={"material": material}), tolerance=1e-5)
    after, _ = solved(still, 0.0 * apart, 1e-2, rate)
    assert after == pytest.approx(apart, abs=0.2 * float(np.abs(apart).max()))


@pytest.mark.parametrize(("reach", "scale"), [(0.1, 1.0), (10.0, 1.0), (1000.0, 1.0), (10.0, 1e-5), (10.0, 1e3)])
@pytest.mark.parametrize("method", METHODS)
def test_a_shear_wave_falls_as_backward_euler_says(method, reach, scale):
    """By 1 / (1 + nu k^2 dt) in a step, however long, and whatever the spacing."""
    height, dt = 32 * scale, 1e-2
    k = 2.0 * math.pi / height
    scenario = made(1000.0 * reach / (k * k * dt), height=height, spacing=scale)
    simulation = block(method, scenario)
    z = simulation.frame()["position"][:, 2]
    before = np.stack([np.sin(k * z), 0 * z, 0 * z], axis=1).astype(np.float32)
    after, went = solved(simulation, before, dt)
    left = (after[:, 0] * before[:, 0]).sum() / (before[:, 0] ** 2).sum()
    assert left * (1.0 + reach) == pytest.approx(1.0, abs=0.04) and went["unconverged"] == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_a_couette_flow_between_walls_that_stick_is_driven_to_rest(method):
    simulation = block(method, made(1e6, STUCK))
    before = np.tile(np.float32([1.0, 0.0, 0.0]), (simulation.pool.counts[0], 1))
    after, _ = solved(simulation, before, 1.0)
    assert np.abs(after).max() < 0.02
    slips, _ = solved(block(method, made(1e6, SLIPPERY)), before, 1.0)
    assert slips == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_worlds_and_threads_change_nothing(method):
    thick, thin = made(1e4, jitter=0.2), made(1.0, jitter=0.2)
    alone = block(method, thick)
    before = noise(alone)
    expected, went = solved(alone, before, 1e-2)
    assert (solved(block(method, thick, threads=2), before, 1e-2)[0] == expected).all()
    both = block(method, [thick, thin])
    both.prepare()
    both.placed = False
    both.begin()
    both.kick(np.concatenate([np.pad(before, ((0, both.pool.capacity - len(before)), (0, 0)))] * 2))
    both.scene.set_dt(1e-2)
    both.solver.lists()
    assert (before + 1e-2 * acceleration(both)[: len(before)] == expected).all()
    assert both.solver.viscosity.iterations.effort(0) == went
    assert 0 < both.solver.viscosity.iterations.effort(1)["iterations"] < went["iterations"]


@pytest.mark.parametrize("backend", ["warp", "taichi"])
def test_what_is_no_number_ends_the_iterations_and_is_handed_on(backend):
    """Else viscosity would be gone, and nobody would know: of the operator alone, too."""
    for hurt in ("velocity", "operator"):
        simulation = block("sph", made(1e6), backend=backend)
        before = noise(simulation)
        if hurt == "velocity":
            before[3] = np.nan
        else:
            simulation.solver.viscosity.num.support = math.nan
        after, went = solved(simulation, before, 1e-2)
        assert went["iterations"] == 1 and went["unconverged"] == 1.0 and np.isnan(after).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_run_goes_on_from_a_checkpoint_bit_for_bit(method):
    """The first guess and the counts of a solve are part of the state."""
    runs = [block(method, made(1e4, jitter=0.2, tick=0.01)) for _ in range(2)]
    for simulation in runs:
        simulation.prepare()
    runs[0].begin()
    runs[0].kick(np.pad(noise(runs[0]), ((0, runs[0].pool.size - runs[0].pool.counts[0]), (0, 0))) * 0.01)
    for _ in range(3):
        runs[0].advance_tick()
    runs[1].resume(*copy.deepcopy(runs[0].state()))
    for simulation in runs:
        for _ in range(3):
            simulation.advance_tick()
    frames = [simulation.frame() for simulation in runs]
    assert all((frames[0][key] == frames[1][key]).all() for key in frames[0])
    assert runs[0].solver.solves() == runs[1].solver.solves() != {}


def test_a_solve_that_may_not_go_on_says_so():
    simulation = block("sph", made(1e7), tolerance=1e-6)
    simulation.solver.viscosity.iterations.ending.most = 3
    _, went = solved(simulation, noise(simulation), 1e-2)
    assert went["iterations"] == 3 and went["unconverged"] == 1.0 and went["residual"] > 1e-6


def test_nothing_is_solved_where_nothing_moves():
    simulation = block("pbd", made())
    after, went = solved(simulation, 0 * noise(simulation), 1e-2)
    assert not after.any() and went == {}


@pytest.mark.parametrize(("viscosity", "implicit"), [(0.0, False), (1.0, False), (1e7, True)])
def test_auto_takes_what_the_bounds_call_cheaper(viscosity, implicit):
    sph, scenario = get_method("sph"), made(viscosity)
    config = configure(sph, scenario)
    assert config.viscosity == ("implicit" if implicit else "explicit")
    for scheme in ("explicit", "implicit"):
        told = made(viscosity, numerics={"sph": {"viscosity": scheme}})
        assert configure(sph, told).viscosity == scheme
    found = {b.name: b.dt for b in sph.bounds(scenario, config, 1.0)}
    bare = {b.name: b.dt for b in sph.bounds(made(0.0), config, 1.0)}
    assert ("viscous accuracy" in found) is implicit
    assert (found["viscous"] == bare["viscous"]) is (implicit or not viscosity)


def test_the_bound_of_accuracy_by_hand():
    """L = 8 m, nu = 0.1: 0.1 * 64 / (pi^2 0.1) = 6.5 s; of the time that sqrt(g L) = 4 m/s take across it, 10 ms."""
    falls = {"gravity": (0.0, 0.0, -2.0)}
    thin, thick = (made(mu).model_copy(update=falls) for mu in (100.0, 1e9))
    assert accuracy(thin).dt == pytest.approx(0.1 * 64.0 / (math.pi**2 * 0.1))
    assert accuracy(thick).dt == pytest.approx(5e-3 * 8.0 / 4.0)
    assert accuracy(thick.model_copy(update={"duration": 4.0})) == accuracy(thick)
    nozzle = bead(material={"density": 1000.0, "viscosity": 1e9})
    assert accuracy(nozzle).dt == pytest.approx(5e-3 * nozzle.nozzle.diameter / nozzle.reference_speed)
