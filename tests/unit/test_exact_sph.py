"""What keeps SPH's particles in order, by hand: the pull against motion that no gradient shows, and shifting."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.method.target import Target
from fluidbench.native.scene import Phase
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import define
from solvers.crowding import crowding, farthest, out_of_crowd
from solvers.flow import shear_rate
from solvers.hourglass import off_linear
from solvers.lattice import hourglass_limit, lattice_moment, opposing
from solvers.smoothing import wendland, wendland_slope
from solvers.sph import particle
from solvers.sph.particle import CLOSE, FARTHEST, PARTED

PERIODIC = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}
SIDE = 8


def block(config=None, walls=PERIODIC, **material):
    """A cube of a lattice of 8 x 8 x 8 particles at rest, 1 m apart, periodic or within walls, and what runs it."""
    material = {"density": 1000.0, "youngs_modulus": 1e5, "poisson_ratio": 0.3} | material
    scenario = define(
        "block",
        domain={"lower": [0, 0, 0], "upper": [SIDE] * 3, "walls": walls},
        bodies=[{"kind": "box", "center": [SIDE / 2] * 3, "size": [SIDE] * 3}],
        material={key: value for key, value in material.items() if value is not None},
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=1.0,
    )
    method = get_method("sph")
    return Simulation(scenario, "sph", Target(), method.Config(**(config or {})))


def forces(simulation, velocity, substeps=1, dt=1e-3):
    """Accelerations (n, 3) after substeps that begin at a velocity which is a function of the places."""
    places = simulation.frame()["position"].astype(float)
    simulation.kick(velocity(places))
    simulation.march(dt, substeps)
    return places, simulation.solver.acceleration.numpy()[: len(places)].astype(float)


def zigzag(places, axes=1, along=1):
    """1 mm/s, alternating from particle to particle."""
    out = np.zeros_like(places)
    out[:, along] = 1e-3 * (-1.0) ** np.floor(places[:, :axes]).sum(axis=1)
    return out


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("zeta", [0.0, 1.0, 2.5])
def test_the_shortest_wave_pulls_back_with_the_frequency_that_its_stiffness_says(axes, zeta):
    """omega^2 = 4 zeta (c_s f / d)^2 on what a step has displaced; without zeta nothing resists it."""
    simulation = block({"artificial_viscosity_solid": 0.0, "hourglass": zeta, "smoothing_ratio_solid": 1.3})
    dt = 1e-4
    places, a = forces(simulation, lambda x: zigzag(x, axes), dt=dt)
    shear = 1e5 / 2.6 / 1000.0  # c_s^2
    f = opposing(1.3, axes) / opposing(1.3)
    wanted = -4.0 * zeta * shear * f * f * dt * zigzag(places, axes)
    assert a == pytest.approx(wanted, abs=1e-3 * 4.0 * 2.5 * shear * dt * 1e-3)


def test_artificial_viscosity_damps_the_shortest_wave_and_no_smooth_flow():
    """4 nu / d^2, nu = alpha h c / 10."""
    simulation = block({"hourglass": 0.0, "artificial_viscosity_solid": 0.5, "smoothing_ratio_solid": 1.3})
    places, a = forces(simulation, zigzag, dt=1e-6)
    nu = 0.5 * 1.3 * simulation.scenario.wave_speed / 10.0
    assert a == pytest.approx(-4.0 * nu * zigzag(places), rel=1e-2, abs=1e-6)


RATES = {
    "translation": np.zeros((3, 3)),
    "rotation": np.array([[0.0, -1.0, 0.5], [1.0, 0.0, -0.2], [-0.5, 0.2, 0.0]]),
    "shear": np.array([[0.0, 1.0, 0.0], [0.0] * 3, [0.0] * 3]),
    "expansion": np.eye(3),
}


@pytest.mark.parametrize("name", RATES)
def test_a_linear_flow_is_not_pulled_back_wherever_particles_lie(name):
    """A disordered cube with free faces; beside it the same cube in a flow that is not linear."""
    scenario = define(
        "cube",
        domain={"lower": [0, 0, 0], "upper": [20] * 3},
        bodies=[{"kind": "box", "center": [10] * 3, "size": [6] * 3}],
        material={"density": 1000.0, "youngs_modulus": 1e5, "poisson_ratio": 0.3},
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=1.0,
    )
    seen = []
    for bend in (0.0, 1.0):
        simulation = Simulation(scenario, "sph", Target())
        pool, places = simulation.pool, simulation.frame()["position"].astype(float)
        places += np.random.default_rng(1).uniform(-0.15, 0.15, places.shape)
        pool.position.assign(np.pad(places, ((0, pool.size - len(places)), (0, 0))).astype(np.float32))
        pool.stale = True
        velocity = (places - 10.0) @ RATES[name].T + [3.0, -1.0, 2.0]
        velocity[:, 0] += bend * 0.1 * (places[:, 1] - 10.0) ** 2
        simulation.kick(velocity)
        simulation.march(1e-4, 1)
        seen.append(np.abs(pool.off_linear.numpy()[: len(places)]).max() / 1e-4)
    assert seen[0] < 1e-4 and seen[1] > 0.05


ELASTIC = {"density": 1000.0, "youngs_modulus": 1e5, "poisson_ratio": 0.3}
INVISCID = {"density": 1000.0, "sound_speed": 10.0}
PUSHES_ALONE = {"hourglass": 0.0, "artificial_viscosity_solid": 0.0, "artificial_viscosity": 0.0}
PUSHES_ALONE |= {"density_diffusion": 0.0, "density_feedback": 0.0, "shifting": 0.0}


@pytest.mark.parametrize("floor", ["stick", "slip"])
@pytest.mark.parametrize("beside", ["stick", "slip"])
@pytest.mark.parametrize(("material", "noise"), [(ELASTIC, 1e-4), (INVISCID, 1e-3)], ids=["elastic", "inviscid"])
def test_stress_does_the_work_of_the_strain_that_is_told_at_walls_of_any_kind(floor, beside, material, noise):
    """Of small velocities the stress after a step is linear, and so is the force, -K v: K is symmetric, for matter
    in no order in a corner of two walls. What is not can feed on itself: strands of paste rang on their floor."""
    scenario = define(
        "corner",
        domain={"lower": [0, 0, 0], "upper": [20] * 3, "walls": {"z_lower": floor, "y_lower": beside}},
        bodies=[{"kind": "box", "center": [10, 3, 3], "size": [6] * 3}],
        material=material,
        gravity=[0.0, 0.0, 0.0],
        duration=1.0,
        spacing=1.0,
    )
    rng, pushed = np.random.default_rng(1), []
    places = Simulation(scenario, "sph", Target()).frame()["position"].astype(float)
    places += rng.uniform(-0.15, 0.15, places.shape)
    flows = 5.0 * rng.normal(size=(2, *places.shape))
    for velocity in [*flows, *-flows]:
        simulation = Simulation(scenario, "sph", Target(), get_method("sph").Config(**PUSHES_ALONE))
        pool = simulation.pool
        pool.position.assign(np.pad(places, ((0, pool.size - len(places)), (0, 0))).astype(np.float32))
        pool.stale = True
        simulation.kick(velocity)
        simulation.march(1e-4, 1)
        pushed.append(simulation.solver.acceleration.numpy()[: len(places)].astype(float))
    odd = [pushed[i] - pushed[i + 2] for i in range(2)]
    work = [[float((v * a).sum()) for a in odd] for v in flows]
    assert work[0][0] < 0.0 and abs(work[0][1] - work[1][0]) < noise * abs(work[0][0])


def test_what_is_off_the_linear_flow_turns_with_matter_and_yields_with_it():
    spin = wp.mat33(0.0, -2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    got = off_linear(wp.vec3(1.0, 0.0, 4.0), spin, wp.vec3(0.0, 0.0, 10.0), 0.5, 0.1)
    assert list(got) == pytest.approx([0.49, 0.1, 2.5])  # half of (cos 0.2, sin 0.2), to second order
    phase = Phase()
    phase.shear_modulus = 7.0
    got = particle.pulled_back(phase, 2.0, 3.0, wp.vec3(1.0, 0.0, 0.0), wp.vec3(0.0, 1.0, 0.0))
    assert list(got) == pytest.approx([14.0, 3.0, 0.0])


def test_rate_of_shear():
    assert shear_rate(wp.mat33(0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(3.0)
    assert shear_rate(wp.mat33(0.0, 3.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(0.0, abs=1e-6)
    assert shear_rate(wp.mat33(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0)) == pytest.approx(0.0, abs=1e-6)


def test_particles_leave_a_crowd_as_fast_as_matter_shears():
    crowd = wp.vec3(2.0, 0.0, -1.0)
    assert list(out_of_crowd(crowd, 0.5, 0.01, 0.2)) == pytest.approx([-0.005, 0.0, 0.0025])
    assert list(out_of_crowd(crowd, 0.5, 0.0, 0.2)) == [0.0, 0.0, 0.0]
    assert list(out_of_crowd(crowd, 0.5, 1e9, 0.2)) == pytest.approx([-0.1, 0.0, 0.05])  # no farther


@pytest.mark.parametrize("r0", [0.9, 1.0])
@pytest.mark.parametrize("h", [1.3, 1.5, 1.8, 2.5])
def test_a_pair_that_parts_never_changes_places_with_others(h, r0):
    """Of pairs as near as may be each is then nearer than those that were farther apart, none beyond where it would
    have been left alone; a little more, and some would be."""
    near = np.linspace(0.0, r0, 400)
    push = np.array([h * h * crowding(r, 1.0, r0, h) for r in near])
    after = near + 2.0 * farthest(1.0, r0, h) * push
    assert np.all(np.diff(after) > -1e-5) and after.max() <= r0 + 1e-5
    assert np.any(np.diff(near + 2.2 * farthest(1.0, r0, h) * push) < 0.0)
    assert farthest(0.01, 0.01 * r0, 0.01 * h) == pytest.approx(farthest(1.0, r0, h))


def test_how_far_pastes_are_shifted_at_a_time_is_that_of_their_kernel():
    assert float(FARTHEST) == pytest.approx(farthest(1.0, CLOSE, 1.5), rel=0.05)


def sheared(simulation, places):
    """Shifts (n, 3) of particles at some places after 0.1 ms of a flow that shears at 1 1/s."""
    pool, solver, n = simulation.pool, simulation.solver, len(places)
    pool.position.assign(np.pad(places, ((0, pool.size - len(places)), (0, 0))).astype(np.float32))
    pool.stale = True
    simulation.kick(np.stack([0 * places[:, 0], places[:, 2] % SIDE, 0 * places[:, 0]], axis=1))
    simulation.march(1e-4, 1)
    if simulation.scene.tensile:
        return solver.shift.numpy()[:n].astype(float)
    solver.num.settling = solver.num.shifting * 1e-4
    before = pool.position.numpy()[:n].astype(float)
    solver.arrange(0)
    return pool.position.numpy()[:n].astype(float) - before


PASTE = {"yield_stress": 1e-6}
ELASTIC = {"yield_stress": 1e9}
LIQUID = {"youngs_modulus": None, "poisson_ratio": None, "sound_speed": 10.0}


@pytest.mark.parametrize(
    ("material", "gap", "moves"),
    [(m, gap, gap < 0.9) for m in (PASTE, LIQUID) for gap in (0.95, 0.8, 0.5)]
    + [(ELASTIC, gap, gap < 0.6) for gap in (0.8, 0.63, 0.5)],
)
def test_only_near_partners_crowd_each_other(material, gap, moves):
    """Two that have come together in a lattice that shears at 1 1/s: what flows is left alone to 0.9 spacings (a paste
    is evened out a little), what strains elastically to 0.6, and beyond it feels the excess."""
    config = {"shifting": 4.0, "smoothing_ratio_solid": 1.5, "smoothing_ratio": 1.5}
    simulation = block(config, **material)
    places = simulation.frame()["position"].astype(float)
    first, second = (int(np.argmin(np.linalg.norm(places - p, axis=1))) for p in ([3.5, 3.5, 3.5], [4.5, 3.5, 3.5]))
    places[second, 0] = places[first, 0] + gap
    shift = sheared(simulation, places)[[first, second], 0] / (4.0 * 1e-4 * 1.5**2)
    if material is LIQUID:
        shift /= float(PARTED)
    if not moves:
        assert np.abs(shift).max() <= (0.02 if material is PASTE else 0.0)
    else:
        assert shift[0] < 0.0 < shift[1]
    if gap == 0.5:  # what else is near adds little
        left = crowding(0.6, 1.0, CLOSE, 1.5) if material is ELASTIC else 0.0
        assert shift[1] - shift[0] == pytest.approx(2.0 * (crowding(0.5, 1.0, CLOSE, 1.5) - left), rel=0.35)


@pytest.mark.parametrize("seed", [0, 1])
def test_what_a_liquid_is_shifted_by_moves_it_nowhere(seed):
    simulation = block(**LIQUID)
    places = simulation.frame()["position"].astype(float)
    shift = sheared(simulation, places + np.random.default_rng(seed).uniform(-0.3, 0.3, places.shape))
    assert np.abs(shift).max() > 1e-4
    assert np.abs(shift.sum(axis=0)).max() < 1e-6 * len(places) ** 0.5 * SIDE / 4  # places round by so much at random


@pytest.mark.parametrize(("material", "moves"), [(LIQUID, False), (PASTE, True)])
def test_walls_crowd_no_liquid(material, moves):
    """Its lowest row 0.25 spacings from a floor, so half a spacing from its image."""
    simulation = block(walls=PERIODIC | {"z_lower": "slip", "z_upper": "slip"}, **material)
    places = simulation.frame()["position"].astype(float)
    places[:, 2] -= 0.25
    upwards = sheared(simulation, places)[places[:, 2] < 1.0, 2]
    assert np.all(upwards > 0.0) if moves else np.all(upwards == 0.0)


def test_crowding_by_one_partner_by_hand():
    excess = (wendland(0.5 / 1.5, 1.5) / wendland(0.9 / 1.5, 1.5)) ** 4 - 1.0
    assert crowding(0.5, 1.0, CLOSE, 1.5) == pytest.approx(-wendland_slope(0.5 / 1.5, 1.5) * 0.5 * excess)
    assert crowding(0.005, 0.01, 0.009, 0.015) == pytest.approx(100.0 * crowding(0.5, 1.0, CLOSE, 1.5))  # 1/m
    assert crowding(0.9, 1.0, CLOSE, 1.5) == pytest.approx(0.0)


def test_sums_over_a_lattice_by_hand():
    """h = 1: neighbours at 1, sqrt 2, sqrt 3 (6, 12, 8 of them), slopes -105 / (16 pi) (1 - r / 2)^3."""
    one, two, three = (105.0 / (16.0 * math.pi) * (1.0 - r / 2.0) ** 3 for r in (1.0, math.sqrt(2.0), math.sqrt(3.0)))
    assert opposing(1.0) == pytest.approx(2 * one + 8 * two + 8 * three)
    assert opposing(1.0, 2) == pytest.approx(4 * one + 8 * two)
    assert opposing(1.0, 3) == pytest.approx(6 * one + 8 * three)
    assert lattice_moment(1.0) == pytest.approx((6 * one + 24 * two + 24 * three) / 3.0)
    f = max(opposing(1.0, k) for k in (1, 2, 3)) / opposing(1.0)
    assert hourglass_limit(1.0, 4.0, 3.0, 0.0) == pytest.approx(1.0 / (6.0 * f))
    assert hourglass_limit(1.0, 0.0, 3.0, 5.0) == pytest.approx(2.0 / (4.0 * f * f * 0.5))
    assert hourglass_limit(1.0, 0.0, 3.0, 0.0) == math.inf
