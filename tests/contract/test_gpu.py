"""The same answers on CUDA as on the CPU, within the measure's resolution, and late news of it. Run with -m gpu."""

import numpy as np
import pytest
import warp as wp

from fluidbench.measure.ledger import ledger, lengths
from fluidbench.method.target import Target
from fluidbench.method.verdict import Verdict
from fluidbench.native.simulation import LOOK_TICKS, Simulation
from fluidbench.runs.drive import Drive

from ..conftest import NATIVE, bead, drive, scenario


@pytest.mark.gpu
@pytest.mark.parametrize("name", NATIVE)
def test_cuda_agrees_with_the_cpu(name):
    s = bead(duration=0.4)
    rows = []
    for device in ("cpu", "cuda:0"):
        sim = Simulation(s, name, Target(device))
        assert drive(sim).verdict is Verdict.COMPLETED
        frame = sim.frame()
        rows.append({**ledger(frame, s), **lengths(frame, s)})
    assert rows[0]["mass_kg"] == rows[1]["mass_kg"]
    for key in ("top_m", "center_x_m", "center_z_m"):
        assert rows[0][key] == pytest.approx(rows[1][key], abs=s.spacing / 2)


@pytest.mark.gpu
@pytest.mark.parametrize("name", NATIVE)
def test_any_gpu_will_do(name):
    """What Warp does by default it does on the first one: no run on another came through."""
    last = wp.get_cuda_devices()[-1].alias
    assert drive(Simulation(bead(duration=0.4), name, Target(last))).verdict is Verdict.COMPLETED


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("name", NATIVE)
def test_a_run_that_breaks_is_stopped_and_dated(name, device):
    """At the first look after it, on a GPU at most two spans of ticks later; its costs are of all that was paid for."""
    s = bead(duration=0.4)
    sim = Simulation(s, name, Target(device))
    sim.prepare()
    way = Drive(sim, s)
    way.begin()
    while sim.now < 0.15:
        way.leg()
    hit, velocity = sim.now, sim.pool.velocity.numpy()
    velocity[3] = np.nan
    sim.pool.velocity.assign(velocity)
    while sim.now < way.end - way.near and way.outcome.verdict is Verdict.COMPLETED:
        way.leg()
    assert way.outcome.verdict is Verdict.DIVERGED
    spans = 1 if device == "cpu" else LOOK_TICKS
    assert hit <= way.outcome.time <= hit + (spans + 0.5) * sim.tick
    assert way.outcome.time <= sim.now <= way.outcome.time + (2 * spans + 0.5) * sim.tick


@pytest.mark.gpu
def test_what_a_gpu_is_asked_at_a_time_changes_nothing():
    """Ticks one by one, or as many as an output holds: plans go by ticks alone. SPH adds in one order."""
    s = bead(duration=0.4)
    one, many = (Simulation(s, "sph", Target("cuda:0")) for _ in range(2))
    assert drive(many).verdict is Verdict.COMPLETED
    one.prepare()
    one.begin()
    for _ in range(one.ticks):
        one.advance_tick()
    assert (one.frame()["position"] == many.frame()["position"]).all()


@pytest.mark.gpu
def test_chained_substeps_are_those_one_by_one():
    """Of MPM, where matter enters blocks of the grid all the time; atomic sums come in any order."""
    cube = {"kind": "box", "center": [0.1] * 3, "size": [0.095] * 3, "velocity": [1.0, 0.7, 0.5]}
    material = {"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.4, "yield_stress": 100.0}
    s = scenario(domain={"lower": [0.0] * 3, "upper": [0.5] * 3}, bodies=[cube], spacing=0.005, material=material)
    one, many = (Simulation([s, s], "mpm", Target("cuda:0")) for _ in range(2))
    for sim in (one, many):
        assert sim.solver.chain is not None and sim.pool.counts[0] == 19**3 < sim.pool.capacity
        sim.prepare()
        sim.begin()
    dt, before = min(bound.dt for bound in one.bounds()), one.frame()["position"]
    for _ in range(4):
        for sim in (one, many):
            sim.sort()
        many.march(dt, 50)
        for _ in range(50):
            one.march(dt, 1)
    assert not many.look().complaint and not many.pool.fault.numpy()[0]
    for world in range(2):
        alone, chained = (sim.frame(world)["position"] for sim in (one, many))
        assert np.linalg.norm(alone - before, axis=1).min() > 2 * s.spacing
        np.testing.assert_allclose(chained, alone, atol=1e-2 * s.spacing)
