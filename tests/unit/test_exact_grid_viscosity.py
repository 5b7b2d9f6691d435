"""Viscosity implicit in time on MPM's grid: what walls and viscosity do to nodes, and what a solve keeps, by hand."""

import copy
import math

import numpy as np
import pytest
import warp as wp

from fluidbench.errors import UserError
from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.numerics import configure
from fluidbench.study.points import varied

from ..conftest import bead
from .test_exact_viscosity import PERIODIC, SIDE, SLIPPERY, STUCK, adrift, made, noise

MPM = get_method("mpm")


def block(scenario, tolerance=1e-6, threads=1, backend="warp"):
    config = MPM.Config(viscosity="implicit", viscous_tolerance=tolerance)
    simulation = Simulation(scenario, "mpm", Target("cpu", backend, threads), config)
    simulation.prepare()
    simulation.begin()
    return simulation


def ready(simulation, velocity, dt):
    """Particles with these velocities, none of them sheared, before a step dt."""
    pool = simulation.pool
    simulation._refresh()
    simulation.kick(np.pad(velocity, ((0, pool.size - len(velocity)), (0, 0))))
    pool.affine.zero_()
    simulation.scene.set_dt(dt)


def solved(simulation, velocity, dt):
    """Velocities after one step in which nothing but viscosity acts, and how the solve went."""
    ready(simulation, velocity, dt)
    simulation.solver.substep()
    return simulation.pool.velocity.numpy()[: len(velocity)].astype(float), simulation.solver.solves()


def on_nodes(simulation, seed):
    """Random momenta of the nodes that have mass, as a solve holds them."""
    raw = simulation.solver.raw.numpy()
    values = np.random.default_rng(seed).normal(0.0, 1.0, raw.shape) * (raw[:, 3:] > 0.0)
    return np.where(np.arange(4) == 3, raw, values).astype(np.float32)


def walled(simulation, momenta):
    """Velocities that walls leave of these momenta."""
    viscosity = simulation.solver.viscosity
    viscosity.residual.assign(momenta)
    viscosity._apply()
    return viscosity.answer.numpy()[:, :3].astype(float)


def resisted(simulation, velocities):
    """dt A v"""
    solver, viscosity = simulation.solver, simulation.solver.viscosity
    viscosity.search.assign(np.pad(velocities, ((0, 0), (0, 1))).astype(np.float32))
    viscosity.image.zero_()
    solver.resist(viscosity.search, viscosity.image)
    return viscosity.image.numpy()[:, :3].astype(float)


@pytest.mark.parametrize("walls", [PERIODIC, STUCK, SLIPPERY])
def test_walls_and_viscosity_are_symmetric(walls):
    """p . B q = q . B p, u . A v = v . A u of what lies in disorder: conjugate gradients need no more, and no less."""
    simulation = block(made(1e6, walls, jitter=0.3))
    ready(simulation, noise(simulation), 1e-2)
    solver = simulation.solver
    solver.clear_grid()
    solver.p2g()
    p, q = on_nodes(simulation, 1), on_nodes(simulation, 2)
    bp, bq = walled(simulation, p), walled(simulation, q)
    scale = np.abs(p[:, :3] * bq).sum()
    assert (p[:, :3] * bq).sum() == pytest.approx((q[:, :3] * bp).sum(), abs=1e-6 * scale)
    assert (p[:, :3] * bp).sum() > 0.0
    ap, aq = resisted(simulation, bp), resisted(simulation, bq)
    scale = np.abs(bp * aq).sum()
    assert scale > 0.0 and (bp * aq).sum() == pytest.approx((bq * ap).sum(), abs=2e-6 * scale)
    assert (bp * ap).sum() > 0.0


@pytest.mark.parametrize("strain", [np.diag([0.5, 0.5, -1.0]), [[0, 0, 0.5], [0, 0, 0], [0.5, 0, 0]]])
def test_a_free_block_dissipates_what_its_viscosity_says(strain):
    """v . A v = 2 mu D:D V of a uniform rate of strain, surfaces or none: gradients are gathered, not paired."""
    simulation = block(adrift(1e6))
    solver, grid = simulation.solver, simulation.solver.grid
    ready(simulation, 0 * noise(simulation), 1e-2)
    solver.clear_grid()
    solver.p2g()
    strain = np.float64(strain)
    numbers = solver.block_of.numpy()[: int(solver.active.numpy()[0])]
    blocks = np.array(grid.blocks)
    corner = 4 * np.stack(np.unravel_index(numbers, blocks), axis=1)
    local = np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1)
    nodes = (corner[:, None, :] + local).reshape(-1, 3) * np.array(grid.dx)
    v = np.zeros((len(solver.raw), 3))
    v[: len(nodes)] = (nodes - nodes.mean(axis=0)) @ strain.T
    dissipated = (v * resisted(simulation, v)).sum() / 1e-2
    assert dissipated == pytest.approx(2.0 * 1e6 * np.square(strain).sum() * SIDE**3, rel=1e-4)


