"""Selection by hand: trust, extrapolation, consensus, bias, the front, the recommendation, and how sure it is."""

import importlib
import math

import pandas as pd
import pytest

from fluidbench.errors import Obstacle, UserError
from fluidbench.measure.reference import Answer
from fluidbench.method.target import Target
from fluidbench.scenario.library import load
from fluidbench.study import selection as module
from fluidbench.study.candidates import candidates, limit_within, pace_of, run_candidates
from fluidbench.study.fit import extrapolate
from fluidbench.study.select import select
from fluidbench.study.selection import (
    Candidate,
    Selection,
    Trust,
    assess,
    confidence,
    physics_of,
    trust_of,
)
from fluidbench.study.workplace import cores

from ..conftest import bead, scenario
from .made import BEAD, finished, working, workplace_in

afford = importlib.import_module("fluidbench.study.afford")
planning = importlib.import_module("fluidbench.study.candidates")
ALWAYS = (math.inf, math.inf)


@pytest.mark.parametrize(
    ("made", "classes"),
    [
        (scenario(), {"liquid"}),
        (scenario(material={"density": 1.0, "viscosity": 0.1}), {"viscous"}),
        (scenario(material={"density": 1.0, "youngs_modulus": 1.0}), {"elastic"}),
        (scenario(material={"density": 1.0, "youngs_modulus": 1.0, "yield_stress": 0.1}), {"yield stress"}),
        (scenario(material={"density": 1.0, "youngs_modulus": 1.0, "relaxation_time": 0.1}), {"viscoelastic"}),
        (scenario(material={"density": 1.0, "youngs_modulus": 1.0, "yield_stress": 0.0}), {"liquid"}),
        (bead(), {"emission", "yield stress"}),
    ],
)
def test_known_answers_are_of_the_scenarios_physics(made, classes):
    assert physics_of(made) == classes


def test_trust_is_more_than_half_of_the_answers_of_this_physics(monkeypatch):
    rows = [
        ("mpm", "yield stress", 0.1, 0.1),
        ("mpm", "emission", 0.2, 0.1),
        ("mpm", "liquid", 0.9, 0.1),
        ("sph", "emission", 0.05, 0.1),
        ("sph", "emission", 0.05, 0.1),
        ("sph", "yield stress", math.nan, 0.1),
    ]
    table = pd.DataFrame(rows, columns=["method", "physics", "error", "tolerance"])
    monkeypatch.setattr(module, "reference", lambda name: {"known_answers": table}[name])
    found = trust_of(BEAD, ["mpm", "sph", "pbd"])
    assert found == {"mpm": Trust(1, 2), "sph": Trust(2, 3), "pbd": Trust(0, 0)}
    assert [t.trusted for t in found.values()] == [False, True, False]
    assert Trust(11, 21).trusted and not Trust(10, 20).trusted


def run(method, spacing, wall=None, answers=(), **measures):
    wall = spacing**-4 if wall is None else wall
    more = {"cpu_s": wall, "wall_s": 9 * wall, "simulated_s": 0.5, "mean_dt_s": 3 * spacing, "answers": list(answers)}
    return finished(method, measures=measures, spacing=spacing, **more)


def trusting(monkeypatch, *trusted):
    monkeypatch.setattr(module, "trust_of", lambda _, ms: {m: Trust(int(m in trusted), 1) for m in ms})


def line(method, limit, slope, spacings=(1.0, 2.0, 4.0), key="height_m"):
    return [run(method, d, **{key: limit + slope * d}) for d in spacings]


