"""Verdicts on cost under other conditions, and the lengths and rows of a comparison."""

import math

import pytest

from fluidbench.errors import UserError
from fluidbench.measure.reference import Answer
from fluidbench.method.target import Target
from fluidbench.paper.claims import claims
from fluidbench.paper.definitions import CONFIRMED, METHODS, OPEN, REFUTED
from fluidbench.paper.elsewhere import EQUAL_ERROR, EQUAL_SPACING, MOST_EXPENSIVE, SMALL_STEPS, ask_elsewhere
from fluidbench.paper.judged import cost
from fluidbench.study import compare_report
from fluidbench.study.compare import jobs
from fluidbench.study.lengths import lengths_of

from .made import BEAD, case, change, evidence, finished, repeated, trial

TAICHI = Target(backend="taichi")


def asked(here, there, trials=(), others=()):
    """Cells by place, on evidence in both backends."""
    made = {m: [change(r, backend="taichi") for r in rs] for m, rs in there.items()}
    e = evidence(trials, repeats=here, other=made, other_trials=list(others))
    cells = [*cost(e), *claims(e)]
    ask_elsewhere(cells, e)
    return {c.place: c for c in cells}


SPACING = [("cost", EQUAL_SPACING, m) for m in METHODS]
EXPENSIVE = ("claims", MOST_EXPENSIVE, "sph")


def test_every_place_of_cost_is_held_against_the_other_backend():
    here = repeated(mpm=2.0, sph=9.0, pbd=1.0)
    cells = asked(here, repeated(mpm=2.0, sph=2.1, pbd=1.0))
    assert [cells[place].elsewhere["the other backend"] for place in SPACING] == [CONFIRMED, REFUTED, CONFIRMED]
    assert [cells[place].differs for place in SPACING] == [{}, {"the other backend": REFUTED}, {}]
    assert cells[EXPENSIVE].differs == {"the other backend": REFUTED}
    turned = asked(here, repeated(mpm=1.0, sph=9.0, pbd=2.0))
    assert [bool(turned[place].differs) for place in (*SPACING, EXPENSIVE)] == [True, False, True, False]
    short = repeated(mpm=2.0, sph=9.0) | repeated(1, pbd=1.0)
    for other in (short, repeated(1, mpm=2.0, sph=9.0, pbd=1.0), repeated(mpm=2.0, sph=9.0)):
        cells = asked(here, other)
        assert {cells[place].elsewhere["the other backend"] for place in SPACING} == {OPEN}
        assert not any(cells[place].differs for place in SPACING)  # what is open there says nothing against it
    assert not any(cell.elsewhere for cell in asked(here, {}).values())


def test_cost_at_equal_error_is_held_against_the_other_backend():
    def answers(*factors):
        return [
            trial(case(n), m, e, wall=f * w)
            for n in ("dam_break", "bead_area")
            for m, f in zip(METHODS, factors, strict=True)
            for e, w in ((0.4, 1.0), (0.1, 9.0))
        ]

    here = repeated(mpm=2.0, sph=9.0, pbd=1.0)
    places = [("cost", EQUAL_ERROR, m) for m in METHODS]
    same = asked(here, here, answers(2.0, 9.0, 1.0), answers(2.0, 9.0, 1.0))
    assert [same[place].elsewhere for place in places] == [{"the other backend": CONFIRMED}] * 3
    other = asked(here, here, answers(2.0, 9.0, 1.0), answers(1.0, 9.0, 2.0))
    assert [bool(other[place].differs) for place in places] == [True, False, True]
    assert not any(asked(here, here, answers(2.0, 9.0, 1.0))[place].elsewhere for place in places)


def test_cost_is_asked_of_a_viscous_liquid_too():
    """By explicit viscosity SPH takes eleven times the steps of MPM, by implicit as many."""
    here = repeated(mpm=2.0, sph=9.0, pbd=1.0)
    e = evidence(
        repeats=here, explicit=repeated(mpm=1.0, sph=11.0, pbd=4.0), implicit=repeated(mpm=3.0, sph=2.0, pbd=1.0)
    )
    cells = [*cost(e), *claims(e)]
    ask_elsewhere(cells, e)
    by_place = {c.place: c for c in cells}
    where = ["honey_line, explicit viscosity", "honey_line, implicit viscosity"]
    assert list(by_place[EXPENSIVE].elsewhere) == where
    assert [*by_place[EXPENSIVE].elsewhere.values()] == [CONFIRMED, REFUTED]
    assert [*by_place["claims", SMALL_STEPS, "sph"].elsewhere.values()] == [CONFIRMED, REFUTED]


# --- lengths and rows


def test_lengths_are_what_a_printer_cares_about():
    measures = {
        "bead_width_m": 1.0,
        "bead_height_m": 2.0,
        "bead_area_m2": 3.0,
        "slump": 4.0,
        "spread_radius_m": 5.0,
        "front_x_m": 6.0,
        "height_m": 7.0,
        "layer_1_width_m": 8.0,
        "layer_2_height_m": 9.0,
        "layer_1_radius_m": 10.0,
        "top_m": 11.0,
        "layer_1_continuity": 12.0,
        "layer_1_level_m": 13.0,
        "print_height_m": 14.0,
    }
    assert sorted(lengths_of(finished(measures=measures).record).values()) == [float(i) for i in range(1, 11)]
    nothing = {"slump": math.nan, "height_m": math.inf}
    assert lengths_of(finished(measures=nothing).record) == {} == lengths_of(finished().record)
    assert finished(binding_s={"a": 1.0, "b": 3.0, "c": 2.0}).record.binding == "b" and finished().record.binding == ""


def test_a_comparison_is_every_method_backend_and_repeat_in_order():
    made = jobs(BEAD, ["mpm", "sph"], 2, [Target(), TAICHI], keep_frames=True)
    assert [(j.method, j.target.backend, j.repeat) for j in made] == [
        (m, b, r) for m in ("mpm", "sph") for b in ("warp", "taichi") for r in (0, 1)
    ]
    with pytest.raises(UserError, match="unknown key"):
        jobs(BEAD.model_copy(update={"numerics": {"mpm": {"x": 1}}}), ["mpm"], 1, [Target()])
    assert all(j.keep_frames and j.scenario == BEAD.model_dump(mode="json") for j in made)


def test_a_row_of_the_comparison_holds_what_the_record_holds(tmp_path, monkeypatch):
    for drawn in ("plots", "clouds"):
        monkeypatch.setattr(compare_report, drawn, lambda *_: [])
    run = finished(
        "sph",
        measures={"top_m": 0.5},
        answers=[Answer("q", 1.0, 1.0, 0.25, "relative", "s")],
        binding_s={"a": 1.0},
        folder=tmp_path,
        machine={"cores": "2"},
        wall_s=7.0,
        seed=3,
        threads=1,
        print="sound",
    )
    row = compare_report.report([run, finished(folder=tmp_path)], tmp_path, "compare").data.to_dict("records")[0]
    expected = {
        "method": "sph",
        "top_m": 0.5,
        "error: q": 0.25,
        "binding_bound": "a",
        "machine_cores": "2",
        "wall_s": 7.0,
        "seed": 3,
        "print": "sound",
        "reused": False,
        "verdict": "completed",
    }
    assert {key: row[key] for key in expected} == expected
