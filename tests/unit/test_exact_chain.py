"""MPM's chained substeps are those one by one, to the bit: a GPU's passes, on the CPU, where sums have one order."""

import numpy as np
import pytest

from fluidbench.native.simulation import Simulation
from solvers.mpm.chain import Chain

from ..conftest import scenario

D = 0.01
PASTE = {"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.4, "yield_stress": 50.0, "plastic_viscosity": 1.0}
HARDENING = {**PASTE, "hardening": 5.0, "saturated_yield_stress": 80.0}
LIQUID = {"density": 1000.0, "viscosity": 0.1}


def drop(material, chained, speed=0.3):
    """A cube that flies and turns, over a floor and free: it enters and leaves blocks of the grid."""
    cube = {"kind": "box", "center": [0.15, 0.2, 0.15], "size": [0.08] * 3, "velocity": [speed, 0.1, -speed]}
    domain = {"lower": [0.0] * 3, "upper": [0.4] * 3, "walls": {"y_lower": "periodic", "y_upper": "periodic"}}
    s = scenario(domain=domain, bodies=[cube], spacing=D, material=material, numerics={"mpm": {"grid_ratio": 1.5}})
    sim = Simulation(s, "mpm", graphs=False)
    assert sim.solver.chain is None, "the CPU goes by blocks"
    sim.solver.by_block = None
    if chained:
        sim.solver.chain = Chain(sim.solver)
    sim.prepare()
    sim.begin()
    x = sim.pool.position.numpy()
    sim.kick(sim.pool.velocity.numpy() + np.cross([0.0, 3.0, 0.0], x - x.mean(axis=0)).astype(np.float32))
    return sim


@pytest.mark.parametrize("material", [PASTE, HARDENING, LIQUID], ids=["paste", "hardening", "liquid"])
def test_chained_substeps_are_those_one_by_one(material):
    one, chained = drop(material, False), drop(material, True)
    dt = min(bound.dt for bound in one.bounds())
    for batch in (1, 2, 5, 40, 3):
        for sim in (one, chained):
            sim.march(dt, batch)
            sim.pool.stale = batch == 40  # blocks get other slots, fewer than before
    assert one.solver.active.numpy()[0] == chained.solver.active.numpy()[0]
    assert not one.pool.fault.numpy()[0] and not chained.pool.fault.numpy()[0]
    assert np.ptp(one.pool.position.numpy(), axis=0).min() > 0.05, "it is whole, and has moved"
    for name in one.pool.fields:
        np.testing.assert_array_equal(one.pool.fields[name].numpy(), chained.pool.fields[name].numpy(), err_msg=name)


def test_nodes_that_were_full_under_other_slots_are_empty_when_drawn_again():
    """All nodes beyond the active ones hold nothing, whatever blocks there were."""
    sim = drop(PASTE, True)
    dt = min(bound.dt for bound in sim.bounds())
    sim.march(dt, 30)
    before = int(sim.solver.active.numpy()[0])
    sim.solver.refresh()
    active = int(sim.solver.active.numpy()[0])
    assert active < before
    for nodes in (sim.solver.raw, sim.solver.chain.other):
        assert np.abs(nodes.numpy()).max() == 0.0
    sim.march(dt, 2)
    after = 64 * int(sim.solver.active.numpy()[0])
    for nodes in (sim.solver.raw, sim.solver.chain.other):
        assert np.abs(nodes.numpy()[after:]).max() == 0.0


def test_a_chain_takes_two_launches_a_substep_and_two_more():
    sim = drop(PASTE, True)
    sim.march(1e-5, 10)
    assert sim.substep_launches == 3  # (2 * 10 + 2) / 10, rounded up
    one = drop(PASTE, False)
    one.march(1e-5, 10)
    assert one.substep_launches == 4
