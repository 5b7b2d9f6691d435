"""Volume of MPM's pastes beside a body (solvers/mpm/dilation.py): exact for what is linear, the flux where nodes are
full, and pressure its transpose."""

import numpy as np
import pytest
import warp as wp

from fluidbench.native.simulation import Simulation

from .test_tip import PASTE, SPACING, D, strand


def heap(seed=3):
    """A paste below a face, with free surfaces all about, in disorder; volume ratios at random."""
    slab = {"kind": "box", "center": [0.0, 0.0, D / 2], "size": [1.6 * D, 1.2 * D, D]}
    sim = Simulation(strand(material=PASTE, bodies=[slab]), "mpm")
    sim.begin()
    n, rng, pool = sim.pool.counts[0], np.random.default_rng(seed), sim.pool
    for field, noise in ((pool.position, 0.3 * SPACING), (pool.volume_ratio, 0.01)):
        whole = field.numpy()
        whole[:n] += rng.uniform(-noise, noise, whole[:n].shape)
        field.assign(whole)
    sim.solver.refresh()
    sim.solver.clear_grid()
    return sim


def places(solver):
    """Where active nodes lie [m]."""
    grid, count = solver.grid, int(solver.active.numpy()[0])
    by, bz = grid.blocks[1], grid.blocks[2]
    block = solver.block_of.numpy()[:count]
    local = np.arange(64)
    corner = 4 * np.stack([block // (by * bz), block // bz % by, block % bz], axis=1)
    inner = np.stack([local >> 4, (local >> 2) & 3, local & 3], axis=1)
    return np.array(grid.origin) + (corner[:, None] + inner[None]).reshape(-1, 3) * np.array(grid.dx)


def told(sim, velocity, gap=None):
    """(P, f, D, F) of active nodes, of which those given are the velocities."""
    solver, dilation = sim.solver, sim.solver.held.dilation
    sim.scene.dt.fill_(1.0)
    solver.empty(solver.raw)
    solver.empty(dilation.nodes)
    dilation.press(sim.scene.dt, solver.blocks, gap, solver.raw)
    moving = solver.moving.numpy()
    moving[: len(velocity), :3] = velocity
    solver.moving.assign(moving)
    dilation.tell(solver.blocks, solver.moving)
    n = len(velocity)
    nodes = dilation.nodes.numpy()[:n].astype(float)
    force = solver.raw.numpy()[:n, :3].astype(float)
    return nodes[:, 0], nodes[:, 3], dilation.rate.numpy()[:n].astype(float), force


def test_a_linear_field_dilates_by_its_trace_wherever_matter_ends():
    sim = heap()
    x = places(sim.solver)
    turning, shearing = [[0, 2, -1], [-2, 0, 4], [1, -4, 0]], [[0, 1, 2], [3, 0, 4], [5, 6, 0]]
    for gradient in (np.diag([1.0, -2.0, 3.5]), turning, shearing):
        g = np.array(gradient, dtype=float)
        _push, full, rate, _force = told(sim, x @ g.T + 0.3)
        heard = full > 0.05
        assert heard.sum() > 300 and full.min() == 0.0
        assert rate[heard] == pytest.approx(np.trace(g), abs=2e-4 * abs(g).max())


def test_where_nodes_are_full_it_is_the_flux_through_the_cell_around_each():
    sim = heap()
    sim.pool.volume.assign(2.0 * sim.pool.volume.numpy())  # full, in spite of the disorder
    grid, x = sim.solver.grid, places(sim.solver)
    node = np.rint((x - np.array(grid.origin)) / np.array(grid.dx)).astype(int)
    v = np.random.default_rng(5).normal(size=x.shape)
    _push, full, rate, _force = told(sim, v)
    at = {tuple(k): t for t, k in enumerate(node)}
    weight, checked = {-1: 1 / 6, 0: 4 / 6, 1: 1 / 6}, 0
    for t, k in enumerate(node):
        around = {o: at.get(tuple(k + o)) for o in map(tuple, np.argwhere(np.ones((3, 3, 3))) - 1)}
        if None in around.values() or min(full[list(around.values())]) < 1.0:
            continue
        checked += 1
        flux = 0.0
        for axis in range(3):
            for o, a in around.items():
                w = np.prod([weight[o[i]] for i in range(3) if i != axis])
                flux += o[axis] * w * v[a, axis] / (2.0 * grid.dx[axis])
        assert rate[t] == pytest.approx(flux, abs=1e-3)
    assert checked > 5


def test_pressure_does_the_work_of_the_dilation_that_is_read_and_makes_no_momentum():
    sim = heap()
    v = np.random.default_rng(7).normal(size=places(sim.solver).shape)
    push, _full, rate, force = told(sim, v)
    work, size = (push * rate).sum(), abs(push * rate).sum()
    assert size > 0.0 and (force * v).sum() == pytest.approx(-work, abs=1e-5 * size)
    assert force.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-5 * abs(force).sum())


def test_what_lies_in_a_gap_neither_presses_nor_tells():
    sim = heap()
    x = places(sim.solver)
    closed = np.abs(x[:, 2] - D / 2) < 0.6 * sim.solver.grid.dx[2]
    gap = np.zeros(len(sim.solver.held.dilation.rate))
    gap[: len(x)] = closed
    v = np.where(closed[:, None], [100.0, -200.0, 300.0], 0.0)
    _push, full, rate, force = told(sim, v, wp.array(gap, dtype=float))
    assert (force[closed] == 0.0).all() and abs(force[~closed]).max() > 0.0
    assert (full[closed] == 0.0).all() and (rate == 0.0).all()
    assert abs(told(sim, v)[2]).max() > 0.0


def test_liquids_keep_what_their_affine_fields_tell():
    assert Simulation(strand(), "mpm").solver.held.dilation is None
