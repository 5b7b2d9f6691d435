"""Every rule of the judged table on hand-made evidence, at its thresholds and a little beyond them."""

import math

import pytest

from fluidbench.paper.definitions import (
    APART,
    COLLAPSE,
    CONFIRMED,
    COST_CASES,
    EFFECT,
    FEWEST,
    GOOD,
    OPEN,
    POOR,
    REFUTED,
    RULES,
)
from fluidbench.paper.verdicts import (
    agreed,
    answers_of,
    at_equal_cost,
    at_equal_error,
    equal_error,
    high,
    in_real_time,
    pace,
    placed,
    ranked,
    seconds,
    sensitivity,
    share_is,
    told,
    winners,
    within,
)

from .made import case, change, finished, trial

LIQUID, SOLID = case("a", "liquid", 0.1), case("b", "elastic", 0.2)


def test_the_thresholds_are_those_that_the_rules_say():
    assert (EFFECT, GOOD, POOR, FEWEST, APART, COLLAPSE) == (1.2, 0.75, 0.5, 2, 0.1, 10.0)
    assert "at least 75% of the known answers" in RULES["fidelity"] and "at most 50%" in RULES["fidelity"]
    assert "a class needs 2 of them" in RULES["fidelity"] and "factor of 1.2 and two standard" in RULES["step"]
    assert "a factor of 1.2 apart, on most of at least 2 cases" in RULES["equal error"]
    assert "10-fold" in RULES["collapse"] and "1.2 times as far off" in RULES["artifacts"]
    assert "over 10% off in most places" in RULES["prediction"] and "most of at least 2" in RULES["prediction"]


def test_an_error_of_just_the_tolerance_is_within_it():
    for error, good in ((0.1, 1), (0.1000001, 0), (math.nan, 0)):
        assert within([trial(LIQUID, "mpm", error)]) == (good, 1)


def test_answers_are_of_the_method_the_class_and_the_spacing_asked_for():
    rows = [
        trial(LIQUID, "mpm"),
        trial(LIQUID, "sph"),
        trial(SOLID, "mpm"),
        trial(LIQUID, "mpm", level="quick"),
        trial(LIQUID, "mpm", level="medium"),
        trial(LIQUID, "mpm", level="rough"),
        trial(LIQUID, "mpm", level="fine"),
        trial(LIQUID, "mpm", verdict="skipped"),
        trial(LIQUID, "mpm", verdict="diverged"),
        trial(LIQUID, "mpm", verdict="timeout"),
    ]
    assert answers_of(rows, ["mpm"], ["liquid"]) == [rows[i] for i in (0, 3, 8, 9)]
    assert answers_of(rows, ["mpm", "sph"], ["liquid", "elastic"]) == [rows[i] for i in (0, 1, 2, 3, 8, 9)]
    assert within(answers_of(rows, ["mpm"], ["liquid"])) == (2, 3)
    assert told(rows[:7]) and told([rows[8]]) and not told([rows[0], rows[9]])


@pytest.mark.parametrize(
    ("first", "second", "clear"),
    [
        ([10.0], [12.0], False),
        ([10.0], [12.001], True),
        ([10.0], [11.9], False),
        ([10.0, 10.0], [11.0, 11.0], False),
        ([0.01], [0.02], True),
        ([8.0, 12.0], [15.8, 19.8], False),  # deviations of sqrt(8): twice hypot is 8, the means are 7.8 apart
        ([8.0, 12.0], [16.2, 20.2], True),
        ([10.0], [15.5, 19.5], True),  # one alone has no spread: twice sqrt(8) is 5.66, and 7.5 is more
        ([10.0], [13.5, 17.5], False),
        ([13.5, 17.5], [22.0], True),
        ([14.5, 18.5], [22.0], False),
    ],
)
def test_a_figure_is_clearly_above_by_a_factor_and_beyond_the_spread(first, second, clear):
    places = ranked({"a": first, "b": second})
    assert places == ({"a": (0, 1), "b": (1, 0)} if clear else {"a": (0, 0), "b": (0, 0)})


def test_places_count_who_is_clearly_below_and_above():
    assert ranked({"x": [4.0], "y": [1.0], "z": [2.0]}) == {"x": (2, 0), "y": (0, 2), "z": (1, 1)}
    assert ranked({"x": [1.0], "y": [1.1], "z": [2.0]}) == {"x": (0, 1), "y": (0, 1), "z": (2, 0)}


