"""Threads of the CPU: every item is somebody's, all wait for all, and no bit depends on how many there are."""

import hashlib

import numpy as np
import pytest
import warp as wp

from fluidbench.errors import UserError
from fluidbench.method.suitability import check_backend
from fluidbench.method.target import Target
from fluidbench.native.crew import Crew, index_of, put, raise_fault
from fluidbench.native.simulation import Simulation
from fluidbench.scenario.domain import Walls
from fluidbench.study.speed import block

from ..conftest import bead, scenario
from .ballistic import Ballistic

METHODS = ["mpm", "sph", "pbd"]
PASTE = {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 50.0, "plastic_viscosity": 2.0}
ROUGH = {"x_lower": "periodic", "x_upper": "periodic", "y_lower": "stick", "z_lower": {"friction": 0.3}}
BLOCK = {"kind": "box", "center": [0.055, 0.06, 0.07], "size": [0.08, 0.08, 0.1], "velocity": [0.7, 0.3, -1.0]}
BLOCK["velocity_gradient"] = [[0.0, 3.0, 0.0], [0.0, 0.0, -5.0], [2.0, 0.0, 0.0]]


@wp.kernel
def visit(share: wp.vec3i, visits: wp.array(dtype=int), fault: wp.array(dtype=int)):
    i = index_of(share, wp.tid())
    visits[i] = visits[i] + 1
    raise_fault(fault, 1 << (i % 8))


@wp.kernel
def double(share: wp.vec3i, number: wp.array(dtype=int), other: wp.array(dtype=int)):
    """Wrong where any item is not there yet."""
    i = index_of(share, wp.tid())
    other[i] = number[number.shape[0] - 1 - i] + number[i]


@pytest.mark.parametrize("size", [1, 2, 3, 31, 33, 1024, 2048, 2080, 4096 + 17])
@pytest.mark.parametrize("threads", [1, 2, 3, 5])
def test_every_item_is_somebodys(threads, size):
    crew = Crew(wp.get_device("cpu"), threads)
    visits, fault = wp.zeros(size, dtype=int), wp.zeros(1, dtype=int)
    crew.launch(visit, size, [visits, fault])  # not recorded: one thread's
    for _ in range(3):
        crew.run("visit", lambda: crew.launch(visit, size, [visits, fault]))
    assert (visits.numpy() == 4).all() and fault.numpy()[0] == 2 ** min(size, 8) - 1


def test_a_launch_sees_all_of_the_one_before():
    """A thousand doublings of numbers that another thread has written, modulo 2^32: 2^k, then 0."""
    crew, size = Crew(wp.get_device("cpu"), 3), 4096
    a, b = wp.array(np.ones(size, np.int32), dtype=int), wp.zeros(size, dtype=int)

    def turn():
        crew.launch(double, size, [a, b])
        crew.launch(double, size, [b, a])

    for times in range(1, 15):
        crew.run("turn", turn)
        assert (a.numpy() == 4**times).all()
    crew.replay([(crew.recorded("turn", turn), 500)])
    assert not a.numpy().any()


def test_what_cannot_be_shared_is_done_once():
    crew, numbers = Crew(wp.get_device("cpu"), 3), wp.zeros(1, dtype=int)
    done = []
    crew.run("put", lambda: (crew.launch(put, 1, [7, numbers]), crew.alone(lambda: done.append(crew.leading))))
    assert numbers.numpy()[0] == 7 and done == [True] and len(crew.graphs["put"]) == 3


def world(material=PASTE, **more):
    """A block of paste that shears and slides across a periodic face, with walls that stick and rub."""
    domain = {"lower": [0, 0, 0], "upper": [0.11, 0.16, 0.2], "walls": ROUGH}
    return scenario(domain=domain, bodies=[BLOCK], material=material, duration=0.05, spacing=0.01, **more)


SYRUP = {"density": 1000.0, "viscosity": 5.0, "sound_speed": 10.0}
CASES = {
    "liquid": lambda: world(material={"density": 1000.0, "sound_speed": 10.0}),
    "paste": world,
    "syrup": lambda: world(material=SYRUP),
    "solid": lambda: world(material={"density": 1000.0, "youngs_modulus": 1e4}),
    "curing": lambda: world(material=PASTE | {"cure": {"delay": 0.01, "youngs_modulus": 1e5}}),
    "growing": lambda: world(material=PASTE | {"expansion": {"ratio": 1.5, "time": 0.05}}),
    "spawning": lambda: world(material=PASTE | {"expansion": {"kind": "spawn", "ratio": 1.5, "delay": 0.02}}),
    "bead": lambda: bead(duration=0.15),
    "worlds": lambda: [world(), world(gravity=[0, 0, -3.0]), world(seed=5)],
}