def test_error_is_the_distance_to_the_methods_limit_and_the_consensus_over_it(monkeypatch):
    """Limits 10 and 12, consensus 11: at d = 2 a height of 10.4 is 0.4 / 11 from its limit, which is 1 / 11 off."""
    trusting(monkeypatch, "mpm", "sph")
    found = assess(
        BEAD, ["mpm", "sph", "pbd"], line("mpm", 10.0, 0.2) + line("sph", 12.0, -0.1) + line("pbd", 33.0, 0.0)
    )
    assert found.limits["mpm"]["height_m"] == pytest.approx(10.0)
    by_run = {(c.method, c.spacing): c for c in found.candidates}
    assert len(by_run) == 9
    assert by_run["mpm", 2.0].discretisation == pytest.approx(0.4 / 11)
    assert by_run["mpm", 2.0].bias == pytest.approx(1 / 11) == by_run["sph", 1.0].bias
    assert by_run["sph", 4.0].discretisation == pytest.approx(0.4 / 11)
    assert by_run["pbd", 1.0].bias == pytest.approx(2.0) and by_run["pbd", 1.0].discretisation == pytest.approx(
        0.0, abs=1e-9
    )
    one = by_run["sph", 2.0]
    assert (one.dt, one.seconds, one.pace, one.error) == (6.0, 2.0**-4, 2.0**-3, one.discretisation + one.bias)
    trusting(monkeypatch)
    nobody = assess(BEAD, ["mpm", "sph"], line("mpm", 10.0, 0.2) + line("sph", 12.0, -0.1))
    assert nobody.candidates[0].bias == pytest.approx(1 / 11)
    assert nobody.notes == ["no method passes most known answers of this physics: the consensus is the mean of all"]


def test_scatter_counts_where_it_is_larger_than_the_distance(monkeypatch):
    trusting(monkeypatch, "mpm")
    rows = [run("mpm", d, height_m=h) for d, h in ((1.0, 10.0), (2.0, 10.4), (4.0, 10.0))]
    fit = extrapolate(rows, "height_m")
    found = {c.spacing: c.discretisation for c in assess(BEAD, ["mpm"], rows).candidates}
    for d, h in ((1.0, 10.0), (2.0, 10.4), (4.0, 10.0)):
        assert found[d] == pytest.approx(max(abs(h - fit.limit), fit.scatter(d)) / fit.limit)
    assert max(abs(10.0 - fit.limit), 0) < fit.scatter(4.0)


def test_the_worst_length_decides(monkeypatch):
    trusting(monkeypatch, "mpm")
    rows = [run("mpm", d, height_m=10.0 + 0.1 * d, bead_width_m=5.0 - 0.2 * d) for d in (1.0, 2.0, 4.0)]
    found = {c.spacing: c.discretisation for c in assess(BEAD, ["mpm"], rows).candidates}
    assert found == pytest.approx({1.0: 0.04, 2.0: 0.08, 4.0: 0.16})


def test_an_exact_length_is_judged_against_its_answer_alone(monkeypatch):
    trusting(monkeypatch, "mpm")
    answer = [
        Answer(name, 0.0, reference, 0.0, "relative", "s")
        for name, reference in (("bead area [m^2]", 2.0), ("slump", 9.0))
    ]
    rows = [run("mpm", d, answers=answer, bead_area_m2=a) for d, a in ((1.0, 2.2), (2.0, 1.6), (4.0, 2.0))]
    found = assess(BEAD, ["mpm"], rows)
    assert [(c.discretisation, c.bias) for c in found.candidates] == [
        (pytest.approx(0.1), 0.0),
        (pytest.approx(0.2), 0.0),
        (0.0, 0.0),
    ]
    assert not found.erratic


def test_two_spacings_are_not_enough(monkeypatch):
    trusting(monkeypatch, "mpm", "sph")
    blown = [finished("sph", "diverged", spacing=4.0, reason="it moves by 9 d")]
    found = assess(BEAD, ["mpm", "sph"], line("mpm", 10.0, 0.2) + line("sph", 12.0, 0.1, (1.0, 2.0)) + blown)
    assert {c.method for c in found.candidates} == {"mpm"} and list(found.limits) == ["mpm"]
    assert found.notes[:2] == [
        "sph: diverged at 4e+03 mm: it moves by 9 d",
        "sph: only 2 spacings completed with their volume, 3 are needed",
    ]
    assert "the consensus is mpm's own limit" in found.notes[2] and len(found.runs) == 6 and found.missing() == []


