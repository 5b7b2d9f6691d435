"""Curing and expansion over age, by hand: degrees, levels, parameters, volume ratios, speeds and offspring."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from fluidbench.scenario.cure import Cure
from fluidbench.scenario.expansion import Expansion

E, K, K2 = 1e5, 0.5, 1.5


def cure(kind, **more):
    return Cure(kind=kind, delay=1.0, youngs_modulus=E, **more)


FALL = math.exp(-2.0 * (K + K2))
DEGREES = [
    ("jump", {}, {0.9: 0.0, 1.0: 1.0, 9.0: 1.0}),
    ("stages", {"time": 2.0, "stages": 4}, {0.9: 0.0, 1.0: 0.0, 1.49: 0.0, 1.5: 0.25, 2.6: 0.75, 3.0: 1.0, 9.0: 1.0}),
    ("stages", {"time": 2.0}, {1.5: 0.25, 2.99: 0.75}),
    ("linear", {"time": 4.0}, {0.9: 0.0, 1.0: 0.0, 2.0: 0.25, 4.0: 0.75, 5.0: 1.0, 9.0: 1.0}),
    ("first_order", {"rate": K}, {0.9: 0.0, 3.0: 1 - math.exp(-1.0), 5.0: 1 - math.exp(-2.0)}),
    ("avrami", {"rate": K, "exponent": 3.0}, {0.9: 0.0, 3.0: 1 - math.exp(-1.0), 5.0: 1 - math.exp(-8.0)}),
    ("avrami", {"rate": K}, {5.0: 1 - math.exp(-4.0)}),
    ("kamal_sourour", {"rate": K}, {0.9: 0.0, 3.0: 1 - math.exp(-1.0)}),
    ("kamal_sourour", {"rate": K, "rate_autocatalytic": K2}, {0.9: 0.0, 3.0: (1 - FALL) / (1 + 3.0 * FALL)}),
]


@pytest.mark.parametrize(("kind", "more", "table"), DEGREES)
def test_degree_of_cure_at_an_age(kind, more, table):
    model = cure(kind, **more)
    assert {age: model.degree(age) for age in table} == pytest.approx(table, rel=1e-12, abs=1e-15)


def test_kamal_sourour_solves_its_equation():
    """d alpha / dt = (k + k2 alpha)(1 - alpha), by central differences."""
    model = cure("kamal_sourour", rate=K, rate_autocatalytic=K2)
    for age in (1.2, 2.0, 3.5):
        alpha = model.degree(age)
        slope = (model.degree(age + 1e-5) - model.degree(age - 1e-5)) / 2e-5
        assert slope == pytest.approx((K + K2 * alpha) * (1 - alpha), rel=1e-7)


@pytest.mark.parametrize(("kind", "more", "_"), [row for row in DEGREES if row[0] not in ("jump", "stages")])
@pytest.mark.parametrize("alpha", [0.01, 0.3, 0.5, 0.9, 0.995])
def test_age_at_inverts_the_continuous_laws_exactly(kind, more, _, alpha):
    model = cure(kind, **more)
    assert model.degree(model.age_at(alpha)) == pytest.approx(alpha, rel=1e-12)
    assert model.age_at(0.0) == 0.0 and model.age_at(-0.5) == 0.0
    assert model.age_at(1.0) == (5.0 if kind == "linear" else math.inf)


def test_ages_of_steps():
    assert [cure("jump").age_at(a) for a in (0.0, 0.2, 1.0)] == [0.0, 1.0, 1.0]
    stages = cure("stages", time=2.0, stages=4)
    assert [stages.age_at(a) for a in (0.1, 0.25, 0.26, 0.5, 1.0)] == pytest.approx([1.5, 1.5, 2.0, 2.0, 3.0])


def test_rounding_costs_no_step():
    """1.4 - 1.1 is a little less than 0.3, 3 * 0.1 a little more, and 0.3 / 0.1 a little less than 3."""
    stages = Cure(kind="stages", delay=1.1, time=1.0, stages=10, youngs_modulus=E)
    assert stages.degree(1.4) == 0.3 and stages.age_at(3 * 0.1) == pytest.approx(1.4)
    assert Expansion(kind="spawn", ratio=16.0, passes=4, interval=0.1).volume_ratio(0.3) == pytest.approx(16.0)


def test_a_level_begins_where_it_becomes_the_nearest():
    """Steps begin at their own age; a continuous law is at level k from alpha = (k - 1/2) / 100 on."""
    assert cure("jump").level_ages().tolist() == [1.0]
    assert cure("stages", time=2.0, stages=4).level_ages() == pytest.approx([1.5, 2.0, 2.5, 3.0])
    linear = cure("linear", time=4.0)
    assert linear.levels == 100 and cure("stages", time=2.0, stages=7).levels == 7 and cure("jump").levels == 1
    assert linear.level_ages() == pytest.approx(1.0 + 4.0 * (np.arange(1, 101) - 0.5) / 100)
    slow = cure("first_order", rate=K)
    assert slow.level_ages() == pytest.approx(1.0 - np.log(1 - (np.arange(1, 101) - 0.5) / 100) / K)


def test_parameters_between_fresh_and_cured():
    targets = {"youngs_modulus": 400.0, "viscosity": 0.0, "yield_stress": 50.0, "plastic_viscosity": 8.0}
    fresh = {"youngs_modulus": 100.0, "viscosity": 4.0, "yield_stress": None, "plastic_viscosity": 2.0}
    linear = Cure(**targets)
    assert linear.targets == targets
    expected = {"youngs_modulus": 175.0, "viscosity": 3.0, "yield_stress": 12.5, "plastic_viscosity": 3.5}
    assert linear.parameters(fresh, 0.25) == pytest.approx(expected)
    geometric = Cure(**targets, interpolation="geometric")  # linear where one end is zero
    expected = {"youngs_modulus": 200.0, "viscosity": 2.0, "yield_stress": 25.0, "plastic_viscosity": 4.0}
    assert geometric.parameters(fresh, 0.5) == pytest.approx(expected)
    small = Cure(youngs_modulus=0.25, interpolation="geometric")
    assert small.parameters({"youngs_modulus": 0.01}, 0.5) == pytest.approx({"youngs_modulus": 0.05})
    assert Cure(viscosity=3.0).targets == {"viscosity": 3.0}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "stages"}, "stages needs time"),
        ({"kind": "linear"}, "linear needs time"),
        ({"kind": "first_order"}, "first_order needs rate"),
        ({"kind": "kamal_sourour"}, "kamal_sourour needs rate"),
        ({"kind": "stages", "time": 1.0, "stages": 1}, "greater than or equal to 2"),
        ({"kind": "stages", "time": 1.0, "stages": 101}, "less than or equal to 100"),
        ({"delay": 1.0, "jitter": 1.01}, "exceeds delay"),
        ({"time": 1.0}, "time has no effect"),
        ({"rate": 1.0}, "rate has no effect"),
        ({"kind": "linear", "time": 1.0, "stages": 5}, "stages has no effect"),
        ({"kind": "first_order", "rate": 1.0, "rate_autocatalytic": 1.0}, "rate_autocatalytic has no effect"),
        ({"kind": "kamal_sourour", "rate": 1.0, "exponent": 3.0}, "exponent has no effect"),
        ({"kind": "linear", "time": 0.0}, "greater than 0"),
        ({"delay": -0.1}, "greater than or equal to 0"),
        ({"delay": math.inf}, "finite"),
        ({"youngs_modulus": math.inf}, "finite"),
    ],
)
def test_schedules_that_make_no_sense_are_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        Cure(**{"youngs_modulus": E, **table})


def test_defaults_and_edges_of_a_schedule():
    plain = Cure(youngs_modulus=E)
    assert (plain.kind, plain.delay, plain.jitter, plain.stages, plain.exponent) == ("jump", 0.0, 0.0, 4, 2.0)
    assert plain.rate_autocatalytic == 0.0 and plain.degree(0.0) == 1.0
    assert Cure(youngs_modulus=E, delay=1.0, jitter=1.0).jitter == 1.0
    assert Cure(kind="stages", time=1.0, stages=2, viscosity=0.0).levels == 2
    assert Cure(kind="stages", time=1.0, stages=100, viscosity=1.0).levels == 100


def test_growth_approaches_its_ratio_exponentially():
    model = Expansion(ratio=9.0, delay=1.0, time=2.0)
    expected = {0.0: 1.0, 1.0: 1.0, 3.0: 1 + 8 * (1 - math.exp(-1)), 5.0: 1 + 8 * (1 - math.exp(-2)), 99.0: 9.0}
    assert {age: model.volume_ratio(age) for age in expected} == pytest.approx(expected)


def test_spawning_multiplies_at_each_pass():
    model = Expansion(kind="spawn", ratio=27.0, passes=3, interval=0.5, delay=1.0)
    assert model.per_pass == pytest.approx(3.0)
    expected = {0.99: 1, 1.0: 3, 1.49: 3, 1.5: 9, 1.99: 9, 2.0: 27, 50.0: 27}
    assert {age: model.volume_ratio(age) for age in expected} == pytest.approx(expected)


def test_speeds_of_expansion():
    """Growth is fastest at its onset, R' / 3 = (ratio - 1) / (3 time); spawning makes room in one interval."""
    assert Expansion(ratio=9.0, time=2.0).speed(0.3) == pytest.approx(0.3 * 8.0 / (3 * 2.0))
    spawn = Expansion(kind="spawn", ratio=64.0, passes=2, interval=0.5, impulse=0.7, noise=0.2)
    assert spawn.speed(0.3) == pytest.approx(0.7 + 0.2 + 0.3 * (4.0 - 2.0) / 0.5)


