"""The loop over pairs against sums taken one pair at a time, in float64: lists, images, weights."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.scene import PERIODIC
from fluidbench.native.simulation import Simulation
from solvers.images import INDEX_BITS
from solvers.smoothing import cusp

from ..conftest import scenario

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
WALLS = {
    "closed": dict.fromkeys(("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper"), "slip"),
    "round": dict.fromkeys(("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper"), "periodic"),
    "mixed": {
        "x_lower": "periodic",
        "x_upper": "periodic",
        "y_lower": "stick",
        "y_upper": {"friction": 0.3},
        "z_lower": "slip",
        "z_upper": "slip",
    },
}


def cloud(walls, number, device, worlds=1):
    """PBD on points thrown into a small box, whatever the density: in no order of cells, some alone, some on walls."""
    rng = np.random.default_rng(number)
    points = rng.uniform(0.0021, 0.0979, (number, 3))
    points[: number // 3] = 0.03 + 0.3 * (points[: number // 3] - 0.03)  # a crowd in a corner
    made = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.1, 0.1, 0.1], "walls": WALLS[walls]},
        bodies=[{"kind": "points", "positions": points}],
        gravity=[0, 0, 0],
        spacing=0.01,
        pool=number + 70,
    )
    sim = Simulation([made] * worlds, "pbd", Target(device), graphs=False)
    sim.prepare()
    sim.begin()
    sim.scene.set_dt(1e-9)
    sim.solver.predict()
    sim.solver.lists()
    return sim


def images(sim, x):
    """(code, where each point is as that image) for all 27 codes."""
    box = sim.scene.box
    for code in range(27):
        out = x.copy()
        for axis in range(3):
            low, high, which = box.lower[axis], box.upper[axis], code // 3**axis % 3
            if which and box.lower_kind[axis] == PERIODIC:
                out[:, axis] += (high - low) * (-1 if which == 1 else 1)
            elif which:
                out[:, axis] = 2.0 * (low if which == 1 else high) - x[:, axis]
        yield code, out


def near(sim, reach):
    """For each particle its entries within reach, itself left out, and their distances."""
    pool = sim.pool
    position = pool.position.numpy().astype(float)
    found = {}
    for world, count in enumerate(pool.counts):
        first = world * pool.capacity
        x = position[first : first + count]
        for i in range(count):
            found[first + i] = {}
        for code, image in images(sim, x):
            distance = np.linalg.norm(x[:, None] - image[None], axis=2)
            for i, j in zip(*np.nonzero(distance < reach), strict=True):
                if code or i != j:
                    found[first + i][first + j + (code << INDEX_BITS)] = distance[i, j]
    return found


def listed(sim):
    """What the lists hold for each particle."""
    neighbours, pool = sim.solver.neighbours, sim.pool
    lists, entries, number = neighbours.lists, neighbours.entries.numpy(), neighbours.number.numpy()
    inside = neighbours.inside.numpy()
    found = {}
    for world, count in enumerate(pool.counts):
        for i in range(world * pool.capacity, world * pool.capacity + count):
            g = i // lists.group
            k = np.arange(number[g])
            own = entries[g * lists.row + k // lists.threads * lists.column + k % lists.threads]
            assert (own[: inside[g]] < 1 << INDEX_BITS).all() and (own[inside[g] :] >= 1 << INDEX_BITS).all()
            assert len(set(own.tolist())) == len(own), "an entry stands twice"
            found[i] = set(own.tolist())
    return found


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("walls", "number", "worlds"), [("closed", 130, 1), ("round", 61, 2), ("mixed", 100, 2)])
def test_lists_hold_all_that_is_in_reach_and_sums_are_theirs(walls, number, worlds, device):
    sim = cloud(walls, number, device, worlds)
    solver = sim.solver
    reach = solver.neighbours.radius + float(solver.neighbours.skin.numpy()[0, 0])
    support, volume = solver.num.support, sim.scene.spacing**3
    expected, held = near(sim, (1.0 - 1e-6) * reach), listed(sim)
    assert not [i for i in expected if not expected[i].keys() <= held[i]]
    widest = near(sim, (1.0 + 1e-6) * reach)
    group = solver.neighbours.group
    for i in held:  # no more than what those that share the list have in reach, and they themselves
        first = i // group * group
        shared = [m for m in range(first, first + group) if m in widest]
        assert held[i] <= set().union(shared, *(widest[m] for m in shared))
    solver.multipliers()
    solver.backend.wait()
    fill = solver.fill.numpy()
    for i, partners in expected.items():
        total = volume * (cusp(0.0, support) + sum(cusp(r, support) for r in partners.values()))
        assert fill[i] == pytest.approx(solver.num.weight * total, rel=1e-5)


@pytest.mark.parametrize("device", DEVICES)
def test_lists_are_the_same_however_often_they_are_made(device):
    sim = cloud("mixed", 100, device)
    neighbours = sim.solver.neighbours
    before = [neighbours.number.numpy(), listed(sim)]
    first = neighbours.entries.numpy().copy()
    neighbours.refresh()
    sim.solver.lists()
    assert listed(sim) == before[1] and np.array_equal(neighbours.number.numpy(), before[0])
    assert np.array_equal(first, neighbours.entries.numpy())
