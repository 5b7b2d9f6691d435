"""Two particles and their bond by hand: how it pulls, yields, and keeps its force when it hardens."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.crew import Crew
from fluidbench.native.scene import Scene
from solvers.pbd import bonds
from solvers.pbd.laws import bond_stiffness

from ..conftest import scenario

launch = Crew(wp.get_device("cpu")).launch

E, E2, D, MASS = 1e4, 4e4, 0.01, 1e-3
SOLID = {"density": 1000.0, "youngs_modulus": E, "poisson_ratio": 0.25}


class Pair:
    """Particles 0 and 1 on the x axis, so far apart, with a bond of rest length 10 mm."""

    def __init__(self, length, material=None, phases=(0, 0), held=(FREE, FREE), rest=D):
        self.scene = Scene(scenario(material=material or SOLID))
        self.box, self.table = self.scene.box, self.scene.phases
        self.count, self.dt = wp.array([2], dtype=int), wp.array([1e-3], dtype=float)
        self.phase = wp.array(phases, dtype=int)
        self.held = wp.array([int(h) for h in held], dtype=int)
        x = np.array([[0.05, 0.05, 0.05], [0.05 + length, 0.05, 0.05]], np.float32)
        self.position, self.mass = wp.array(x, dtype=wp.vec3), wp.array([MASS, MASS], dtype=float)
        self.bonds = bonds.Bonds()
        self.bonds.number = wp.array([1, 1], dtype=int)
        self.bonds.partner = wp.array([1, 0], dtype=int)
        self.bonds.rest = wp.array([rest, rest], dtype=float)
        self.bonds.multiplier = wp.zeros(2, dtype=float)
        self.bonds.state = wp.array([2, 2], dtype=int)

    def rest(self):
        return self.bonds.rest.numpy().tolist()

    def harden(self, *due):
        launch(
            bonds.relieve,
            2,
            [2, self.count, self.box, self.table, self.phase, wp.array(due, dtype=int), self.position, self.bonds],
        )
        return self.rest()

    def flow(self):
        launch(bonds.yield_bonds, 2, [2, self.count, self.box, self.table, self.phase, self.position, self.bonds])
        return self.rest()

    def stretch(self, sweep=0):
        correction = wp.zeros(2, dtype=wp.vec3)
        launch(
            bonds.stretch,
            2,
            [
                1,
                self.box,
                D,
                sweep,
                2,
                self.count,
                self.dt,
                self.table,
                self.phase,
                self.held,
                self.position,
                self.mass,
                self.bonds,
            ],
            [correction],
        )
        return correction.numpy()


SETTING = SOLID | {"cure": {"youngs_modulus": E2}}


@pytest.mark.parametrize("length", [0.012, 0.009])
def test_a_bond_that_hardens_keeps_its_force(length):
    """Four times as stiff, a quarter of the strain; where one end hardens, 2.5 times."""
    for due, factor in (((1, 1), 4.0), ((1, 0), 2.5), ((0, 1), 2.5), ((0, 0), 1.0)):
        kept = Pair(length, SETTING).harden(*due)
        assert kept == pytest.approx([length - (length - D) / factor] * 2, rel=1e-5)
    soft = Pair(length, SETTING, phases=(1, 1)).harden(0, 0)
    assert soft == pytest.approx([length - 4.0 * (length - D)] * 2, rel=1e-5)


def test_a_bond_yields_at_the_strain_of_uniaxial_stress():
    """sqrt(3) tau / E = 1.732 %; of a bond between two materials both are means."""
    paste = SOLID | {"yield_stress": 100.0}
    limit = math.sqrt(3.0) * 100.0 / E
    for length, rest in ((0.012, 0.012 / (1 + limit)), (0.008, 0.008 / (1 - limit)), (0.0101, D), (0.0099, D)):
        assert Pair(length, paste).flow() == pytest.approx([rest] * 2, rel=1e-5)
    mixed = paste | {"cure": {"youngs_modulus": E2, "yield_stress": 300.0}}
    limit = math.sqrt(3.0) * 200.0 / 2.5e4
    assert Pair(0.012, mixed, phases=(0, 1)).flow() == pytest.approx([0.012 / (1 + limit)] * 2, rel=1e-5)
    weak = paste | {"youngs_modulus": 100.0, "yield_stress": 80.0}  # a bond is never drawn out beyond tenfold
    assert Pair(0.0009, weak).flow() == pytest.approx([0.009] * 2, rel=1e-4)


def test_a_bond_pulls_by_a_damped_step_of_xpbd():
    """lambda += -0.115 (C + alpha lambda) / (2 / m + alpha), alpha = 1 / (k dt^2); either end moves by lambda / m."""
    compliance = 1.0 / (bond_stiffness(E, D, D) * 1e-6)
    pair = Pair(0.012)
    first = -0.115 * 0.002 / (2 / MASS + compliance)
    assert pair.stretch()[:, 0] == pytest.approx([-first / MASS, first / MASS], rel=1e-4)
    assert pair.bonds.multiplier.numpy() == pytest.approx([first] * 2, rel=1e-4)
    second = -0.115 * (0.002 + compliance * first) / (2 / MASS + compliance)
    assert pair.stretch(1)[:, 0] == pytest.approx([-second / MASS, second / MASS], rel=1e-4)
    assert pair.bonds.multiplier.numpy() == pytest.approx([first + second] * 2, rel=1e-4)
    assert pair.stretch(0)[:, 0] == pytest.approx([-first / MASS, first / MASS], rel=1e-4)  # a substep begins anew
    for held in (CLAMPED, CARRIED):
        alone = -0.115 * 0.002 / (1 / MASS + compliance)
        assert Pair(0.012, held=(FREE, held)).stretch()[:, 0] == pytest.approx([-alone / MASS, 0.0], rel=1e-4)


def test_the_stiffness_of_a_bond_by_its_length():
    """k (1, 1/2, 3/16) at d (1, sqrt 2, sqrt 3), with E = 15 k / (8 d); linear in between."""
    k = 8.0 / 15.0 * E * D
    shares = {
        0.9: 1.0,
        1.0: 1.0,
        math.sqrt(2.0): 0.5,
        math.sqrt(3.0): 0.1875,
        0.5 * (1 + math.sqrt(2.0)): 0.75,
        0.5 * (math.sqrt(2.0) + math.sqrt(3.0)): 0.34375,
        1.9: 0.05,
    }
    for ratio, share in shares.items():
        assert bond_stiffness(E, D, ratio * D) == pytest.approx(share * k, rel=1e-5)