@pytest.mark.parametrize("viscosity", [1e4, 1e6, 1e8])
def test_a_solve_keeps_momentum_and_its_turn(viscosity):
    """In free flight, whatever the tolerance lets through: of what particles carry, their own spin included."""
    simulation = block(adrift(viscosity, jitter=0.2), tolerance=1e-2)
    before = noise(simulation)
    x = simulation.frame()["position"].astype(float)
    arm = x - x.mean(axis=0)
    m = simulation.frame()["mass"].astype(float)[:, None]
    after, went = solved(simulation, before, 1e-2)
    assert went["iterations"] >= 1 and went["unconverged"] == 0.0 and went["residual"] <= 1e-2
    scale = np.abs(m * before).sum()
    assert np.abs((m * (after - before)).sum(axis=0)).max() <= 1e-6 * scale
    spin = simulation.solver.spins()[: len(x)].astype(float).sum(axis=0)
    turned = (m * np.cross(arm, after)).sum(axis=0) + spin - (m * np.cross(arm, before)).sum(axis=0)
    assert np.abs(turned).max() <= 2e-6 * np.abs(m * np.cross(arm, before)).sum()


def test_a_residual_is_measured_by_velocity_and_weight():
    """m (v*.v* + (g dt)^2), and what falls from rest has v* = g dt."""
    simulation = block(adrift(1e4).model_copy(update={"gravity": (0.0, 0.0, -9.81)}))
    solved(simulation, 0 * noise(simulation), 1e-2)
    mass = simulation.frame()["mass"].astype(float).sum()
    right = simulation.solver.viscosity.iterations.totals.numpy()[0]["right"]
    assert right == pytest.approx(mass * 2.0 * 0.0981**2, rel=1e-4)


def test_a_rotation_feels_no_drag():
    simulation = block(adrift(1e6))
    x = simulation.frame()["position"].astype(float)
    turning = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    spin = ((x - x.mean(axis=0)) @ turning.T).astype(np.float32)
    ready(simulation, spin, 1e-2)
    simulation.pool.affine.fill_(wp.mat33(*turning.ravel()))
    simulation.solver.substep()
    kept = simulation.pool.velocity.numpy()[: len(x)]
    assert kept == pytest.approx(spin, abs=1e-4) and simulation.solver.solves()["iterations"] <= 2


@pytest.mark.parametrize(("reach", "scale"), [(0.1, 1.0), (10.0, 1.0), (1000.0, 1.0), (10.0, 1e-3)])
def test_a_shear_wave_falls_as_backward_euler_says(reach, scale):
    """By 1 / (1 + nu k^2 dt) in a step, however long, beside what a transfer alone leaves of it."""
    height, dt = 64 * scale, 1e-2
    k = 2.0 * math.pi / height
    left = []
    for viscosity in (1000.0 * reach / (k * k * dt), 1e-9):
        simulation = block(made(viscosity, height=height, spacing=scale))
        z = simulation.frame()["position"][:, 2]
        before = np.stack([np.sin(k * z), 0 * z, 0 * z], axis=1).astype(np.float32)
        after, went = solved(simulation, before, dt)
        left.append((after[:, 0] * before[:, 0]).sum() / (before[:, 0] ** 2).sum())
        assert went["unconverged"] == 0.0
    assert left[0] / left[1] * (1.0 + reach) == pytest.approx(1.0, abs=0.03)


def test_a_couette_flow_between_walls_that_stick_is_driven_to_rest():
    simulation = block(made(1e6, STUCK))
    before = np.tile(np.float32([1.0, 0.0, 0.0]), (simulation.pool.counts[0], 1))
    after, _ = solved(simulation, before, 1.0)
    assert np.abs(after).max() < 0.02
    slips, _ = solved(block(made(1e6, SLIPPERY)), before, 1.0)
    assert slips == pytest.approx(before, abs=1e-4)