def test_a_refusal_is_told_once_with_its_cure_and_no_consensus_of_nothing(monkeypatch):
    """It said that none completed with its volume, and that there was a consensus of all."""
    trusting(monkeypatch, "mpm", "sph")
    why = "it moves too near its own sound; raise material.sound_speed"
    runs = [finished("sph", "refused", spacing=d, reason=why) for d in (1.0, 2.0, 4.0)]
    assert assess(BEAD, ["sph"], runs).notes == [f"sph: refused: {why}"]
    some = assess(
        BEAD, ["mpm"], [*line("mpm", 10.0, 0.2, (1.0, 2.0)), finished("mpm", "refused", spacing=4.0, reason=why)]
    )
    assert some.notes == [
        f"mpm: refused at 4e+03 mm: {why}",
        "mpm: only 2 spacings completed with their volume, 3 are needed",
    ]
    late = assess(BEAD, ["mpm"], [finished("mpm", "timeout", spacing=1.0, reason="late")])
    assert late.notes == ["mpm: only 0 spacings completed with their volume, 3 are needed"]
    assert late.missing() == ["line_bead, mpm, d = 1e+03 mm: timeout: late"]  # told there


def test_what_no_line_explains_is_erratic(monkeypatch):
    trusting(monkeypatch, "mpm", "sph")
    wild = [run("sph", d, height_m=h) for d, h in ((1.0, 10.0), (2.0, 13.0), (4.0, 10.1))]
    found = assess(BEAD, ["mpm", "sph"], line("mpm", 10.0, 0.2) + wild)
    assert list(found.erratic) == ["sph"] and not found.converges("sph") and found.converges("mpm")
    assert found.notes[-1] == (
        "sph: not converged: its height neither goes with the spacing beyond chance (90 % sure) nor settles to 1 %: "
        "10.1, 13, 10 m at 4e+03, 2e+03, 1e+03 mm"
    )
    for r in wild:
        r.record.measures["bead_width_m"] = 1e-3 * r.record.measures["height_m"] ** 2
    twice = assess(BEAD, ["sph"], wild).erratic["sph"]
    assert twice.startswith("its bead width neither") and twice.endswith("; so 1 more of its lengths")


def made(*rows, method="mpm", bias=0.0):
    """A selection of candidates (spacing, wall, discretisation)."""
    found = [Candidate(method, d, 1e-4, w, 10 * w, e, bias, e, finished(method)) for d, w, e in rows]
    return Selection(found, {method: Trust(1, 1)}, {method: {"height_m": 1.0}}, [])


def test_order_is_the_slope_of_the_errors_that_are_not_nothing():
    assert made((1.0, 1, 0.01), (2.0, 1, 0.04), (4.0, 1, 0.16)).order("mpm") == pytest.approx(2.0)
    assert math.isnan(made((1.0, 1, 0.01), (2.0, 1, 0.04)).order("mpm"))
    assert math.isnan(made((1.0, 1, 0.0), (2.0, 1, 0.04), (4.0, 1, 0.16)).order("mpm"))
    assert math.isnan(made((1.0, 1, 0.01), (2.0, 1, 0.04), (4.0, 1, 0.16)).order("sph"))
    least = made((1.0, 1, 1.0), (math.e, 1, math.exp(2)), (math.exp(2), 1, math.e))  # (0, 0), (1, 2), (2, 1)
    assert least.order("mpm") == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("errors", "converges"),
    [
        ((0.01, 0.02, 0.04), True),
        ((0.0203, 0.02, 0.08), False),  # no better at the finest
        ((0.02, 0.02, 0.08), True),
        ((0.02, 0.0285, 0.0399), False),  # of order 0.498
        ((0.02, 0.0284, 0.0403), True),  # of order 0.505
        ((0.0, 0.02, 0.01), True),
        ((0.01, 0.02), False),
        ((0.01, 0.002, 0.002), True),  # noise all along
        ((0.011, 0.002, 0.002), False),
        ((0.005, 0.004, 0.08), True),  # noise at the finest
        ((0.04, 0.02, 0.01), False),
    ],
)
def test_a_method_converges_when_its_error_falls_at_half_an_order(errors, converges):
    rows = [(2.0**i, 1.0, e) for i, e in enumerate(errors)]
    assert made(*rows[::-1]).converges("mpm") is converges


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ((0.01, 0.02, 0.04), ""),
        ((0.04, 0.02, 0.03), "does not fall with the spacing"),
        ((0.02, 0.0285, 0.0399), "hardly falls with the spacing: by an order of 0.498, and 0.5 is wanted"),
        ((0.02, 0.022, 0.025), "hardly falls with the spacing: by an order of 0.161, and 0.5 is wanted"),
        ((0.0203, 0.02, 0.08), "does not fall any more at the finest spacing"),
        ((0.01, 0.02), "is known at fewer than 3 spacings"),
    ],
)
def test_what_is_said_of_an_error_is_what_it_does(errors, words):
    assert made(*((2.0**i, 1.0, e) for i, e in enumerate(errors))).slack("mpm") == words


