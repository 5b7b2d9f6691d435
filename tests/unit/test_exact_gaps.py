"""MPM's bodies that come together: which nodes lie in a gap, and that nothing crosses it, nor is lost in it."""

import numpy as np
import pytest

from fluidbench.native.simulation import Simulation
from solvers.mpm.gap_nodes import EVERY, RANDOM, RANDOM_OF_NINE, SOFT
from solvers.mpm.grid import FIRST

from ..conftest import PERIODIC, bead, scenario

D, SIDE = 0.01, 0.4
PASTE = {"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.4, "yield_stress": 200.0}
SPEED = 0.1


def box(center, size, **more):
    return {"kind": "box", "center": center, "size": size, **more}


def started(bodies, ratio=1.5, material=PASTE, gravity=(0, 0, 0), **table):
    """The simulation of bodies in a box, and its first substep's plan."""
    s = scenario(
        domain={"lower": [0.0] * 3, "upper": [SIDE] * 3},
        bodies=bodies,
        gravity=list(gravity),
        spacing=D,
        material=material,
        numerics={"mpm": {"grid_ratio": ratio}},
        **table,
    )
    sim = Simulation(s, "mpm", graphs=False)
    sim.prepare()
    sim.begin()
    return sim


def gaps_of(sim, rate=0.0):
    """How far the active nodes lie in gaps, while all comes together at a rate [1/s] besides."""
    v, x = sim.pool.velocity.numpy(), sim.pool.position.numpy()
    sim.pool.velocity.assign(v - np.float32(rate) * (x - np.float32(SIDE / 2)))
    sim.solver.refresh()
    sim.march(1e-6, 1)
    return sim.solver.gaps.known.gap.numpy()[: int(sim.solver.active.numpy()[0]) * 64]


def apart(gap, speed=SPEED, tilt=0.0, ratio=1.5, material=PASTE, **table):
    """Two cubes of 12 particles across, `gap` cells between them, the upper one coming down."""
    cell = SIDE / round(SIDE / (ratio * D))
    edge, low = 12 * D, 0.05
    upper = low + edge + gap * cell + edge / 2
    velocity = [tilt * speed, 0.0, -speed]
    bodies = [
        box([0.2, 0.2, low + edge / 2], [edge] * 3),
        box([0.2, 0.2, upper], [edge] * 3, velocity=velocity),
    ]
    return started(bodies, ratio, material, **table), cell


@pytest.mark.parametrize("ratio", [1.0, 1.25, 1.5, 2.0, 2.5])
@pytest.mark.parametrize("shift", [0.0, 0.003, 0.007])
def test_what_is_convex_has_no_gaps(ratio, shift):
    """A box far from another, a ball and a slanted slab, however they lie on the grid."""
    ball = {"kind": "sphere", "center": [0.3, 0.3 + shift, 0.28], "radius": 0.06}
    slab = box([0.1, 0.25, 0.3 + shift], [0.12] * 3, where="abs(x + z - 0.4) < 0.04")
    sim = started([box([0.2, 0.1 + shift, 0.08], [0.15, 0.1, 0.08]), ball, slab], ratio)
    assert gaps_of(sim, rate=1.0).max() == 0.0


def test_particles_in_no_order_make_none():
    """Moved by a fifth of their spacing, two to a cell's edge."""
    sim = started([box([0.2] * 3, [0.2] * 3), box([0.2, 0.2, 0.02], [0.02] * 3)], 2.0)
    x = sim.pool.position.numpy()
    x += np.random.default_rng(1).normal(0.0, 0.2 * D, x.shape).astype(np.float32)
    sim.pool.position.assign(x)
    assert (gaps_of(sim, rate=1.0) > 0.0).mean() < 0.002


@pytest.mark.parametrize("gap", [0.6, 1.0])
def test_what_lies_between_two_bodies_is_one(gap):
    found = gaps_of(apart(gap)[0])
    assert found.max() > 0.4 and (found > 0.0).sum() > 30


def test_what_does_not_come_nearer_has_met():
    """However far apart: at rest, or going apart. However slowly it does, it has not."""
    sim = apart(1.0)[0]
    v = sim.pool.velocity.numpy().copy()
    for share, gap in ((0.0, False), (-1.0, False), (1e-4, True), (4.0, True)):
        sim.pool.velocity.assign(v * np.float32(share))
        sim.pool.affine.zero_()
        assert (gaps_of(sim).max() > 0.0) == gap


def grooved(depth):
    """Two layers that lie on each other, with a groove of so many cells at the joint."""
    where = "abs(x - 0.2) < 0.09 - {depth} * (abs(z - {z}) / 0.03) ** 2"
    return started(
        [box([0.2, 0.2, z], [0.18, 0.1, 0.06], where=where.format(depth=0.015 * depth, z=z)) for z in (0.03, 0.09)],
        gravity=[0, 0, -2.0],
    )


def test_layers_that_lie_on_each_other_are_one():
    """At rest under their weight: to the bit as without gaps."""
    ends = []
    for kept in (True, False):
        sim = grooved(1.2)
        if not kept:
            sim.solver.gaps = None
        sim.march(1e-3, 300)
        ends.append(sim.pool.position.numpy().copy())
    assert np.array_equal(*ends)


def test_a_groove_that_closes_slowly_is_open_a_cell_away_from_the_joint():
    sim = grooved(3.6)
    gap, grid = gaps_of(sim, rate=1e-3), sim.solver.grid
    block, local = sim.solver.block_of.numpy()[: gap.size // 64].repeat(64), np.arange(gap.size) % 64
    node = np.array([*np.unravel_index(block, tuple(grid.blocks))]) * 4 + [local >> 4, (local >> 2) & 3, local & 3]
    x, _y, z = ((node[axis] - int(FIRST) + 0.5) * grid.dx[axis] for axis in range(3))
    joint = np.abs(z - 0.06) < grid.dx[2]
    cells = (np.abs(x - 0.2) - 0.036) / grid.dx[0]  # from the end of the joint
    assert gap[~joint].max() == 0.0 and gap[cells < 1.0].max() == 0.0 and gap[cells > 1.5].max() > 0.5
    assert (gaps_of(grooved(3.6), rate=100.0) > 0.0).sum() > (gap > 0.0).sum()  # up to the joint, if it closes fast


@pytest.mark.parametrize("ratio", [1.25, 1.5, 2.0])
def test_a_gap_of_a_twentieth_of_a_cell_is_none(ratio):
    assert gaps_of(apart(0.05, ratio=ratio)[0]).max() == 0.0


def thrown(each, side):
    """What nodes hold of particles thrown at random, over their mean; periodic."""
    x = np.random.default_rng(0).uniform(0, side, (int(side**3 * each), 3))
    base = np.floor(x - 0.5).astype(int)
    f = x - base
    w = [0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2]
    nodes = np.zeros((side,) * 3)
    for o, q, r in np.ndindex(3, 3, 3):
        at = tuple((base + np.array((o, q, r))).T % side)
        np.add.at(nodes, at, w[o][:, 0] * w[q][:, 1] * w[r][:, 2])
    return nodes / each


def test_what_nodes_hold_of_particles_thrown_at_random():
    """Their noise is the least lack that counts: the more particles a cell, the less."""
    for each in (1.0, 8.0):
        assert thrown(each, 20).std() == pytest.approx(RANDOM / np.sqrt(each), rel=0.05)
    known = apart(1.0, ratio=1.5)[0].solver.gaps.known
    assert known.noise == pytest.approx(RANDOM / 1.5**1.5, rel=0.02)
    assert known.common == pytest.approx(RANDOM_OF_NINE / 1.5**1.5, rel=0.02)


def test_what_nine_nodes_lack_among_particles_thrown_at_random():
    """As much as counts one node in ten thousand does, and those about it, six of nine with matter on both sides."""
    full, lacking, axes = np.minimum(thrown(1.0, 60), 1.0), [], (0, 1, 2)
    for axis in axes:
        mean = np.sqrt(np.roll(full, 1, axis) * np.roll(full, -1, axis))
        lack = np.where(mean < 0.5, 1.0, 1.0 - full / np.maximum(mean, 0.5))
        about = [tuple(np.insert(np.array(s) - 1, axis, 0)) for s in np.ndindex(3, 3)]
        least = np.min([np.roll(lack, s, axes) for s in about], axis=0)
        closed = np.sum([np.roll(mean >= 0.5, s, axes) for s in about], axis=0)
        lacking.append((least > RANDOM_OF_NINE) & (closed >= 6) & (mean >= 0.5))
    assert 3e-5 < np.mean(lacking) < 3e-4


def test_what_a_gap_about_a_node_makes_of_it():
    """By the spline's mass in |x| < w / 2, of which its neighbours lack a sixth each at w = 1: what lies in line with
    its spacing, 1.5 to a cell, is let go up to a gap of a third of a cell, whole from a half on."""
    for lacking, w in ((RANDOM / 1.5**1.5, 0.35), (RANDOM / 1.5**1.5 + float(SOFT), 0.51)):
        own = 1.0 - 0.75 * w + w**3 / 12.0
        beside = 1.0 - ((0.5 + w / 2) ** 3 - (0.5 - w / 2) ** 3) / 6.0
        assert 1.0 - own / beside == pytest.approx(lacking, abs=0.01)


@pytest.mark.parametrize("ratio", [1.5, 2.0])
def test_less_than_half_as_much_crosses_a_gap(ratio):
    """Of the upper one's momentum, while half a gap of one cell closes. (Nothing should: what is left crosses nodes
    beside the gap, which hold a little of the other body.)"""
    crossed = {}
    for kept in (True, False):
        sim, cell = apart(1.0, ratio=ratio)
        if not kept:
            sim.solver.gaps = None
        sim.march(0.5 * cell / SPEED / 200, 200)
        n = sim.pool.counts[0]
        z, v = sim.pool.position.numpy()[:n, 2], sim.pool.velocity.numpy()[:n, 2]
        crossed[kept] = np.abs(v[z < 0.17 + 0.25 * cell]).mean() / SPEED
    assert crossed[False] > 0.3 and crossed[True] < 0.5 * crossed[False]


def test_linear_and_angular_momentum_are_kept():
    sim, cell = apart(1.0, tilt=0.7)
    n, m = sim.pool.counts[0], sim.pool.mass.numpy()[:, None]

    def momenta():
        x, v = (sim.pool.fields[name].numpy()[:n].astype(float) for name in ("position", "velocity"))
        return (m[:n] * v).sum(axis=0), (m[:n] * np.cross(x, v)).sum(axis=0) + sim.solver.spins()[:n].sum(axis=0)

    before = momenta()
    sim.march(1.5 * cell / SPEED / 300, 300)
    after = momenta()
    size = np.linalg.norm(before[0])
    assert after[0] == pytest.approx(before[0], abs=1e-5 * size)
    assert after[1] == pytest.approx(before[1], abs=2e-4 * size * SIDE)


def test_they_come_to_rest_against_each_other():
    """What falls a cell deep onto what lies is carried, and neither sinks into the other."""
    sim, cell = apart(1.0, speed=0.05)
    sim.march(1e-4, int(4 * cell / 0.05 / 1e-4))
    v = sim.pool.velocity.numpy()[: sim.pool.counts[0], 2]
    z = np.sort(sim.pool.position.numpy()[: sim.pool.counts[0], 2])
    assert abs(v.mean() + 0.025) < 0.002  # together
    assert np.abs(v + 0.025).max() < 0.03
    assert z[-1] - z[0] > 22.5 * D


def test_gaps_are_looked_for_anew_every_fourth_substep():
    """And at once where nodes have other numbers. (The first is of the substep that starts affine fields.)"""
    sim = apart(1.0)[0]
    known = sim.solver.gaps.known
    looks = []
    for k in range(2 * int(EVERY) + 1):
        if k == 6:
            sim.solver.refresh()
        sim.march(1e-6, 1)
        looks.append(int(known.last.numpy()[0]))
    assert looks == [0, 0, 0, 4, 4, 4, 7, 7, 7]


def test_it_is_off_where_nothing_can_meet_or_no_one_can_tell():
    one = [box([0.2] * 3, [0.1] * 3)]
    two = [*one, box([0.2, 0.2, 0.32], [0.05] * 3)]
    assert started(one).solver.gaps is None
    assert started(two).solver.gaps is not None
    assert Simulation(bead(), "mpm").solver.gaps is not None
    grows = PASTE | {"expansion": {"kind": "growth", "ratio": 2.0, "time": 1.0}}
    assert started(two, material=grows).solver.gaps is None
    thick = scenario(
        domain={"lower": [0.0] * 3, "upper": [SIDE] * 3, "walls": PERIODIC},
        bodies=two,
        spacing=D,
        material={"density": 1000.0, "viscosity": 1e4},
        numerics={"mpm": {"viscosity": "implicit"}},
    )
    assert Simulation(thick, "mpm").solver.gaps is None


def test_near_a_body_that_ties_nodes_none_is_looked_for():
    """A tip that ends beside the joint hides what is within 1.75 cells of it, one far above and aside nothing."""
    whole = (gaps_of(apart(1.0)[0]) > 0.0).sum()
    found = []
    for start, standoff in (([0.085, 0.2], 0.16), ([0.07, 0.07], 0.3)):
        nozzle = {"diameter": 0.05, "exit_speed": SPEED, "standoff": standoff, "tip": "flat"}
        path = {"kind": "line", "start": start, "end": [start[0] + 0.001, start[1]], "speed": 1e-4}
        sim = apart(1.0, nozzle=nozzle, toolpath=path)[0]
        found.append((gaps_of(sim) > 0.0).sum())
    near, far = found
    assert 0 < near < whole and far == whole


def test_what_a_clamp_holds_is_no_side_of_a_gap():
    """A beam four cells thick, that hangs from it, is whole."""
    beam = box([0.25, 0.2, 0.2], [0.2, 0.06, 0.06])
    sim = started([box([0.1, 0.2, 0.2], [0.1, 0.06, 0.06], clamped=True), beam])
    assert gaps_of(sim, rate=1.0).max() == 0.0