def test_offspring_of_growth():
    """Halved until at most 1.5 spacing^3: 12 / 1.5 is three halvings, a little more is four."""
    assert [Expansion(ratio=r).generations(1.0) for r in (1.0, 1.5, 1.6, 3.0, 12.0, 12.1)] == [0, 0, 1, 1, 3, 4]
    assert Expansion(ratio=6.0).generations(2.0) == 3 and Expansion(ratio=6.0).generations(0.5) == 1
    assert Expansion(ratio=12.0, split=False).generations(1.0) == 0


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"ratio": 0.999}, "would shrink"),
        ({"ratio": math.inf}, "finite"),
        ({"delay": 1.0, "jitter": 1.01}, "exceeds delay"),
        ({"kind": "spawn", "passes": 0}, "greater than or equal to 1"),
        ({"kind": "spawn", "passes": 17}, "less than or equal to 16"),
        ({"kind": "spawn", "time": 2.0}, "time has no effect"),
        ({"kind": "spawn", "split": False}, "split has no effect"),
        *[({key: 2}, f"{key} has no effect") for key in ("passes", "interval", "radius", "impulse", "noise", "margin")],
        ({"time": 0.0}, "greater than 0"),
        ({"kind": "spawn", "interval": 0.0}, "greater than 0"),
    ],
)
def test_expansions_that_make_no_sense_are_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        Expansion(**{"ratio": 2.0, **table})


def test_defaults_and_edges_of_an_expansion():
    plain = Expansion(ratio=1.0)
    assert (plain.kind, plain.delay, plain.jitter, plain.time, plain.split) == ("growth", 0.0, 0.0, 1.0, True)
    assert (plain.passes, plain.interval, plain.radius, plain.impulse, plain.noise) == (1, 0.1, 1.0, 0.0, 0.0)
    assert plain.margin == 0.5 and plain.volume_ratio(5.0) == 1.0
    assert Expansion(kind="spawn", ratio=2.0, delay=1.0, jitter=1.0, passes=16).per_pass == pytest.approx(2 ** (1 / 16))