def test_the_front_is_what_nothing_beats_in_both():
    found = made((1.0, 5.0, 0.1), (2.0, 1.0, 0.3), (3.0, 2.0, 0.3), (4.0, 3.0, 0.4), (5.0, 3.0, 0.2), (6.0, 5.0, 0.05))
    assert [c.spacing for c in found.front()] == [2.0, 5.0, 6.0]
    biased = Selection([*found.candidates, *made((9.0, 0.5, 0.0), bias=0.9).candidates], {}, {}, [])
    assert [c.spacing for c in biased.front()] == [9.0, 2.0, 5.0, 6.0]


def test_the_recommendation_is_the_cheapest_that_meets_all():
    found = made((1.0, 9.0, 0.1), (2.0, 4.0, 0.2), (3.0, 5.0, 0.15), (4.0, 1.0, 0.5))

    def best(tolerance, budget=math.inf, pace=math.inf):
        candidate, why = found.recommend(tolerance, budget, pace)
        return candidate and candidate.spacing, why

    assert best(0.2) == (2.0, "") and best(0.19) == (3.0, "") and best(0.1) == (1.0, "") and best(0.6) == (4.0, "")
    assert best(0.15, budget=5.0) == (3.0, "") and best(0.15, pace=50.0) == (3.0, "")
    late = "nothing within the tolerance meets the budget; this is the fastest"
    assert best(0.15, budget=4.9) == (3.0, late) and best(0.15, pace=49.9) == (3.0, late)
    assert best(0.09) == (1.0, "nothing tried meets the tolerance; this is the nearest")
    assert Selection([], {}, {}, []).recommend(0.1, *ALWAYS) == (None, "no method completed at three spacings")
    assert made((1.0, 1.0, 0.05), bias=0.06).recommend(0.1, *ALWAYS)[1].startswith("nothing tried")


@pytest.mark.parametrize(
    ("limits", "tolerance", "sure"),
    [
        ((10.0, 11.0), 0.0953, "high: the limits of mpm and sph differ by at most 9.5%"),
        ((10.0, 11.0), 0.0952, "medium: the limits of mpm and sph differ by at most 9.5%"),
        ((11.0, 10.0), 0.2, "high: the limits of mpm and sph differ by at most 9.5%"),
    ],
)
def test_confidence_compares_the_trusted_limits(monkeypatch, limits, tolerance, sure):
    trusting(monkeypatch, "mpm", "sph")
    rows = line("mpm", limits[0], 0.2) + line("sph", limits[1], 0.2) + line("pbd", 99.0, 0.2)
    for r in rows:
        if r.method == "mpm":
            r.record.measures["slump"] = 0.1 * r.record.spacing_m  # a length that the others do not have
        r.record.measures["front_x_m"] = 1.0  # and one in which all agree
    found = assess(BEAD, ["mpm", "sph", "pbd"], rows)
    assert confidence(found, tolerance, None) == sure
    found.erratic["sph"] = "its height scatters"
    assert confidence(found, tolerance, None) == f"low: {sure.partition(': ')[2]}; not converged: sph"
    trusting(monkeypatch)
    assert confidence(assess(BEAD, ["mpm"], line("mpm", 10.0, 0.2)), 1.0, None).startswith("low: no method passes")
    trusting(monkeypatch, "mpm", "sph")
    parted = assess(BEAD, ["mpm", "sph"], line("mpm", 10.0, 0.2) + line("sph", 10.0, 0.2, key="slump"))
    assert confidence(parted, 1e9, None) == "low: mpm and sph have no length in common"


