"""How far neighbour lists reach beyond what they must hold."""

import math

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from solvers.neighbours import THINNEST
from solvers.search import RENEWAL, best_skin

from ..conftest import PERIODIC, scenario

SPACING = 0.01


def drifting(method, step, substeps):
    """The solver of a periodic lattice that has moved by `step` [m] in each of so many substeps."""
    lattice = scenario(
        domain={"lower": [0.0] * 3, "upper": [0.08] * 3, "walls": PERIODIC},
        bodies=[{"kind": "box", "center": [0.04] * 3, "size": [0.08] * 3}],
        gravity=[0, 0, 0],
        spacing=SPACING,
    )
    sim, dt = Simulation(lattice, method, Target()), 1e-5
    sim.prepare()
    sim.begin()
    sim.kick(np.full((sim.pool.counts[0], 3), [step / dt, 0.0, 0.0]))
    sim.march(dt, substeps)
    return sim.solver


def cost(skin, radius, step):
    return (1.0 + skin / radius) ** 3 + float(RENEWAL) * 2.0 * step / skin


@pytest.mark.parametrize("share", [0.001, 0.01])
def test_the_best_skin_costs_least(share):
    radius, step = 1.0, share
    held = 0.5 * 0.1 / step
    best = best_skin(0.1, held, radius)
    assert best == pytest.approx(math.sqrt(float(RENEWAL) * radius * 0.1 / (3.0 * held)))
    least = min(cost(skin, radius, step) for skin in np.geomspace(0.01, 1.0, 1000))
    assert cost(best, radius, step) < 1.01 * least


@pytest.mark.parametrize("method", ["sph", "pbd"])
@pytest.mark.parametrize("share", [0.002, 0.006])
def test_what_moves_steadily_has_lists_as_wide_as_costs_least(method, share):
    """Steps over the support. The skin that a step asks for does not depend on the one before."""
    neighbours = drifting(method, 0.0, 1).neighbours
    radius = neighbours.radius
    skin = float(drifting(method, share * radius, 300).neighbours.skin.numpy()[0, 0])
    assert skin == pytest.approx(math.sqrt(2.0 * float(RENEWAL) * share / 3.0) * radius, rel=0.15)
    assert neighbours.thinnest < skin < neighbours.widest


@pytest.mark.parametrize("method", ["sph", "pbd"])
def test_what_rests_has_the_thinnest_lists_and_what_rushes_the_widest(method):
    still, fast = drifting(method, 0.0, 400).neighbours, drifting(method, 0.3 * SPACING, 30).neighbours
    assert still.skin.numpy()[0, 0] == pytest.approx(THINNEST * still.radius)
    assert fast.skin.numpy()[0, 0] == pytest.approx(fast.widest)
    assert still.number.numpy().sum() < 0.9 * fast.number.numpy().sum()
