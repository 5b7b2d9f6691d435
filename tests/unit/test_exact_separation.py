"""MPM's particles kept apart: who is moved, whereto, and that matter as a whole stays where it is."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fluidbench.method.frame import CARRIED, CLAMPED
from fluidbench.native.simulation import Simulation
from solvers.crowding import crowding
from solvers.mpm.separation import CLOSE, EVERY, KERNEL, STIRRED, TOUCHING

from ..conftest import scenario

D = 0.01
SHEAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # its rate of shear is 1
SPIN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
PASTE = {"density": 1000.0, "youngs_modulus": 1e4, "yield_stress": 1e-6}


def cube(places=lambda x: x, affine=SHEAR, material=PASTE, walls=None, edge=8, **numerics):
    """A cube of `edge`^3 particles in the middle of 0.24 m, `places` (about its centre) and affine field as given."""
    s = scenario(
        domain={"lower": [-0.12] * 3, "upper": [0.12] * 3, **({"walls": walls} if walls else {})},
        gravity=[0, 0, 0],
        bodies=[{"kind": "box", "center": [0, 0, 0], "size": [edge * D] * 3}],
        spacing=D,
        material=material,
        **({"numerics": {"mpm": numerics}} if numerics else {}),
    )
    sim = Simulation(s, "mpm", graphs=False)
    sim.prepare()
    sim.begin()
    pool = sim.pool
    pool.position.assign(places(pool.position.numpy().astype(float)).astype(np.float32))
    pool.affine.assign(np.broadcast_to(affine, (pool.size, 3, 3)).astype(np.float32))
    pool.velocity.fill_(0.0)
    sim.solver.refresh()
    sim.scene.set_dt(1e-4)
    return sim


def moves(sim, times=1):
    """How far each particle is shifted [m]."""
    before = sim.pool.snapshot()["position"].astype(float)
    for _ in range(times):
        sim.solver.arrange(1)
    assert not sim.pool.fault.numpy().any()
    return sim.pool.snapshot()["position"].astype(float) - before


def paired(x, apart=0.3):
    """The lattice with its two middle particles of a row moved together to so many spacings."""
    out = x.copy()
    row = np.flatnonzero((np.abs(x[:, 1] - D / 2) < 1e-6) & (np.abs(x[:, 2] - D / 2) < 1e-6) & (np.abs(x[:, 0]) < D))
    assert len(row) == 2
    out[row, 0] *= apart
    return out


def test_a_pair_leaves_each_other_as_fast_as_matter_shears_and_nothing_else_moves():
    rate = 0.5
    sim = cube(paired, rate * SHEAR)
    x = sim.pool.snapshot()["position"]
    close = np.abs(x[:, 0]) < 0.2 * D
    by = moves(sim)
    strain = EVERY * sim.tick * rate
    # before the mean over nodes is taken off
    alone = strain * (KERNEL * D) ** 2 * crowding(0.3 * D, D, CLOSE * D, KERNEL * D)
    assert (np.sign(by[close, 0]) == np.sign(x[close, 0])).all()
    assert 0.6 * alone < np.abs(by[close, 0]).min() and np.abs(by[close, 0]).max() < alone
    others = np.abs(by[~close]).max()
    assert others < 0.1 * alone  # the mean that was taken off
    assert by.sum(axis=0) == pytest.approx(0.0, abs=1e-3 * alone)  # the centre of mass stays


@pytest.mark.parametrize("affine", [0.0 * SHEAR, SPIN, np.eye(3)], ids=["rest", "spin", "swelling"])
def test_what_does_not_shear_is_left_alone(affine):
    assert not moves(cube(paired, 30.0 * affine)).any()


def test_a_lattice_that_shears_is_left_alone():
    assert not moves(cube(affine=30.0 * SHEAR), 3).any()


def middle(sim):
    """The two of a pair."""
    return np.flatnonzero(np.abs(sim.pool.snapshot()["position"][:, 0]) < 0.2 * D)


@pytest.mark.parametrize("held", [CARRIED, CLAMPED])
def test_what_is_held_stays_and_the_free_one_of_a_pair_leaves_it(held):
    sim = cube(paired, 30.0 * SHEAR)
    one, other = middle(sim)
    values = sim.pool.held.numpy()
    values[one] = int(held)
    sim.pool.held.assign(values)
    by = moves(sim)
    assert not by[one].any() and by[other].any()


def test_what_does_not_flow_beside_what_does_is_left_alone_to_the_bit():
    """Crumpled matter of which one half shears and the other rests, far from its yield stress."""
    rng = np.random.default_rng(2)
    material = {"density": 1000.0, "youngs_modulus": 1e4, "yield_stress": 5.0}
    sim = cube(lambda x: x + rng.uniform(-0.45 * D, 0.45 * D, x.shape), 30.0 * SHEAR, material)
    affine = sim.pool.affine.numpy()
    rests = sim.pool.snapshot()["position"][:, 0] > 0.0
    affine[: len(rests)][rests] = 0.0
    sim.pool.affine.assign(affine)
    by = moves(sim, 20)
    assert not by[rests].any() and np.abs(by[~rests]).max() > 0.02 * D


def test_who_is_shifted_into_another_block_of_the_grid_is_found_there():
    """Matter crumpled into a fifth of its width spreads over faces between blocks: its mass arrives on the grid in the
    next substep."""
    rng = np.random.default_rng(4)
    sim = cube(lambda x: x * [0.2, 1, 1] + rng.uniform(-1e-4, 1e-4, x.shape), 1e3 * SHEAR)
    moves(sim, 20)
    sim.pool.affine.zero_()
    sim._run(1)
    assert not sim.pool.fault.numpy().any()
    mass = sim.pool.snapshot()["mass"].astype(float).sum()
    assert sim.solver.raw.numpy()[: 64 * int(sim.solver.active.numpy()[0]), 3].sum() == pytest.approx(mass, rel=1e-5)


@pytest.mark.parametrize(
    ("strength", "moved"), [({}, False), ({"yield_stress": 1e3}, False), ({"yield_stress": 1.0}, True)]
)
def test_what_does_not_flow_stays(strength, moved):
    """An elastic solid, and a paste of which the stress that it carries is far from its yield stress, or beyond it."""
    sim = cube(paired, 30.0 * SHEAR, {"density": 1000.0, "youngs_modulus": 1e4, **strength})
    assert moves(sim).any() == moved


@pytest.mark.parametrize("apart", [0.05, 0.15, 0.24])
def test_those_that_touch_are_parted_once_wherever_matter_deforms(apart):
    """Two in an elastic solid that hardly shears; a lattice about them does not move by more than the mean that is
    taken off, nor they once they are parted. At rest they stay."""
    elastic = {"density": 1000.0, "youngs_modulus": 1e4}

    def touching(rate):
        return cube(lambda x: paired(x, apart), rate * SHEAR, elastic)

    assert not moves(touching(0.0)).any()
    sim = touching(2.0 * STIRRED / (EVERY * cube().tick))
    close = middle(sim)
    by = moves(sim, 3)
    x = sim.pool.snapshot()["position"].astype(float)
    assert TOUCHING * D < abs(x[close[0], 0] - x[close[1], 0]) < D
    assert by[close].sum(axis=0) == pytest.approx(0.0, abs=1e-3 * D)
    assert not np.delete(by, close, axis=0).any()
    assert not moves(sim, 3).any()


def test_a_liquid_flows():
    assert moves(cube(paired, 30.0 * SHEAR, {"density": 1000.0, "viscosity": 1.0, "sound_speed": 10.0})).any()


def test_none_is_moved_by_more_than_a_quarter_of_a_spacing():
    rng = np.random.default_rng(3)
    by = moves(cube(lambda x: 0.4 * x + rng.uniform(-1e-4, 1e-4, x.shape), 1e3 * SHEAR))
    assert 0.2 * D < np.linalg.norm(by, axis=1).max() <= 0.25001 * D


def test_crumpled_matter_finds_room_within_itself():
    """Nearest neighbours come from a quarter of a spacing or less to more than half, while matter as a whole stays
    where it was: its centre to a hundredth of a spacing, its second moments (12 spacings squared) to 0.15."""
    rng = np.random.default_rng(1)
    sim = cube(lambda x: x + rng.uniform(-0.45 * D, 0.45 * D, x.shape), 30.0 * SHEAR, edge=12)
    before = sim.pool.snapshot()["position"].astype(float)
    moves(sim, 100)
    after = sim.pool.snapshot()["position"].astype(float)
    nearest = [cKDTree(x).query(x, k=2)[0][:, 1].min() / D for x in (before, after)]
    assert nearest[0] < 0.25 and nearest[1] > 0.6
    assert after.mean(axis=0) == pytest.approx(before.mean(axis=0), abs=0.01 * D)
    assert np.cov(after.T) == pytest.approx(np.cov(before.T), abs=0.15 * D**2)


def test_a_flattened_lattice_is_hardly_blown_up():
    """Rows 0.7 spacings apart along z, 1.2 across, sheared by 1: pairs push, but what a grid sees of it is taken off.
    Without that the cube grows by 1.2 % along z."""
    sim = cube(lambda x: x * [1.2, 1.2, 0.7], 5.0 * SHEAR, edge=12)
    times = round(1.0 / (5.0 * EVERY * sim.tick))
    height = sim.pool.snapshot()["position"][:, 2].std()
    moves(sim, times)
    assert sim.pool.snapshot()["position"][:, 2].std() == pytest.approx(height, rel=0.004)


@pytest.mark.parametrize("axis", [0, 2])
def test_those_beyond_a_periodic_face_crowd_too(axis):
    """Two particles, 0.15 spacings before either face of an axis that is periodic, leave each other across it."""
    kind = "xyz"[axis]
    sim = cube(affine=1e3 * SHEAR, walls={f"{kind}_lower": "periodic", f"{kind}_upper": "periodic"}, edge=2)
    x = sim.pool.position.numpy()
    for i, side in enumerate((-1.0, 1.0)):
        x[i] = 0.5 * D
        x[i, axis] = side * (0.12 - 0.15 * D)
    sim.pool.position.assign(x)
    sim.solver.refresh()
    by = moves(sim)[:2, axis]
    assert by[0] > 0.01 * D and by[1] == pytest.approx(-by[0], rel=1e-3)


def test_it_can_be_switched_off_and_is_off_where_matter_expands():
    assert cube(separation=0.0).solver.separation is None and cube().solver.arranges == EVERY
    assert cube(separation=0.0, shifting=0.0).solver.arranges == 0