def test_confidence_is_that_of_the_setting_chosen(monkeypatch):
    """Two trusted methods agree; a third, not trusted, is sure only if it converges, and never highly."""
    trusting(monkeypatch, "mpm", "sph")
    rows = line("mpm", 10.0, 0.2) + line("sph", 10.0, 0.2)
    words = "the limits of mpm and sph differ by at most 0.0%"

    def sure(third):
        found = assess(BEAD, ["mpm", "sph", "pbd"], rows + third)
        return [confidence(found, 0.1, next(c for c in found.candidates if c.method == m)) for m in ("mpm", "pbd")]

    known = "pbd passes 0 of 1 known answers of this physics"
    assert sure(line("pbd", 10.0, 0.2)) == [f"high: {words}", f"medium: {words}; {known}"]
    scattered = [run("pbd", d, height_m=h) for d, h in ((1.0, 10.0), (2.0, 12.0), (4.0, 9.0))]
    assert sure(scattered) == [f"high: {words}", f"low: {words}; not converged: pbd"]


def test_a_method_that_was_not_judged_is_not_said_to_fail(monkeypatch):
    trusting(monkeypatch, "mpm", "sph")
    alone = assess(BEAD, ["mpm", "sph"], line("sph", 10.0, 0.2))
    assert confidence(alone, 0.1, None) == (
        "low: only sph passes most known answers of this physics (mpm: not judged here), and nothing else confirms "
        "its limit"
    )
    nobody = assess(BEAD, ["mpm", "sph", "pbd"], line("pbd", 10.0, 0.2))
    why = "mpm and sph, which pass most known answers of this physics, were not judged here"
    assert confidence(nobody, 0.1, None) == f"low: {why}" and f"{why}: the consensus is the mean of all" in nobody.notes


def test_what_has_lost_its_volume_is_no_evidence(monkeypatch):
    trusting(monkeypatch, "mpm", "sph")
    loose = [
        run("mpm", d, height_m=h, packing=p) for d, h, p in ((4.0, 10.0, 1.0), (2.0, 10.0, 0.95), (1.0, 12.0, 0.8))
    ]
    found = assess(BEAD, ["mpm", "sph"], loose + line("sph", 10.0, 0.1))
    assert found.witnesses() == ["sph"] and {c.method for c in found.candidates} == {"sph"}
    assert "mpm: only 2 spacings completed with their volume, 3 are needed" in found.notes
    (why,) = [note for note in found.notes if "left out" in note]
    assert "0.8 times as dense as at rest" in why


def test_what_has_no_length_is_no_candidate(monkeypatch):
    trusting(monkeypatch, "mpm")
    found = assess(BEAD, ["mpm"], line("mpm", 1.0, 0.1, key="mass_kg"))
    assert found.candidates == [] and any("has no length to be judged by" in note for note in found.notes)
    assert found.recommend(0.1, *ALWAYS)[0] is None and confidence(found, 0.1, None).startswith("low")


def test_four_spacings_are_run_of_every_method_where_the_nozzle_allows(tmp_path):
    place = workplace_in(tmp_path, wall_limit=5.0)

    def planned(scenario, *methods):
        return candidates({"bead": scenario}, methods, place)["bead"]

    jobs = planned(BEAD, "mpm", "sph").jobs
    assert planned(BEAD, "mpm").untried == []
    assert [(j.method, j.scenario["spacing"]) for j in jobs] == [
        (m, pytest.approx(f * 1.5e-3)) for m in ("mpm", "sph") for f in (2.0, 1.5, 1.0, 0.75)
    ]
    assert {j.wall_limit for j in jobs} == {5.0}
    place.target = Target("cuda:0")  # where a finer one costs little
    assert [j.scenario["spacing"] for j in planned(BEAD, "mpm").jobs] == pytest.approx(
        [3e-3, 2.25e-3, 1.5e-3, 1.125e-3, 0.75e-3]
    )
    place.target = Target("cpu")
    coarse = planned(BEAD.model_copy(update={"spacing": 4e-3}), "mpm").jobs  # 8 mm do not fit twice into 12
    assert [j.scenario["spacing"] for j in coarse] == pytest.approx([6e-3, 4e-3, 3e-3])