@pytest.mark.parametrize(
    ("word", "right"),
    [
        ("lowest", {(0, 2)}),
        ("highest", {(2, 0)}),
        ("middle", {(1, 1)}),
        ("upper", {(1, 0), (1, 1), (2, 0)}),
    ],
)
def test_words_of_places(word, right):
    every = {(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (2, 0)}
    assert {place for place in every if placed(place, word) == CONFIRMED} == right
    assert {place for place in every if placed(place, word) == REFUTED} == every - right


def test_a_verdict_needs_every_resolution():
    assert agreed([REFUTED]) == REFUTED and agreed([CONFIRMED] * 3) == CONFIRMED
    assert agreed([CONFIRMED, CONFIRMED, REFUTED]) == OPEN and agreed([OPEN, OPEN]) == OPEN


def laws(of, **methods):
    """Trials of methods with (error, wall) at two spacings or more."""
    return [
        trial(of, m, e, wall=w, spacing=of.spacing / (1 + i))
        for m, rows in methods.items()
        for i, (e, w) in enumerate(rows)
    ]


def test_cost_at_the_error_that_the_worst_reaches():
    """Cost ~ error^-2 twice, and error^-1: at 0.1, the worst one's best, 16, 3 (0.2 / 0.1)^2 = 12 and 5 (0.3 / 0.1)."""
    found = at_equal_error(
        laws(LIQUID, mpm=[(0.4, 1.0), (0.1, 16.0)], sph=[(0.2, 3.0), (0.05, 48.0)], pbd=[(0.3, 5.0), (0.05, 30.0)])
    )
    assert found == pytest.approx({"mpm": 16.0, "sph": 12.0, "pbd": 15.0})


def test_a_power_law_is_a_least_squares_line():
    """Logarithms (0, 0), (-1, 2), (-2, 1): slope -1/2 through (-1, 1); at -2 that is 1.5."""
    rows = [(1.0, 1.0), (math.exp(-1), math.exp(2)), (math.exp(-2), math.e)]
    found = at_equal_error(laws(LIQUID, mpm=rows, sph=[(1.0, 1.0), (math.exp(-2), 7.0)]))
    assert found == pytest.approx({"mpm": math.exp(1.5), "sph": 7.0})


def test_where_the_error_does_not_fall_the_cheapest_within_it_counts():
    rising = [(0.3, 1.0), (0.4, 2.0), (0.35, 1.5)]  # its best is the target, and its cost there 1
    assert at_equal_error(laws(LIQUID, mpm=rising, sph=[(0.6, 4.0), (0.3, 8.0)])) == pytest.approx(
        {"mpm": 1.0, "sph": 8.0}
    )
    odd = [(0.1, 3.0), (0.2, 2.0), (0.15, 1.9), (0.7, 40.0)]  # within 0.3 the cheapest costs 1.9
    assert at_equal_error(laws(LIQUID, mpm=odd, sph=[(0.6, 4.0), (0.3, 8.0)]))["mpm"] == pytest.approx(1.9)


def test_equal_error_needs_two_methods_of_two_errors_that_are_not_nothing():
    two = [(0.4, 1.0), (0.1, 16.0)]
    assert at_equal_error(laws(LIQUID, mpm=two)) == {} and at_equal_error([]) == {}
    assert at_equal_error(laws(LIQUID, mpm=two, sph=[(0.2, 3.0)])) == {}
    assert at_equal_error(laws(LIQUID, mpm=two, sph=[(0.2, 3.0), (0.0, 9.0)])) == {}
    skipped = [*laws(LIQUID, mpm=two, sph=two), trial(LIQUID, "pbd", verdict="skipped")]
    assert set(at_equal_error(skipped)) == {"mpm", "sph"}
    assert at_equal_error([*skipped, trial(LIQUID, "pbd", verdict="refused")]) == {}


def at_equal(factors):
    """Trials of the cost cases: the same errors, at costs that differ by these factors."""
    made = []
    for name, by_method in zip(COST_CASES, factors, strict=False):
        rows = {m: [(0.4, f), (0.1, 16.0 * f)] for m, f in by_method.items()}
        made += laws(case(name, "liquid"), **rows)
    return made


def both(*factors):
    return {name: pytest.approx(x) for name, x in zip(COST_CASES, factors, strict=False)}


def test_a_place_at_equal_error_is_that_on_most_cases():
    up, down = {"mpm": 1.0, "sph": 5.0, "pbd": 2.0}, {"mpm": 5.0, "sph": 1.0, "pbd": 2.0}
    assert equal_error(at_equal([up, up]), "sph", "highest") == (CONFIRMED, both(5, 5))
    assert equal_error(at_equal([up, down]), "sph", "highest") == (REFUTED, both(5, 1))
    assert equal_error(at_equal([up, down, up]), "sph", "highest")[0] == CONFIRMED
    assert equal_error(at_equal([down, down, up]), "sph", "highest")[0] == REFUTED
    assert equal_error(at_equal([up]), "sph", "highest") == (OPEN, both(5))
    assert equal_error(at_equal([up, {"mpm": 1.0, "sph": 5.0}]), "sph", "highest") == (OPEN, both(5))
    close = {"mpm": 1.0, "sph": 2.3, "pbd": 2.0}
    assert equal_error(at_equal([close, close]), "sph", "highest")[0] == REFUTED
    assert set(COST_CASES) >= {"dam_break", "elliptic_drop", "bead_area"}


def test_the_winner_is_the_cheapest_of_those_within_tolerance():
    other = case("c", "liquid", 0.1)
    rows = [
        trial(LIQUID, "mpm", 0.1, wall=3.0),
        trial(LIQUID, "sph", 0.05, wall=2.0),
        trial(LIQUID, "pbd", 0.2, wall=1.0),
        trial(other, "mpm", 0.01, wall=1.0),
        trial(other, "sph", 0.01, wall=2.0),
        trial(SOLID, "pbd", wall=0.1),
    ]
    assert winners(rows, ["liquid"]) == {"sph": 1, "mpm": 1}
    again = case("d", "liquid", 0.1)
    assert winners([*rows, trial(again, "sph")], ["liquid"]) == {"sph": 2, "mpm": 1}
    assert winners(rows, ["elastic"]) == {"pbd": 1} and winners([trial(LIQUID, "mpm", 0.2)], ["liquid"]) == {"none": 1}
    law = case("e", "liquid", 0.1, drive=lambda dt: None)
    assert winners([trial(law, "mpm")], ["liquid"]) == {}


def test_time_is_that_of_the_processor_where_the_machine_is_shared():
    made = trial(LIQUID, "mpm", wall=3.0)
    made.cost["cpu_s"] = 2.0
    assert seconds(made) == 2.0
    made.runs["a"] = change(made.runs["a"], device="cuda:0")
    assert seconds(made) == 3.0
    run = finished(cpu_s=2.0, wall_s=3.0, simulated_s=0.5)
    assert pace(run) == 4.0 and pace(change(run, device="cuda:0")) == 6.0


def test_error_at_the_cost_that_all_can_pay():
    """Error ~ cost^-1/2: at 4 s, the dearest one's cheapest run, 0.2 and 0.4; where it does not fall, the best one up
    to there; and of who ends before, the last."""
    found = at_equal_cost(laws(LIQUID, mpm=[(0.4, 1.0), (0.1, 16.0)], sph=[(0.4, 4.0), (0.1, 64.0)]))
    assert found == pytest.approx({"mpm": 0.2, "sph": 0.4})
    rising = at_equal_cost(laws(LIQUID, mpm=[(0.4, 1.0), (0.1, 16.0)], sph=[(0.3, 4.0), (0.5, 64.0)]))
    assert rising["sph"] == pytest.approx(0.3) and at_equal_cost([]) == {}
    early = at_equal_cost(laws(LIQUID, mpm=[(0.4, 1.0), (0.2, 2.0)], sph=[(0.3, 8.0), (0.1, 64.0)]))
    assert early["mpm"] == pytest.approx(0.2)


def test_real_time_is_where_a_second_takes_a_second():
    """Twice the particles, four times the time: 0.25 s at 1000, so 1 s at 2000."""
    runs = [finished(peak_particles=n, cpu_s=0.25 * (n / 1000) ** 2) for n in (500, 1000, 4000)]
    assert in_real_time(runs) == pytest.approx(2000.0)
    assert math.isnan(in_real_time(runs[:1])) and math.isnan(in_real_time([runs[0], finished("mpm", "diverged")]))
    falling = [finished(peak_particles=n, cpu_s=1.0 / n) for n in (10, 20)]
    assert math.isnan(in_real_time(falling))


def test_what_a_verdict_hangs_on_is_told():
    rows = [trial(case(n), "mpm", e) for n, e in (("a", 0.04), ("b", 0.06), ("c", 0.04), ("d", 0.3))]

    def judge(trials, factor):
        return share_is(trials, high, factor)

    assert judge(rows, 1.0) == CONFIRMED
    assert sensitivity(rows, judge) == (
        "refuted without a or b or c; refuted at 0.5 times the tolerances; confirmed at 2 times the tolerances"
    )
    assert sensitivity(rows[:1], judge) == ""  # what is open hangs on nothing
    firm = [trial(case(n), "mpm", 0.01) for n in "abc"]
    assert sensitivity(firm, judge).startswith("the same without any one of its cases; confirmed at 0.5")
