"""Schedules of curing and expansion, and the law by which stress carries over."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from fluidbench.errors import UserError
from fluidbench.scenario.cure import Cure
from fluidbench.scenario.expansion import LARGEST, Expansion
from fluidbench.scenario.layout import capacity_of
from fluidbench.scenario.library import validate
from fluidbench.scenario.material import Material
from solvers.constitutive import relieved

KINDS = {
    "jump": {},
    "stages": {"time": 2.0},
    "linear": {"time": 2.0},
    "first_order": {"rate": 0.7},
    "kamal_sourour": {"rate": 0.1, "rate_autocatalytic": 2.0},
    "avrami": {"rate": 0.5, "exponent": 2.5},
}


def cure(kind, **more):
    return Cure(kind=kind, delay=1.0, youngs_modulus=1e5, **KINDS[kind] | more)


@pytest.mark.parametrize("kind", KINDS)
def test_the_degree_of_cure_rises_from_zero_and_age_at_inverts_it(kind):
    c = cure(kind)
    ages = np.linspace(0, 30, 400)
    degrees = np.array([c.degree(float(a)) for a in ages])
    assert degrees[0] == 0 and c.degree(0.999) == 0 and (np.diff(degrees) >= 0).all() and degrees[-1] > 0.9
    for alpha in (0.1, 0.5, 0.75):
        age = c.age_at(alpha)
        assert c.degree(age + 1e-9) >= alpha - 1e-6 and c.degree(age - 1e-6) <= alpha + 1e-6
    levels = c.level_ages()
    assert len(levels) == c.levels and (np.diff(levels) >= 0).all() and levels[0] >= 1.0


def test_levels_interpolate_between_fresh_and_cured():
    m = Material(density=100, youngs_modulus=1e3, viscosity=2.0, cure=cure("linear", viscosity=200.0))
    assert m.levels()[0].youngs_modulus == 1e3 and m.levels()[-1].youngs_modulus == pytest.approx(1e5)
    assert m.at(0.5).viscosity == pytest.approx(101.0)
    g = Material(density=100, viscosity=2.0, cure=Cure(viscosity=200.0, interpolation="geometric"))
    assert g.at(0.5).viscosity == pytest.approx(20.0)


def test_expansion_grows_to_its_ratio_and_counts_its_offspring():
    e = Expansion(ratio=30.0, delay=1.0, time=2.0)
    assert e.volume_ratio(0.5) == 1.0 and e.volume_ratio(3.0) == pytest.approx(1 + 29 * (1 - math.exp(-1)))
    assert 30.0 / 2 ** e.generations(1.0) <= LARGEST < 30.0 / 2 ** (e.generations(1.0) - 1)
    s = Expansion(kind="spawn", ratio=8.0, passes=3, interval=0.1, delay=1.0)
    assert [s.volume_ratio(t) for t in (0.9, 1.0, 1.1, 1.25, 9.0)] == pytest.approx([1, 2, 4, 8, 8])


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"expansion": {"ratio": 0.5}}, "ratio = 0.5 would shrink"),
        ({"expansion": {"ratio": 2, "delay": 2.0}, "cure": {"delay": 1.0, "youngs_modulus": 1e5}}, "comes before"),
        ({"cure": {"delay": 1.0}}, "nothing to cure"),
        ({"cure": {"kind": "avrami", "youngs_modulus": 1e5}}, "needs rate"),
        ({"cure": {"delay": 1.0, "jitter": 2.0, "youngs_modulus": 1e5}}, "exceeds delay"),
        ({"relaxation_time": 0.1, "cure": {"youngs_modulus": 1e5}}, "cannot cure"),
    ],
)
def test_nonsense_is_refused_with_the_reason(table, words):
    with pytest.raises(ValidationError, match=words):
        Material.model_validate({"density": 100, "youngs_modulus": 1e3, **table})


def test_a_liquid_that_cures_to_a_solid_must_say_its_bulk_modulus():
    with pytest.raises(ValidationError, match="needs bulk_modulus or sound_speed"):
        Material(density=100, viscosity=1.0, cure=cure("jump"))
    Material(density=100, viscosity=1.0, sound_speed=10.0, cure=cure("jump"))


def ball(**more):
    return validate(
        {
            "name": "ball",
            "domain": {"lower": [-1, -1, -1], "upper": [1, 1, 1]},
            "duration": 1.0,
            "spacing": 0.01,
            "bodies": [{"kind": "box", "center": [0, 0, 0], "size": [0.1, 0.1, 0.1]}],
            "material": {"density": 100, "youngs_modulus": 1e3, "expansion": {"ratio": 10.0}},
            **more,
        },
        "ball",
    )


def test_a_pool_too_small_for_the_offspring_is_refused_before_the_run():
    assert capacity_of(ball()) == 8000
    assert capacity_of(ball(pool=9000)) == 9000
    with pytest.raises(UserError, match="pool = 5000 is too small: ball will hold up to 8000"):
        capacity_of(ball(pool=5000))


tensors = st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6)


@given(tensors, st.floats(0.01, 1.0))
def test_relieved_tensors_keep_stress_and_volume(values, ratio):
    """dev(b') = ratio dev(b) and det b' = 1."""
    a = np.array(
        [[values[0], values[3], values[4]], [values[3], values[1], values[5]], [values[4], values[5], values[2]]]
    )
    b = np.eye(3) + a
    b /= np.cbrt(np.linalg.det(b))
    out = relieved(b[0, 0], b[1, 1], b[2, 2], b[0, 1], b[0, 2], b[1, 2], ratio)
    c = np.array([[out[0], out[3], out[4]], [out[3], out[1], out[5]], [out[4], out[5], out[2]]])
    assert np.linalg.det(c) == pytest.approx(1.0, abs=1e-6)
    deviator = lambda m: m - np.trace(m) / 3 * np.eye(3)  # noqa: E731
    assert deviator(c) == pytest.approx(ratio * deviator(b), abs=1e-9)
