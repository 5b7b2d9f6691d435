"""Verdicts on cost in both frameworks, and the lengths and rows of a comparison."""

import math

import pytest

from fluidbench.errors import UserError
from fluidbench.measure.reference import Answer
from fluidbench.method.target import Target
from fluidbench.paper.evidence import METHODS
from fluidbench.paper.frameworks import frameworks
from fluidbench.paper.verdicts import DIFFERS, HOLDS, OPEN
from fluidbench.study import compare_report
from fluidbench.study.compare import jobs
from fluidbench.study.lengths import lengths_of

from .made import BEAD, case, change, evidence, finished, repeated, trial

TAICHI = Target(backend="taichi")


def both(here, there, trials=(), others=()):
    made = {m: [change(r, backend="taichi") for r in rs] for m, rs in there.items()}
    return frameworks(evidence(trials, repeats=here, other=made, other_trials=list(others)))


def test_every_place_of_cost_is_held_against_the_other_backend():
    here = repeated(mpm=2.0, sph=9.0, pbd=1.0)
    cells = both(here, repeated(mpm=2.0, sph=2.1, pbd=1.0))
    assert [(c.row.removeprefix("in both frameworks: "), c.method, c.paper, c.verdict) for c in cells] == [
        ("cost at equal spacing", "mpm", "mid-high", HOLDS),
        ("cost at equal spacing", "sph", "high", DIFFERS),
        ("cost at equal spacing", "pbd", "low", HOLDS),
        ("claim", "sph", "would be the most expensive", DIFFERS),
        ("best for", "pbd", "real-time previews", HOLDS),
        ("cost at equal error", "mpm", "mid-high", OPEN),
        ("cost at equal error", "sph", "high", OPEN),
        ("cost at equal error", "pbd", "low", OPEN),
        ("best for", "mpm", "realistic viscoelastoplastic fluids", OPEN),
        ("best for", "sph", "realistic liquids", OPEN),
    ]
    assert cells[1].measured == (
        "confirmed and refuted; here and in the other backend, wall s / simulated s: mpm 2, sph 9, pbd 1; "
        "mpm 2, sph 2.1, pbd 1"
    )
    assert {len(c.runs) for c in cells[:5]} == {12} and {c.rule for c in cells} == {"frameworks"}
    turned = both(here, repeated(mpm=1.0, sph=9.0, pbd=2.0))
    assert [c.verdict for c in turned[:5]] == [DIFFERS, HOLDS, DIFFERS, HOLDS, DIFFERS]
    short = repeated(mpm=2.0, sph=9.0) | repeated(1, pbd=1.0)
    for other in (short, repeated(1, mpm=2.0, sph=9.0, pbd=1.0), repeated(mpm=2.0, sph=9.0), {}):
        assert {c.verdict for c in both(here, other)} == {OPEN}
        assert {c.verdict for c in both(other or {"mpm": []}, here)} == {OPEN}


def test_cost_at_equal_error_is_held_against_the_other_backend():
    def answers(*factors):
        return [
            trial(case(n), m, e, wall=f * w)
            for n in ("dam_break", "bead_area")
            for m, f in zip(METHODS, factors, strict=True)
            for e, w in ((0.4, 1.0), (0.1, 9.0))
        ]

    here = repeated(mpm=2.0, sph=9.0, pbd=1.0)
    cells = both(here, here, answers(2.0, 9.0, 1.0), answers(2.0, 9.0, 1.0))[5:8]
    assert [c.verdict for c in cells] == [HOLDS] * 3 and {len(c.runs) for c in cells} == {4}
    assert cells[0].measured.endswith(
        "over the cheapest: dam_break: x 2, bead_area: x 2; dam_break: x 2, bead_area: x 2"
    )
    cells = both(here, here, answers(2.0, 9.0, 1.0), answers(1.0, 9.0, 2.0))[5:8]
    assert [c.verdict for c in cells] == [DIFFERS, HOLDS, DIFFERS]
    cells = both(here, here, answers(2.0, 9.0, 1.0), [])[5:8]
    assert [c.verdict for c in cells] == [OPEN] * 3 and cells[0].measured.endswith("; not run")


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
    monkeypatch.setattr(compare_report, "plots", lambda *_: [])
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