@pytest.mark.parametrize(
    ("verdict", "count", "lacks"), [("completed", 4, False), ("refused", 0, False), ("timeout", 0, True)]
)
def test_a_selection_needs_candidates_and_every_run(tmp_path, monkeypatch, verdict, count, lacks):
    def answer(job):
        d = job.scenario["spacing"]
        return finished(job.method, verdict, {"bead_width_m": 0.01 + d}, spacing=d)

    calls = working(monkeypatch, answer)
    made = select(BEAD, "mpm", tolerance="900%", out=tmp_path, progress=False)
    assert len(made.table) == len(made.found.candidates) == count and bool(made.missing) is lacks
    assert made.ok is (verdict == "completed") and len(made.runs) == 4 and [call.workers for call in calls] == [cores()]
    assert made.findings[1].startswith("Recommended: mpm") if count else made.findings[0].startswith("No recomm")


def costing(monkeypatch, **cost):
    """Methods of so many seconds at the scenario's spacing, and runs that cost nothing to start."""
    monkeypatch.setattr(afford, "STARTING", 0.0)
    for user in (afford, planning):
        monkeypatch.setattr(user, "expected", lambda s, method: cost[method] * (s.spacing / BEAD.spacing) ** -4)
    return lambda jobs: sum(cost[j.method] * (j.scenario["spacing"] / BEAD.spacing) ** -4 for j in jobs)


def test_spacings_are_as_fine_as_there_is_time(tmp_path, monkeypatch):
    """Finer than without a limit where a method is cheap, down to half; what MPM leaves of its 60 s goes to others."""
    spent = costing(monkeypatch, mpm=1.0, sph=100.0, pbd=1e9)
    place = workplace_in(tmp_path, workers=2)
    found = candidates({"bead": BEAD}, ["mpm", "sph", "pbd"], place, within=90.0)["bead"]
    own = {m: [j for j in found.jobs if j.method == m] for m in ("mpm", "sph")}
    finest = {m: min(j.scenario["spacing"] for j in jobs) for m, jobs in own.items()}
    assert finest["mpm"] == pytest.approx(0.75 * 1.05**-13 * BEAD.spacing) and len(found.jobs) == 8
    assert spent(own["mpm"]) <= 60.0 < 1.05**4 * spent(own["mpm"])
    half = candidates({"bead": BEAD}, ["mpm"], place, within=1e6)["bead"].jobs[-1].scenario["spacing"]
    assert half == pytest.approx(0.75 * 1.05**-14 * BEAD.spacing)
    share = (180.0 - spent(own["mpm"])) / 2
    assert share / 1.05**4 < spent(own["sph"]) <= share
    assert found.untried == [
        f"sph: no finer than {1e3 * finest['sph']:.3g} mm, for want of time",
        "pbd: left out: 3 spacings take longer than its share of the time",
    ]


def test_time_is_shared_among_the_jobs_of_a_guide(tmp_path, monkeypatch):
    spent = costing(monkeypatch, mpm=1.0, sph=100.0)
    cheap = BEAD.model_copy(update={"spacing": 2e-3})
    found = candidates({"a": BEAD, "b": cheap}, ["mpm", "sph"], workplace_in(tmp_path, workers=2), within=100.0)
    used = spent([j for own in found.values() for j in own.jobs])
    assert 200.0 / 1.05**8 < used <= 200.0 and [len(own.jobs) for own in found.values()] == [8, 8]
    assert not any("mpm" in line for own in found.values() for line in own.untried)


