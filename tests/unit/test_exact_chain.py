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
MATERIALS = pytest.mark.parametrize("material", [PASTE, HARDENING, LIQUID], ids=["paste", "hardening", "liquid"])


def drop(material, chained, **more):
    """A cube in two worlds that flies and turns, of fewer particles than there are slots."""
    cube = {"kind": "box", "center": [0.15, 0.2, 0.15], "size": [0.07] * 3, "velocity": [0.3, 0.1, -0.3], **more}
    domain = {"lower": [0.0] * 3, "upper": [0.4] * 3, "walls": {"y_lower": "periodic", "y_upper": "periodic"}}
    parts = {
        "domain": domain,
        "bodies": [cube],
        "spacing": D,
        "duration": 0.2,
        "numerics": {"mpm": {"grid_ratio": 1.5}},
    }
    worlds = [scenario(**parts, material=material), scenario(**parts, material=material, gravity=[1.0, 0.0, -5.0])]
    sim = Simulation(worlds, "mpm", graphs=False)
    assert sim.solver.chain is None, "the CPU goes by blocks"
    sim.solver.by_block = None
    if chained:
        sim.solver.chain = Chain(sim.solver)
    sim.prepare()
    sim.begin()
    if not more:
        arm = sim.pool.position.numpy() - np.float32([0.15, 0.2, 0.15])
        sim.kick(sim.pool.velocity.numpy() + np.cross([0.0, 3.0, 0.0], arm).astype(np.float32))
    return sim


def same(one, chained):
    """All that is known of every particle, and how many blocks there are."""
    assert not one.pool.fault.numpy()[0] and not chained.pool.fault.numpy()[0]
    assert one.pool.counts == chained.pool.counts == [7**3] * 2 and one.pool.capacity > 7**3
    for name in one.pool.fields:
        np.testing.assert_array_equal(one.pool.fields[name].numpy(), chained.pool.fields[name].numpy(), err_msg=name)
    assert one.solver.active.numpy()[0] == chained.solver.active.numpy()[0]


@MATERIALS
def test_chained_substeps_are_those_one_by_one(material):
    one, chained = drop(material, False), drop(material, True)
    dt, begun = min(bound.dt for bound in one.bounds()), one.pool.position.numpy().copy()
    first = int(one.solver.active.numpy()[0])
    for batch in (1, 2, 5, 40, 3):
        for sim in (one, chained):
            sim.march(dt, batch)
            sim.pool.stale = batch == 5  # blocks get other slots
    same(one, chained)
    assert int(chained.solver.active.numpy()[0]) > first, "matter has come to other blocks"
    assert np.linalg.norm(one.pool.position.numpy() - begun, axis=1)[: 7**3].min() > 0.5 * D
    assert np.abs(np.diff([one.frame(w)["position"] for w in range(2)], axis=0)).max() > 1e-4


@MATERIALS
def test_so_are_ticks_with_a_body_that_comes_later(material):
    """Particles are sorted, kept apart and settled between ticks, by way of the nodes that a chain begins with."""
    sims = [drop(material, chained, start=0.02) for chained in (False, True)]
    for sim in sims:
        while sim.now < 0.12:
            sim.advance_tick()
    one, chained = sims
    assert one.done > 64 and one.solver.separation is not None and one.solver.settling is not None
    same(one, chained)


def test_nodes_that_were_full_under_other_slots_are_empty_when_drawn_again():
    sim, fresh = drop(PASTE, True), drop(PASTE, True)
    dt = min(bound.dt for bound in sim.bounds())
    sim.march(dt, 80)
    before = int(sim.solver.active.numpy()[0])
    for name, array in fresh.arrays().items():
        array.assign(sim.arrays()[name])
    for other in (sim, fresh):
        other.solver.refresh()
    assert int(sim.solver.active.numpy()[0]) < before, "slots are free that were full"
    for nodes in (sim.solver.raw, sim.solver.chain.other):
        assert np.abs(nodes.numpy()).max() == 0.0
    for other in (sim, fresh):
        other.march(dt, 80)
    same(sim, fresh)
    assert int(sim.solver.active.numpy()[0]) >= before


def test_a_chain_takes_two_launches_a_substep_and_two_more():
    sim = drop(PASTE, True)
    sim.march(1e-5, 10)
    assert sim.substep_launches == 3  # (2 * 10 + 2) / 10, rounded up
    one = drop(PASTE, False)
    one.march(1e-5, 10)
    assert one.substep_launches == 4
