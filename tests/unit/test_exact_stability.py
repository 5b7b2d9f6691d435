"""Theory by hand, blocks and lumps as they are described, limits as they are bracketed, and what is said of them."""

import math

import numpy as np
import pytest

from fluidbench.measure.reference import table
from fluidbench.method.target import Target
from fluidbench.method.vitals import Vital
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.library import load
from fluidbench.study import limits
from fluidbench.study.limits import Limit, bisect, block, default_dt, lump
from fluidbench.study.points import BLOCKS
from solvers.lattice import drag_rate

from ..conftest import bead, scenario

WATER = {"density": 1000.0, "sound_speed": 10.0}


def damped(wave, viscous):
    """The dt at which (dt / wave)^2 + dt / viscous = 1, by bisection."""
    low, high = 0.0, wave
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (middle / wave) ** 2 + middle / viscous < 1 else (low, middle)
    return low


def test_theory_of_mpm_is_the_fourier_analysis_in_bulk():
    """Bulk waves 1.27 .. 1.31 and damping 0.26 .. 0.42 dx^2 / nu, say the tables; whatever share the method takes."""
    rows = table("mpm_stability_limits")
    bulk = rows[(rows["arrangement"] == "3d bulk 8 per cell regular") & (rows["gradient"] == "mls")].set_index(
        "material"
    )
    wave, damp = ((bulk.loc[m, "min"] + bulk.loc[m, "max"]) / 2 for m in ("fluid", "viscous"))
    assert wave == pytest.approx(1.29)
    solver, still = get_method("mpm"), block(WATER, 0.01)  # cells of 2 d = 0.02 divide 0.08
    for safety in (0.8, 0.4):
        got = get_method("mpm").theory(still, solver.Config(safety=safety))
        assert got == pytest.approx(wave * 0.02 / 10.0, rel=2e-3)  # an isolated particle's 1/sqrt(3) to three digits
    thick = block({**WATER, "sound_speed": 0.05, "viscosity": 100.0}, 0.01)
    got = get_method("mpm").theory(thick, solver.Config())
    assert got == pytest.approx(damped(wave * 0.02 / 0.05, damp * 0.02**2 / 0.1), rel=5e-3)


def test_theory_of_sph_is_the_fourier_analysis_at_its_smoothing_length():
    """Between h / dx = 1.5 and 2 C_h goes from 1.729 to 1.725, at 1.3 it is 1.753. Drag damps 2 / dt at its limit."""
    solver, still = get_method("sph"), block(WATER, 0.01)
    config = solver.Config(**get_method("sph").bare)
    h = 0.018
    wave = (1.729 + 0.6 * (1.725 - 1.729)) * h / 10.0
    assert get_method("sph").theory(still, config) == pytest.approx(wave, rel=1e-9)
    thick = block({**WATER, "sound_speed": 0.05, "viscosity": 100.0}, 0.01)
    slow, damp = wave * 10.0 / 0.05, 2.0 / drag_rate((0, 0, 0), 3.6, 0.25) * 0.01**2 / 0.1
    for settings in ({}, {"cfl": 0.2, "viscous_number": 0.05}):
        got = get_method("sph").theory(thick, solver.Config(**get_method("sph").bare, **settings))
        assert got == pytest.approx(damped(slow, damp), rel=1e-9)
    solid = block({"density": 1000.0, "youngs_modulus": 1e5}, 0.01)
    c = solid.wave_speed
    assert get_method("sph").theory(solid, config) == pytest.approx(1.753 * 0.013 / c)
    assert get_method("pbd").theory(still, get_method("pbd").Config()) is None


def test_bare_is_without_what_theory_does_not_know():
    assert {name: get_method(name).bare for name in ("mpm", "sph", "pbd")} == {
        "mpm": {"viscosity": "explicit"},
        "pbd": {},
        "sph": dict.fromkeys(
            (
                "density_diffusion",
                "density_feedback",
                "artificial_viscosity",
                "artificial_viscosity_solid",
                "hourglass",
                "shifting",
            ),
            0.0,
        )
        | {"viscosity": "explicit"},
    }
    assert BLOCKS["acoustic"] == {"density": 1000.0, "sound_speed": 10.0}


@pytest.mark.parametrize("limit", [0.9, 1.3, 2.2, 5.0, 0.4, 0.13])
@pytest.mark.parametrize("precision", [0.5, 0.05])
def test_bisection_brackets_by_half_steps_and_stops_at_the_precision(limit, precision):
    tried = []

    def survives(dt):
        tried.append(dt)
        return dt <= limit

    found = bisect(survives, 1.0, precision, 100.0)
    assert found.stable <= limit < found.unstable <= (1 + precision) * found.stable
    assert found.dt == pytest.approx(math.sqrt(found.stable * found.unstable))
    bracket = next(i for i in range(1, len(tried)) if (tried[i] <= limit) != (tried[i - 1] <= limit))
    assert tried[: bracket + 1] == pytest.approx([1.5 ** (i if limit >= 1.0 else -i) for i in range(bracket + 1)])
    if precision == 0.5:
        assert len(tried) == bracket + 1  # a factor of 1.5 is precise enough


def test_bisection_looks_no_further_than_its_reach():
    tried = []
    assert bisect(lambda dt: tried.append(dt) or True, 2.0, 0.1, 2.25) == Limit(4.5, math.inf)
    assert tried == pytest.approx([2.0, 3.0, 4.5])
    tried.clear()
    found = bisect(lambda dt: bool(tried.append(dt)), 2.0, 0.1, 2.25)
    assert found.stable == 0.0 and found.unstable == pytest.approx(2.0 / 2.25) == tried[-1] and len(tried) == 3
    assert Limit(4.0, math.inf).dt == 4.0 and Limit(4.0, 9.0).dt == 6.0


