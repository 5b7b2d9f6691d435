"""What MPM's nodes tell its volume ratios: porous matter that flows takes the space that there is, and nothing else
changes its own."""

import numpy as np
import pytest

from fluidbench.native.simulation import Simulation
from solvers.mpm.settling import COMPRESSED

from ..conftest import PERIODIC, scenario

EDGE, D, CALLS = 0.16, 0.01, 20
PASTE = {"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.45, "yield_stress": 100.0}
LIQUID = {"density": 1000.0, "viscosity": 1.0}


def block(material, high=EDGE, ratio=2.0):
    """A block between periodic faces, filled up to a height, at its start."""
    s = scenario(
        domain={"lower": [0.0] * 3, "upper": [EDGE] * 3, "walls": PERIODIC},
        bodies=[{"kind": "box", "center": [EDGE / 2, EDGE / 2, high / 2], "size": [EDGE, EDGE, high]}],
        gravity=[0, 0, 0],
        spacing=D,
        material=material,
        numerics={"mpm": {"grid_ratio": ratio}},
    )
    sim = Simulation(s, "mpm")
    sim.prepare()
    sim.begin()
    return sim


def settled(strain, *, lacking=0.0, start=1.0, high=EDGE, material=LIQUID, moved=0.0, ratio=2.0):
    """Volume ratios after all of a block is sheared by `strain`, and how far each particle is below the block's top
    [cells]; `lacking` is the share of particles whose matter is not there, `moved` that of a spacing by which each
    particle lies off its place at most."""
    sim = block(material, high, ratio)
    pool, solver, n, rng = sim.pool, sim.solver, sim.pool.size, np.random.default_rng(2)
    sim.scene.set_dt(1e-9)
    place = pool.position.numpy() + D * rng.uniform(-moved, moved, (n, 3))
    pool.position.assign((place % EDGE).astype(np.float32))
    solver.refresh()
    pool.volume.assign(pool.volume.numpy() * (rng.uniform(size=n) >= lacking))
    pool.volume_ratio.assign(np.full(n, start))
    pool.elastic_shear.assign(np.full((n, 3), 0.1))  # at which a paste yields
    affine = np.zeros((n, 3, 3))
    affine[:, 0, 1] = 8.0 * strain / CALLS / solver.settling.rate
    pool.affine.assign(affine)
    for _ in range(CALLS):
        solver.settling.settle(solver.table, solver.active, solver.raw, solver.node_lanes)
    return pool.volume_ratio.numpy().astype(float), (high - place[:, 2]) / (ratio * D)


@pytest.mark.parametrize("material", [LIQUID, PASTE])
def test_porous_matter_takes_its_space_as_it_flows(material):
    """A fifth of it is not there: a space of 1.25 and more, by where the holes are, less the margins; at a rate of 8
    times the strain at most, less where nodes are less full."""
    found, _ = settled(2.0, lacking=0.2, material=material)
    assert 1.1 < found.mean() < 1.25 and (found >= 1.0).all()
    begun, _ = settled(0.02, lacking=0.2, material=material)
    share = (begun.mean() - 1.0) / (found.mean() - 1.0)
    assert 0.25 * 8.0 * 0.02 < share < 1.0 - np.exp(-8.0 * 0.02)


def test_what_rests_or_stays_elastic_keeps_its_own():
    assert settled(0.0, lacking=0.2)[0] == pytest.approx(1.0, abs=0.0)
    stiff = PASTE | {"yield_stress": 2e3}
    assert settled(2.0, lacking=0.2, material=stiff)[0] == pytest.approx(1.0, abs=0.0)
    solid = {"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.3}
    assert block(solid).solver.settling is None


@pytest.mark.parametrize("start", [1.0 - 0.9 * COMPRESSED, 1.0, 1.0 + 0.9 * COMPRESSED])
@pytest.mark.parametrize("high", [EDGE, 0.1])
@pytest.mark.parametrize("ratio", [2.0, 1.6, 1.0])
def test_weakly_compressed_matter_keeps_its_own_with_and_without_a_free_surface(start, high, ratio):
    """Nodes of a grid ratio of 1.6 find a lattice 4 % more and less than full, by where they lie."""
    found, _ = settled(2.0, start=start, high=high, ratio=ratio)
    assert found.mean() == pytest.approx(start, abs=2e-4)
    assert found == pytest.approx(start, abs=5e-3)


@pytest.mark.parametrize("ratio", [2.0, 1.6, 1.0])
def test_disorder_is_not_taken_for_gaps(ratio):
    """Places off by up to half a spacing, which stay as they are while all is strained twice over."""
    found, _ = settled(2.0, moved=0.5, ratio=ratio)
    assert found.mean() == pytest.approx(1.0, abs=1e-3) and found.std() < 0.01
    assert np.percentile(np.abs(found - 1.0), 99) < 0.05


def test_beside_a_free_surface_nothing_settles():
    """Whose nodes are at most half full for what lies half a cell below it."""
    found, depth = settled(2.0, lacking=0.2, high=0.1)
    edge = np.minimum(depth, (0.1 / (2.0 * D)) - depth)
    assert (found[edge < 0.5] == 1.0).all() and found[edge > 2.0].mean() > 1.05
