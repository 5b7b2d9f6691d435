"""The suite of cases itself: complete, planned as asked, judged by its rules."""

import math
import re

import pytest

from fluidbench.errors import UserError
from fluidbench.method.target import HERE
from fluidbench.registry import method_names
from fluidbench.study.case import Finding, cases, select
from fluidbench.study.trials import EXEMPT, LEVELS, MISS, PASS, SKIPPED, Trial, _judge, orders, plan

every_case = pytest.mark.parametrize("case", cases().values(), ids=lambda c: c.name)


@every_case
def test_a_case_is_complete(case):
    """Source, measure and tolerance are there, and what is said of methods is said of known ones."""
    assert case.source and case.measure and case.tolerance > 0
    assert set(case.exempt) | set(case.skipped) | set(case.causes) <= set(method_names())
    assert (case.drive is None) == (case.scenarios is not None) == (case.evaluate is not None)


@every_case
def test_scenarios_of_all_levels_are_valid(case):
    for factor in LEVELS.values():
        if case.scenarios is not None:
            made = case.scenarios(case.spacing * factor)
            assert made and all(s.spacing == pytest.approx(case.spacing * factor) for s in made.values())


def trial(case, method, error, spacing=None):
    made = Trial(case, method, "coarse", spacing or case.spacing)
    made.finding = Finding(error)
    _judge(made)
    return made


def test_verdicts():
    case, sag = cases()["slump_slip"], cases()["cantilever_sag"]
    assert trial(case, "mpm", 0.01).verdict == PASS
    assert trial(case, "mpm", 0.9).verdict == MISS and trial(case, "mpm", 0.9).note == "no cause known"
    assert trial(sag, "pbd", 0.9).verdict == EXEMPT and trial(sag, "pbd", 0.01).verdict == PASS
    assert trial(case, "mpm", math.nan).verdict == MISS


def test_order_is_the_slope_over_the_spacings():
    case = cases()["elliptic_drop"]
    trials = [trial(case, "mpm", 0.1 * h**2, h) for h in (0.4, 0.2, 0.1)]
    slope, spacings = orders(trials)[case.name, "mpm"]
    assert slope == pytest.approx(2.0) and spacings == 3


def test_plan_skips_with_a_reason_and_quick_leaves_out_the_dear():
    (skipped,) = plan([cases()["pbd_stiffness"]], ["mpm"], ["coarse"], False, HERE, None)
    assert skipped.verdict == SKIPPED and skipped.note and not skipped.jobs
    quick = plan(list(cases().values()), method_names(), ["coarse"], True, HERE, None)
    assert {t.case.physics for t in quick} >= {"liquid", "viscous", "yield stress", "elastic", "emission"}
    assert all(t.method not in t.case.exempt for t in quick)


def test_mistakes_are_named():
    with pytest.raises(UserError, match="did you mean 'free_fall'"):
        select(["free_fal"])
    for level, says in (
        ("finest", "no level 'finest'; did you mean 'fine'?"),
        ("x", "known: coarse, fine, medium, rough"),
    ):
        with pytest.raises(UserError, match=re.escape(says)):
            plan([cases()["free_fall"]], ["mpm"], [level], False, HERE, None)