def test_a_block_is_periodic_at_rest_without_gravity():
    made = block(WATER, 0.01)
    assert made.domain.upper == (0.08,) * 3 and made.domain.lower == (0.0,) * 3 and made.gravity == (0.0, 0.0, 0.0)
    assert set(made.domain.walls.faces()) == {"periodic"} and made.spacing == 0.01
    (body,) = made.bodies
    assert body.center == pytest.approx((0.04,) * 3) and body.size == pytest.approx((0.08,) * 3)
    assert body.top_speed == 0.0
    assert made.is_tensile and Simulation(made, "sph").scene.tensile  # the kernels, too, are of what holds together


def test_a_lump_carries_the_tension_of_what_is_fed():
    honey = load("honey_line", {"material.viscosity": 1e4})
    thrown = limits.lump(honey, 1e-3)
    assert honey.is_tensile and thrown.is_tensile and not load("dam_break").is_tensile
    assert thrown.tension(thrown.material) == honey.tension(honey.material) == honey.viscous_tension > 0.0


def test_a_lump_is_thrown_at_its_floor():
    """Six spacings of the bead's paste in a room of eighteen, a quarter of one above the floor."""
    s = bead(
        domain={"lower": [-0.02, -0.02, -0.01], "upper": [0.05, 0.02, 0.025]},
        nozzle={"diameter": 0.012, "exit_speed": 0.1, "standoff": 0.010},
    )
    made, v, d = lump(s, 1e-4), s.reference_speed, s.spacing
    (body,) = made.bodies
    assert body.center == pytest.approx((9 * d, 9 * d, -0.01 + 3.25 * d)) and body.size == pytest.approx((6 * d,) * 3)
    assert body.velocity == pytest.approx((0.3 * v, 0.0, -v))
    assert made.domain.lower == (0.0, 0.0, -0.01) and made.domain.upper == pytest.approx(
        (18 * d, 18 * d, -0.01 + 18 * d)
    )
    assert made.duration == pytest.approx(0.04) and made.tick == pytest.approx(4e-4)
    assert (made.nozzle, made.toolpath, made.reference, made.output_interval) == (None,) * 4
    assert made.gravity == s.gravity and made.material == s.material
    water = scenario()
    assert lump(water, 1e-4).material.sound_speed == water.liquid_sound_speed
    assert lump(scenario(material={"density": 1.0, "bulk_modulus": 7.0}), 1e-4).material.sound_speed is None
    assert lump(scenario(material=WATER), 1e-4).material.sound_speed == 10.0


def test_the_methods_own_step_allows_a_quarter_more_speed():
    solver, s = get_method("pbd"), scenario()
    dt, name = default_dt(s, solver, solver.Config())
    assert name == "accuracy" and dt == pytest.approx(0.125 * 0.01 / (1.25 * s.reference_speed))
    assert (limits.GROWTH, limits.STEPS, limits.LOOKS, limits.LUMP_STEPS, limits.AMPLITUDE) == (
        100.0,
        500,
        4,
        400,
        1e-4,
    )


@pytest.fixture
def played(monkeypatch):
    """A simulation whose kinetic energy and troubles are written down; `march` counts its substeps."""

    def make(energies, broken=(), complaint=None, shortage=None):
        marched = []

        class Played:
            capacity = 3

            def __init__(self, s, config, target):
                self.looks = 0

            def kick(self, v):
                make.kick = v

            def march(self, dt, steps):
                marched.append((dt, steps))

            def look(self):
                self.looks += 1
                said = [what and what(self.looks) for what in (complaint, shortage)]
                found = "it broke" if len(marched) in broken else None
                return Vital(1.0, energies(self.looks - 1), 0.0, *said, broken=found)

        monkeypatch.setattr(get_method("mpm"), "start", Played)
        return marched

    return make


def test_a_block_is_stable_while_its_energy_grows_less_than_a_hundredfold(played, monkeypatch):
    answers = []

    def once(survives, guess, precision, reach):
        answers.append((survives(0.5), guess, precision, reach))
        return Limit(1.0, 2.0)

    monkeypatch.setattr(limits, "bisect", once)

    def stable(energies, broken=()):
        marched = played(energies, broken)
        limits.block_limit(block(WATER, 0.01), get_method("mpm"), None, 0.25, 0.1, Target())
        return answers[-1][0], marched

    calm, marched = stable(lambda i: 1.0 + (i > 0) * 98.9)
    assert calm and marched == [(0.5, 4)] * 125
    assert answers[-1][1:] == (0.25, 0.1, 32.0)
    kick = played.kick
    assert kick.shape == (3, 3) and 0.3e-3 < np.abs(kick).max() <= 1e-3 and kick.min() < 0 < kick.max()
    assert not stable(lambda i: 1.0 + 99.0 * (i == 7))[0] and not stable(lambda i: math.nan if i else 1.0)[0]
    assert not stable(lambda i: 1.0, broken={5})[0]


def test_a_lump_survives_while_nothing_is_wrong(played):
    s, solver = scenario(), get_method("mpm")
    marched = played(lambda i: 1.0)
    assert limits.lump_survives(s, solver, None, 1e-3, Target()) is None and marched == [(1e-3, 4)] * 100
    marched = played(lambda i: 1.0, complaint=lambda n: "too fast" if n == 3 else None)
    assert limits.lump_survives(s, solver, None, 1e-3, Target()) == "too fast" and len(marched) == 3
    played(lambda i: 1.0, shortage=lambda n: "full" if n == 3 else None)
    assert limits.lump_survives(s, solver, None, 1e-3, Target()) == "full"