def test_worlds_and_threads_change_nothing():
    thick, thin = made(1e4, jitter=0.2), made(1.0, jitter=0.2)
    before = noise(block(thick))
    expected, went = solved(block(thick), before, 1e-2)
    assert (solved(block(thick, threads=2), before, 1e-2)[0] == expected).all()
    both = block([thick, thin])
    solved(both, np.concatenate([np.pad(before, ((0, both.pool.capacity - len(before)), (0, 0)))] * 2), 1e-2)
    assert both.pool.velocity.numpy()[: len(before)] == pytest.approx(expected, abs=1e-5)
    iterations = both.solver.viscosity.iterations
    assert iterations.effort(0)["iterations"] == pytest.approx(went["iterations"], abs=1)
    assert 0 < iterations.effort(1)["iterations"] < went["iterations"]


def test_the_same_bits_for_any_number_of_threads_while_matter_is_fed():
    frames = []
    for threads in (1, 2):
        scenario = bead(material={"density": 1000.0, "viscosity": 500.0})
        simulation = block(scenario, threads=threads)
        for _ in range(12):
            simulation.advance_tick()
        frames.append(simulation.frame() | simulation.solver.solves())
    assert all(np.array_equal(frames[0][key], frames[1][key]) for key in frames[0])
    assert frames[0]["iterations"] > 1 and len(frames[0]["position"]) > 50


@pytest.mark.parametrize("backend", ["warp", "taichi"])
def test_what_is_no_number_ends_the_iterations_and_is_handed_on(backend):
    simulation = block(made(1e6), backend=backend)
    before = noise(simulation)
    before[3] = np.nan
    after, went = solved(simulation, before, 1e-2)
    assert went["iterations"] <= 1 and went["unconverged"] == 1.0 and np.isnan(after).any()


def test_a_run_goes_on_from_a_checkpoint_bit_for_bit():
    runs = [block(made(1e4, jitter=0.2, tick=0.01)) for _ in range(2)]
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
    simulation = block(made(1e7, jitter=0.2))
    simulation.solver.viscosity.iterations.ending.most = 3
    _, went = solved(simulation, noise(simulation), 1e-2)
    assert went["iterations"] == 3 and went["unconverged"] == 1.0 and went["residual"] > 1e-6


def test_auto_takes_what_the_bounds_call_cheaper_but_never_beside_rough_walls():
    for viscosity, scheme in ((0.0, "explicit"), (1.0, "explicit"), (1e7, "implicit")):
        config = configure(MPM, made(viscosity))
        assert config.viscosity == scheme
        found = {b.name for b in MPM.bounds(made(viscosity), config, 1.0)}
        assert ("viscous accuracy" in found) is (scheme == "implicit")
        assert ("viscous" in found) is (scheme == "explicit" and viscosity > 0.0)
    rough = made(1e7, PERIODIC | {"z_lower": {"friction": 0.3}, "z_upper": "slip"})
    assert configure(MPM, rough).viscosity == "explicit"
    forced = MPM.Config(viscosity="implicit")
    assert "friction" in (MPM.refuses(rough, forced) or "") and MPM.refuses(made(1e7), forced) is None
    with pytest.raises(UserError, match="friction"):
        Simulation(rough, "mpm", Target(), forced)


@pytest.mark.parametrize("standoff", [0.009, 0.01, 0.011])
def test_a_viscous_strand_holds_together_and_keeps_its_volume(standoff):
    """Fed at a stress far beyond its weight: without tension it swells by a third, and by 8 % at the sound speed that
    gravity alone would ask for. Where the piston was a heavy column of what is carried its end burst, by up to a
    quarter of the volume, by how far the exit lay from the nodes."""
    scenario = bead(material={"density": 1400.0, "viscosity": 300.0}, duration=0.1)
    scenario = varied(scenario.model_dump(mode="json"), {"nozzle.standoff": standoff})
    assert scenario.liquid_sound_speed > 2.0 * 10.0 * scenario.reference_speed
    simulation = block(scenario, tolerance=1e-4)
    while simulation.now < 0.1:
        simulation.advance_tick()
    frame = simulation.frame()
    assert (1400.0 / frame["density"]).mean() == pytest.approx(1.0, abs=0.03)
