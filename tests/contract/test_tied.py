"""Nodes at a rigid body (solvers/mpm/tied.py): what obeys its wall is left as it is, and nothing gains energy."""

import numpy as np
import pytest

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.simulation import Simulation

from .test_tip import SPACING, D, strand

PASSES = ("clear_grid", "p2g", "grid_step", "g2p")


def begun(walls="stick", ratio=1.0, higher=0.0, gap=D):
    """A bore full of matter, and a slab of it from the floor to the face, four bores wide; the piston is off, and no
    time goes by."""
    top = gap + higher
    slab = {"kind": "box", "center": [0.0, 0.0, top / 2], "size": [3.6 * D, 3.6 * D, top]}
    nozzle = {"walls": walls, "standoff": top, "outer_diameter": 4.0 * D}
    sim = Simulation(strand(bodies=[slab], nozzle=nozzle, numerics={"mpm": {"grid_ratio": ratio}}), "mpm")
    sim.begin()
    sim.scene.dt.fill_(0.0)
    sim.solver.piston.on = 0
    return sim


def transferred(sim, velocity, affine):
    """(velocity, affine velocity field) of all particles after a transfer to nodes and back."""
    pool = sim.pool
    for field, value in ((pool.velocity, velocity), (pool.affine, affine)):
        whole = field.numpy()
        whole[: len(value)] = value
        field.assign(whole)
    for name in PASSES:
        getattr(sim.solver, name)()
    return pool.velocity.numpy()[: len(velocity)].astype(float), pool.affine.numpy()[: len(velocity)].astype(float)


def laid_out(sim):
    """(place, heights above the exit, distance from the axis, what is free) of particles as they are stored."""
    n = sim.pool.counts[0]
    x = sim.pool.position.numpy()[:n].astype(float)
    free = sim.pool.held.numpy()[:n] == FREE
    return x, x[:, 2] - sim.scenario.nozzle.standoff, np.hypot(x[:, 0], x[:, 1]), free


@pytest.mark.parametrize("higher", [0.0, 0.3 * SPACING, 0.6 * SPACING])
@pytest.mark.parametrize("ratio", [1.0, 1.5])
def test_a_linear_shear_along_a_face_is_left_as_it_is(ratio, higher):
    sim = begun(ratio=ratio, higher=higher)
    x, above, radius, free = laid_out(sim)
    u = sim.solver.held.tool.pose.velocity.numpy()[0].astype(float)
    rate = 3.0
    v = np.tile(u, (len(x), 1))
    v[:, 0] -= rate * above
    c = np.zeros((len(x), 3, 3))
    c[:, 0, 2] = -rate
    after, field = transferred(sim, v, c)
    near = free & (above > -2.0 * SPACING) & (above < 0.0) & (radius > 1.2 * D) & (radius < 1.3 * D)
    assert near.sum() > 3
    assert after[near, 0] == pytest.approx(v[near, 0], abs=0.02 * rate * SPACING)
    assert field[near, 0, 2] == pytest.approx(-rate, rel=0.05)


def test_a_plug_slides_through_a_bore_that_lets_it_slip():
    sim = begun("slip")
    x, above, _radius, free = laid_out(sim)
    u = sim.solver.held.tool.pose.velocity.numpy()[0].astype(float)
    v = np.where((above > 0.0)[:, None], u - np.array([0.0, 0.0, 0.02]), u)
    after, field = transferred(sim, v, np.zeros((len(x), 3, 3)))
    deep = free & (above > 3.0 * SPACING)
    assert deep.sum() > 20
    assert after[deep] == pytest.approx(v[deep], abs=1e-5) and abs(field[deep]).max() * SPACING < 1e-5


@pytest.mark.parametrize("walls", ["stick", "slip"])
@pytest.mark.parametrize(("gap", "seed"), [(D, 0), (D, 1), (3.0 * SPACING, 0), (1.7 * SPACING, 0)])
def test_no_transfer_makes_energy(walls, gap, seed):
    """Of velocities at random, in the frame of the body; images behind the surface made up to 3 % a step."""
    sim = begun(walls, gap=gap)
    rng = np.random.default_rng(seed)
    x, _above, _radius, free = laid_out(sim)
    u = sim.solver.held.tool.pose.velocity.numpy()[0].astype(float)
    x += rng.uniform(-0.3, 0.3, x.shape) * SPACING * free[:, None]
    moved = sim.pool.position.numpy()
    moved[: len(x)] = x
    sim.pool.position.assign(moved)
    sim.solver.held.keep_out(sim.solver.blocks, None if sim.solver.by_block is None else sim.solver.by_block.homes)
    sim.solver.refresh()
    mass = sim.pool.mass.numpy()[: len(x)].astype(float)
    v = np.where(free[:, None], u + rng.normal(size=x.shape), u)
    c = rng.normal(size=(len(x), 3, 3)) / SPACING * free[:, None, None]
    cell = 0.25 * np.array(sim.solver.grid.dx) ** 2

    def energy():
        own = ((v - u) ** 2).sum(axis=1) + (c**2 * cell).sum(axis=(1, 2))
        return 0.5 * float((mass * own)[free].sum())

    energies = [energy()]
    for _ in range(60):
        v, c = transferred(sim, v, c)
        energies.append(energy())
    assert (np.diff(energies) <= 1e-6 * energies[0]).all()
    assert sim.pool.held.numpy()[: len(x)].max() == CARRIED
