"""Nodes of MPM that keep their momenta between substeps: momentum, bits, both languages, and what it is for."""

import numpy as np
import pytest

from fluidbench.method.target import HERE, Target
from fluidbench.method.timestep import plan
from fluidbench.native.simulation import Simulation
from fluidbench.scenario.library import load
from fluidbench.scenario.numerics import configure
from solvers.mpm import SolverMPM
from solvers.mpm.bounds import bounds_of, kept

from ..conftest import PERIODIC, bead, drive

PASTE = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "yield_stress": 60.0}


def keeping(number=4, make=bead, **table):
    return make(numerics={"mpm": {"kept": number}}, **table)


def final(given, target=HERE):
    sim = Simulation(given, "mpm", target)
    sim.prepare()
    drive(sim)
    return sim.frame()


@pytest.mark.parametrize("number", [2, 4, 5])
def test_what_meets_keeps_its_momentum_and_the_moment_of_that(number):
    """Balls that close a gap (gaps.py), beside a nozzle, in whole cycles and parts of them."""
    ball = {"kind": "sphere", "radius": 0.008}
    left = ball | {"center": [-0.029, -0.02, 0.025], "velocity": [0.3, 0.05, 0.0]}
    right = ball | {"center": [-0.011, -0.02, 0.025], "velocity": [-0.1, 0.05, 0.0]}
    domain = {"lower": [-0.05] * 3, "upper": [0.05] * 3, "walls": PERIODIC}
    given = keeping(number, material=PASTE, bodies=[left, right], gravity=[0, 0, 0], domain=domain, duration=0.1)
    sim = Simulation(given, "mpm")
    sim.prepare()
    sim.begin()
    free = sim.frame()["held"] == 0

    def moments():
        frame = sim.frame()
        m, x, v = frame["mass"][free, None], frame["position"][free], frame["velocity"][free]
        turn = (m * np.cross(x, v)).sum(axis=0, dtype=float) + frame["spin"][free].sum(axis=0, dtype=float)
        return (m * v).sum(axis=0, dtype=float), turn

    before, apart = moments(), np.ptp(sim.frame()["position"][free][:, 0])
    for _ in range(4):
        sim.march(1e-4, 42)
        for now, then in zip(moments(), before, strict=True):
            assert np.abs(now - then).max() < 3e-6 * np.abs(then).max()
    assert np.ptp(sim.frame()["position"][free][:, 0]) < apart - 0.002  # they have met


def test_the_bits_are_the_same_on_two_threads():
    one, two = (final(keeping(duration=0.05), Target(threads=n)) for n in (1, 2))
    assert all((one[name] == two[name]).all() for name in ("position", "velocity", "density"))


@pytest.mark.parametrize("number", [2, 4, 8])
def test_taichi_does_the_same(number):
    """To rounding: it launches substeps where Warp replays them."""
    pytest.importorskip("taichi")
    warp, taichi = (final(keeping(number, duration=0.03), Target(backend=name)) for name in ("warp", "taichi"))
    assert np.abs(warp["position"] - taichi["position"]).max() < 1e-5 * 0.002


def test_a_substep_may_move_matter_by_less_where_particles_wait():
    for number, given in ((1, keeping(1)), (4, keeping(4))):
        config = configure(SolverMPM, given)
        bound = {b.name: b.dt for b in bounds_of(given, config, 2.0)}
        assert bound["advective"] * 2.0 * number == pytest.approx(0.5 * 2.0 * given.spacing, rel=0.1)
        assert plan(bounds_of(given, config, 0.1), 0.01).binding.name == "acoustic"


def test_where_nodes_keep_nothing():
    flat = {"diameter": 0.012, "exit_speed": 0.1, "standoff": 0.010, "tip": "flat"}
    clamped = {"kind": "box", "center": [0.0, 0.0, 0.004], "size": [0.008] * 3, "clamped": True}
    for given in (
        keeping(nozzle=flat, domain={"lower": [-0.03, -0.03, 0.0], "upper": [0.06, 0.03, 0.05]}),
        keeping(bodies=[clamped]),
        keeping(nozzle=None, toolpath=None, bodies=[clamped | {"clamped": False}]),
    ):
        assert kept(given, configure(SolverMPM, given)) == 1
    assert kept(keeping(), configure(SolverMPM, keeping())) == 4