def bits(given, method, threads):
    sim = Simulation(given, method, Target(threads=threads))
    sim.prepare()
    sim.begin()
    for _ in range(sim.ticks):
        sim.advance_tick()
        sim.look()
    fields = {name: hashlib.sha256(array.numpy().tobytes()).hexdigest() for name, array in sim.pool.fields.items()}
    return fields, list(sim.pool.counts), sim.substep_launches


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_the_bits_are_the_same_for_any_number_of_threads(case, method):
    given = CASES[case]()
    one = bits(given, method, 1)
    assert bits(given, method, 2) == one == bits(given, method, 3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", [*CASES, "implicit"])
def test_nothing_is_left_to_compile_once_a_run_is_prepared(case, method, monkeypatch):
    """What a run costs is told without compilation, on a machine that has compiled nothing, too."""
    given = CASES["syrup" if case == "implicit" else case]()
    if case == "implicit" and method != "pbd":
        own = {"numerics": {method: {"viscosity": "implicit"}}}
        given = given.model_copy(update={"domain": given.domain.model_copy(update={"walls": Walls()}), **own})
    sim = Simulation(given, method)
    module = type(wp.get_module("solvers.search"))
    loaded, load = set(), module.load

    def noted(self, *args, **more):
        loaded.add(self.name)
        return load(self, *args, **more)

    monkeypatch.setattr(module, "load", noted)
    sim.prepare()
    prepared = set(loaded)
    sim.begin()
    for _ in range(sim.ticks):
        sim.advance_tick()
        sim.look()
    assert loaded <= prepared, loaded - prepared


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("case", ["paste", "growing", "worlds"])
def test_transfers_by_block_are_those_by_particle(case, ratio):
    """The CPU's against the GPU's, run on the CPU: sums in another order, over periodic ends of 3 to 11 cells."""
    given = CASES[case]()
    worlds = given if isinstance(given, list) else [given]
    worlds = [s.model_copy(update={"numerics": {"mpm": {"grid_ratio": ratio}}}) for s in worlds]
    by_block, by_particle = (Simulation(worlds, "mpm") for _ in range(2))
    by_particle.solver.by_block = None
    for sim in (by_block, by_particle):
        sim.prepare()
        sim.begin()
        for _ in range(6):
            sim.advance_tick()
    for name, array in by_block.pool.fields.items():
        a, b = array.numpy(), by_particle.pool.fields[name].numpy()
        assert np.abs(a - b).max() <= 1e-4 * max(np.abs(b).max(), 1e-9), name


@pytest.mark.parametrize("side", [13, 17, 26])
def test_a_box_that_matter_fills_has_room_for_all_homes(side):
    sim = Simulation(block("paste", side), "mpm")
    sim.prepare()
    vital = sim.begin()
    homes = sim.solver.by_block.homes
    assert vital.shortage is None and homes.number.numpy()[: homes.total.numpy()[0]].sum() == side**3


def test_a_parent_that_moves_with_a_single_child_finds_its_home():
    """Children below the least height are lifted over the border of a block."""
    foam = {"kind": "spawn", "ratio": 1.2, "delay": 0.05, "jitter": 0.04, "margin": 1.2}
    walls = {f"{axis}_{end}": "slip" for axis in "xyz" for end in ("lower", "upper")}
    body = {"kind": "box", "center": [0.1, 0.1, 0.02], "size": [0.06, 0.06, 0.04]}
    domain = {"lower": [0, 0, 0], "upper": [0.2] * 3, "walls": walls}
    material = {"density": 1000.0, "viscosity": 0.1, "expansion": foam}
    sim = Simulation(scenario(domain=domain, bodies=[body], material=material, duration=0.1, spacing=0.01), "mpm")
    sim.prepare()
    sim.begin()
    grid, solver, checked = sim.solver.grid, sim.solver, 0
    run = sim._run

    def checking(substeps):
        nonlocal checked
        if not solver.by_block.homes.outdated.numpy()[0]:  # otherwise they are found anew
            count = sim.pool.counts[0]
            x = (sim.pool.position.numpy()[:count] - np.array(grid.origin)) * np.array(grid.inv_dx)
            block_of = np.floor(x - 0.5).astype(int) >> 2
            number = (block_of[:, 0] * grid.blocks[1] + block_of[:, 1]) * grid.blocks[2] + block_of[:, 2]
            assert (solver.table.numpy()[number] - 1 == solver.by_block.homes.of_particle.numpy()[:count]).all()
            checked += 1
        run(substeps)

    sim._run = checking
    for _ in range(sim.ticks):
        sim.advance_tick()
    assert checked > 3 and sum(sim.pool.counts) > 144


def test_a_runaway_speed_is_no_plan():
    """A method that has broken is not asked for steps as small as its speed would have them."""
    sim = Simulation(world(), "mpm")
    sim.prepare()
    sim.begin()
    before = sim.speed
    sim.kick(np.full((sim.pool.size, 3), 1e6, np.float32))
    assert sim.look().complaint is not None and sim.speed == before


def test_a_method_that_launches_for_itself_has_one_thread():
    with pytest.raises(UserError, match="ballistic runs on one thread of the CPU, not on 2"):
        check_backend(Ballistic, Target(threads=2))
    check_backend(Ballistic, Target())