def test_spacings_lie_nearer_where_none_can_be_wide(tmp_path, monkeypatch):
    """The bore takes 6 mm at most, so that 1.5, 1 and 0.75 times 4 mm cannot be any wider."""
    spent = costing(monkeypatch, sph=100.0)
    coarse = BEAD.model_copy(update={"spacing": 4e-3})

    def tried(seconds):
        jobs = candidates({"bead": coarse}, ["sph"], workplace_in(tmp_path, workers=1), seconds)["bead"].jobs
        assert spent(jobs) <= seconds
        return [j.scenario["spacing"] for j in jobs]

    full = sum(100.0 * (f * 4 / 1.5) ** -4 for f in (1.5, 1.0, 0.75))
    assert tried(1.001 * full) == pytest.approx([6e-3, 4e-3, 3e-3])
    near = sum(100.0 * (f * 4 / 1.5) ** -4 for f in afford.NARROW[0])
    assert near < 0.5 * full and tried(1.001 * near) == pytest.approx([4e-3 * f for f in afford.NARROW[0]])


def test_a_scenario_that_can_only_be_finer_is_tried_there_or_refused(tmp_path, monkeypatch):
    tower = load("foam_tower")
    jobs = candidates({"tower": tower}, ["mpm"], workplace_in(tmp_path))["tower"].jobs
    assert [j.scenario["spacing"] / tower.spacing for j in jobs] == pytest.approx([1.0, 0.85, 0.7])
    monkeypatch.setattr(afford, "NARROW", ())
    for within in (math.inf, 1e9):
        with pytest.raises(UserError, match="tower: it cannot have 3 spacings near"):
            candidates({"tower": tower}, ["mpm"], workplace_in(tmp_path), within)


def test_time_is_of_the_cores_that_there_are(tmp_path, monkeypatch):
    """Runs of several threads go one by one, and no more than the cores' work side by side."""
    spent = costing(monkeypatch, sph=500.0)
    for workers, threads, share in ((2, 1, 2), (16, 1, cores()), (8, 2, 2)):
        place = workplace_in(tmp_path, workers=workers)
        place.target = Target("cpu", threads=threads)
        used = spent(candidates({"bead": BEAD}, ["sph"], place, 100.0)["bead"].jobs)
        assert 100.0 * min(share, cores()) / 1.05**4 < used <= 100.0 * min(share, cores())


def slow(cost, by, monkeypatch):
    """Runs that take `by[method]` times what `costing` says, with what else a record has of that."""

    def answer(job):
        wall = by[job.method] * cost[job.method] * (job.scenario["spacing"] / BEAD.spacing) ** -4
        half = {"simulated_s": 0.5 * job.scenario["duration"], "wall_s": 0.5 * wall, "total_s": 0.5 * wall + 3.0}
        own = {"measures": {"bead_width_m": 0.01}, "spacing": job.scenario["spacing"], "input": job.scenario}
        return finished(job.method, "completed", **own, **half)

    return working(monkeypatch, answer)


def test_spacings_are_by_what_one_run_of_each_method_takes_here(tmp_path, monkeypatch):
    """SPH takes three times as long as estimated, PBD half. What the trials took is spent, and each is evidence."""
    cost = {"sph": 40.0, "pbd": 20.0}
    spent = costing(monkeypatch, **cost)
    calls = slow(cost, {"sph": 3.0, "pbd": 0.5}, monkeypatch)
    place = workplace_in(tmp_path, workers=1, progress=False)
    guess = candidates({"bead": BEAD}, ["sph", "pbd"], place, 300.0)["bead"]
    own = run_candidates({"bead": BEAD}, ["sph", "pbd"], place, "select", 300.0)["bead"]
    first, rest = calls
    assert [job.scenario["spacing"] for job in first] == [guess.of(m)[1].scenario["spacing"] for m in ("sph", "pbd")]
    assert all(own.of(m)[-1] == job for m, job in zip(("sph", "pbd"), first, strict=True)) and len(own.jobs) == 10
    left = 300.0 - sum(0.5 * by * spent([job]) + 3.0 for by, job in zip((3.0, 0.5), first, strict=True))
    took = 3.0 * spent(own.of("sph")[:4]) + 0.5 * spent(own.of("pbd")[:4])
    assert left / 1.05**8 < took <= left
    assert (costs := [spent([job]) for job in rest]) == sorted(costs, reverse=True)  # none is waited for alone
    assert [run.record.spacing_m for run in own.runs] == [job.scenario["spacing"] for job in own.jobs]