def test_what_counts_is_the_number_of_exchanges_and_not_of_substeps():
    """Width of what is pressed under an outlet, with an eighth of the shipped step."""

    def width(number, safety):
        given = bead(duration=0.3, numerics={"mpm": {"kept": number, "safety": safety}})
        y = final(given)["position"][:, 1]
        return float(np.quantile(y, 0.98) - np.quantile(y, 0.02))

    shipped, often, kept_most = width(1, 0.8), width(1, 0.1), width(64, 0.1)
    assert often > shipped + 5e-4
    assert abs(kept_most - shipped) < 0.5 * (often - shipped)


def test_what_is_laid_is_no_wider_at_four_times_the_speed_of_sound():
    """In cycles of all of a tick but a substep. A piston that lets go what is faster pumped: 18.0 instead of 14.8."""

    def width(speed):
        material = PASTE | {"plastic_viscosity": 1.0, "sound_speed": speed}
        y = final(keeping(16, duration=0.35, spacing=0.0015, material=material))["position"][:, 1]
        return float(np.quantile(y, 0.98) - np.quantile(y, 0.02))

    assert width(16.0) < 1.02 * width(4.5)


def test_what_was_laid_comes_to_rest():
    """However many substeps are kept, of six a tick; with one cycle a tick it went on by 0.2 mm/s."""
    given = load("line_bead", {"duration": 2.5, "spacing": 2e-3, "numerics.mpm.kept": 64, "output_interval": 0.25})
    sim = Simulation(given, "mpm")
    sim.prepare()
    drive(sim)
    last = sim.frame()
    speed = np.sqrt((last["velocity"][last["held"] == 0].astype(float) ** 2).sum(axis=1).mean())
    assert speed < 1e-4


SOFT = {"density": 1000.0, "youngs_modulus": 1e-3, "poisson_ratio": 0.45, "yield_stress": 60.0, "sound_speed": 0.05}


def ball(velocity_gradient, number, upper=(0.05, 0.05, 0.05)):
    """(a simulation of a ball, which nothing resists, in a linear field of velocity about its center; its core)"""
    middle = np.array([-0.02, -0.02, 0.02])
    body = {"kind": "sphere", "radius": 0.014, "center": list(middle)}
    domain = {"lower": [-0.05] * 3, "upper": list(upper), "walls": PERIODIC}
    sim = Simulation(keeping(number, material=SOFT, bodies=[body], gravity=[0, 0, 0], domain=domain), "mpm")
    sim.prepare()
    sim.begin()
    pool = sim.pool
    away, velocity = pool.position.numpy() - middle, pool.velocity.numpy()
    free = (pool.held.numpy() == 0) & (np.arange(len(away)) < sum(pool.counts))
    velocity[free] = away[free] @ velocity_gradient.T
    sim.kick(velocity)
    affine = pool.affine.numpy()
    affine[free] = velocity_gradient
    pool.affine.assign(affine.astype(np.float32))
    return sim, free & (np.linalg.norm(away, axis=1) < 0.004)


@pytest.mark.parametrize("upper", [(0.05, 0.05, 0.05), (0.05, 0.06, 0.044)])
def test_a_cycle_strains_matter_as_it_goes(upper):
    """Straight on in a linear field, for all of a cycle: places and J are those of 1 + t grad v. (The first strain is
    of the step before, of which nothing moved.)"""
    dt, many = 2.5e-4, 16
    gradient = np.array([[40.0, 15.0, 0.0], [15.0, -40.0, 5.0], [0.0, 5.0, 0.0]])
    sim, core = ball(gradient, many, upper)
    x = sim.pool.position.numpy()[core]
    sim.march(dt, many)
    y, j = sim.pool.position.numpy()[core], sim.pool.volume_ratio.numpy()[core]
    middle = np.array([-0.02, -0.02, 0.02])
    assert np.abs(y - middle - (x - middle) @ (np.eye(3) + many * dt * gradient).T).max() < 2e-8
    strained = np.linalg.det(np.eye(3) + dt * gradient) * np.linalg.det(np.eye(3) + (many - 1) * dt * gradient)
    assert j == pytest.approx(strained, abs=1e-4)


def test_who_is_astray_is_found_at_the_end_of_a_cycle_too():
    sim, core = ball(np.zeros((3, 3)), 4)
    velocity = sim.pool.velocity.numpy()
    velocity[core] = 1000.0
    sim.kick(velocity)
    sim.march(1e-4, 8)
    assert sim.look().complaint