def test_a_trial_of_what_there_is_no_time_for_is_no_evidence(tmp_path, monkeypatch):
    cost = {"sph": 10.0, "pbd": 10.0}
    costing(monkeypatch, **cost)
    slow(cost, {"sph": 1e7, "pbd": 0.1}, monkeypatch)
    place = workplace_in(tmp_path, workers=1, progress=False)
    with pytest.raises(
        Obstacle, match=r"within 300 s no method can compute 3 spacings of bead: they take 1e\+07 times"
    ):
        run_candidates({"bead": BEAD}, ["sph"], place, "select", 300.0)
    monkeypatch.setattr(planning, "_time", lambda *_: 300.0)
    own = run_candidates({"bead": BEAD}, ["sph", "pbd"], place, "select", 300.0)["bead"]
    assert own.of("sph") == [] and len(own.of("pbd")) == 5
    assert own.untried == ["sph: left out: 3 spacings take longer than its share of the time"]


def test_a_pace_is_of_what_was_run():
    """Half the time in 3 s; nothing where nothing was run, or the estimate is nothing."""
    own = {"input": BEAD.model_dump(mode="json"), "wall_s": 3.0, "simulated_s": 0.5 * BEAD.duration}
    assert pace_of(finished("mpm", **own)) == pytest.approx(6.0 / afford.expected(BEAD, "mpm"))
    assert math.isnan(pace_of(finished("mpm", **own | {"simulated_s": 0.0})))
    assert math.isnan(pace_of(finished("mpm", "refused")))


def test_what_is_refused_lacks_no_time(tmp_path):
    """PBD refuses a solid that is fed in, and was said to be no finer for want of time."""
    solid = BEAD.model_copy(update={"material": BEAD.material.model_copy(update={"youngs_modulus": 100.0})})
    found = candidates({"bead": solid}, ["mpm", "pbd"], workplace_in(tmp_path, workers=2), within=14.0)["bead"]
    assert [line.partition(":")[0] for line in found.untried] == ["mpm"] and found.of("pbd")


def test_what_is_refused_takes_no_time():
    assert afford.expected(BEAD, "mpm") > 0.1
    solid = BEAD.model_copy(update={"material": BEAD.material.model_copy(update={"yield_stress": None})})
    assert solid.material.is_solid and afford.expected(solid, "pbd") == 0.0


def test_a_study_that_no_method_has_time_for_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"within 1 s no method can compute 3 spacings of line_bead"):
        select(BEAD, "mpm", within=1.0, out=tmp_path, progress=False)
    for wrong in (0.1, "5m"):
        with pytest.raises(UserError, match="within: a number of at least 1 is wanted"):
            select(BEAD, "mpm", within=wrong, out=tmp_path, progress=False)
    for name, wrong in (("budget", "60s"), ("budget", -1.0), ("pace", math.nan)):
        with pytest.raises(UserError, match=f"{name}: a number of at least 0 is wanted"):
            select(BEAD, "mpm", **{name: wrong}, out=tmp_path, progress=False)
    with pytest.raises(UserError, match="measured: a file, or rows of one, are wanted"):
        select(BEAD, "mpm", measured=None, out=tmp_path, progress=False)


def test_a_limit_of_a_run_is_what_was_given_or_the_whole_studys_time():
    assert [limit_within(t) for t in (math.inf, 60.0, 3600.0)] == [900.0, 900.0, 3600.0]


def test_what_grows_or_cures_is_judged_by_processes_too():
    assert physics_of(load("foam_wall")) == {"emission", "yield stress", "process"}
