"""Grid artifacts, accuracy and the paper's claims in words, on hand-made evidence."""

import math

import pytest

from fluidbench.paper.evidence import SHIPPED
from fluidbench.paper.judged import bead_width, claims, grid_artifacts, physical_accuracy, prediction
from fluidbench.paper.verdicts import CONFIRMED, OPEN, REFUTED

from .made import case, evidence, finished, known, repeated, trial


def grids(**areas):
    """Beads whose area is off by these shares of Q / V, by particles along a cell's edge."""
    exact = math.pi * 0.012**2 / 4
    return {
        float(g[1:].replace("_", ".")): [finished(measures={"bead_area_m2": exact * (1 + a)}) for a in v]
        for g, v in areas.items()
    }


@pytest.mark.parametrize(
    ("one", "two", "three", "verdict"),
    [
        ((0.13, 0.13), (0.10, 0.10), (0.05, 0.05), CONFIRMED),
        ((0.13, 0.13), (0.05, 0.05), (0.10, -0.10), CONFIRMED),
        ((0.11, 0.11), (0.10, 0.10), (0.05, 0.05), REFUTED),
        ((0.11, 0.11), (0.05, 0.05), (0.10, 0.10), REFUTED),
        ((-0.13, 0.11), (0.10, 0.10), (0.05, 0.05), OPEN),
        ((0.009, 0.009), (0.001, 0.001), (0.0, 0.0), REFUTED),
        ((0.0102, 0.0102), (0.001, 0.001), (0.0, 0.0), CONFIRMED),
        ((0.13,), (0.10, 0.10), (0.05, 0.05), OPEN),
        ((0.13, 0.13), (0.10,), (0.05, 0.05), OPEN),
        ((0.13, 0.13), (0.10, 0.10), (0.05,), OPEN),
    ],
)
def test_grid_artifacts_are_a_fifth_more_than_with_full_cells_and_over_a_percent(one, two, three, verdict):
    cell = grid_artifacts(evidence(grids=grids(_1=one, _1_5=(0.9,), _2=two, _3=three)), "row", "word")
    assert (cell.verdict, cell.method, cell.row, cell.paper) == (verdict, "mpm", "row", "word")
    assert len(cell.runs) == len(one) + len(two) + len(three) + 1
    assert cell.measured.endswith(f"27 a cell: area off by {' and '.join(f'{abs(a):.1%}' for a in three)}")
    assert "3.4 a cell: area off by 90.0%" in cell.measured


def test_grids_that_did_not_complete_leave_it_open():
    made = grids(_1=(0.13, 0.13), _1_5=(0.1, 0.1), _2=(0.1, 0.1), _3=(0.1, 0.1))
    made[2.0][1] = finished(verdict="error")
    cell = grid_artifacts(evidence(grids=made), "row", "word")
    assert cell.verdict == OPEN and cell.measured.startswith("not every run completed; 1 a cell: area off by 13.0% and")


@pytest.mark.parametrize(
    ("good", "bad", "verdict"), [(1, 1, CONFIRMED), (2, 1, REFUTED), (1, 0, OPEN), (2, 2, CONFIRMED)]
)
def test_physical_accuracy_is_that_of_every_class(good, bad, verdict):
    rows = known("pbd", good, 0, "liquid") + known("pbd", 0, bad, "viscous") + known("pbd", 3, 0, "emission")
    sweep = {
        5: [finished("pbd", measures={"bead_width_m": w}) for w in (0.0123, 0.0119)],
        1: [finished("pbd", "error")],
    }
    cell = physical_accuracy(evidence(rows, iterations=sweep, advances={0.25: sweep[5][:1]}))
    assert cell.verdict == verdict and len(cell.runs) == good + bad + 4
    assert cell.measured == (
        f"{good} of {good + bad} known answers within tolerance; bead width [mm] over iterations: 5: 12.3 and 11.9; "
        "bead width [mm] over spacings a step: 0.25: 12.3"
    )
    crashed = physical_accuracy(evidence([*rows, trial(case("x", "elastic"), "pbd", verdict="error")]))
    assert crashed.verdict == OPEN


def test_claims_of_prohibitive_steps_and_of_the_highest_cost():
    """mean_dt is 1e-3 over the pace: SPH's is a tenth of MPM's at ten times the pace."""
    first, second = claims(evidence(repeats=repeated(mpm=1.0, sph=10.0, pbd=4.0)))[:2]
    assert (first.verdict, first.measured) == (CONFIRMED, "dt is 1 / 10.00 of MPM's")
    assert (second.verdict, second.measured) == (CONFIRMED, "wall s / simulated s: mpm 1, sph 10, pbd 4")
    first, second = claims(evidence(repeats=repeated(mpm=1.0, sph=9.99, pbd=9.0)))[:2]
    assert (first.verdict, second.verdict) == (REFUTED, REFUTED) and len(first.runs) == len(second.runs) == 6
    assert len(claims(evidence(repeats=repeated(mpm=1.0, sph=9.0)))) == 4
    assert len(claims(evidence(repeats=repeated(sph=1.0, pbd=9.0, mpm=2.0)))) == 6


@pytest.mark.parametrize(
    ("errors", "verdict"),
    [((0.9, 0.9), CONFIRMED), ((0.9, 0.01), REFUTED), ((0.9, 0.9, 0.01), CONFIRMED), ((0.9,), OPEN), ((), OPEN)],
)
def test_a_prediction_fails_on_most_known_answers(errors, verdict):
    names = [f"c{i}" for i in range(len(errors))]
    rows = [trial(case(n), "pbd", e, verdict="pass" if e < 0.1 else "MISS") for n, e in zip(names, errors, strict=True)]
    noise = [
        trial(case("c0"), "mpm", 0.01),
        trial(case("z"), "pbd", 0.01),
        trial(case("c0"), "pbd", 0.0, level="fine"),
        trial(case("c0"), "pbd", verdict="skipped"),
    ]
    cell = prediction(evidence(rows + noise), "word", names)
    assert cell.verdict == verdict and len(cell.runs) == len(errors)
    told = ", ".join(f"{n}: error {e:.2g} of 0.1" for n, e in zip(names, errors, strict=True))
    assert cell.measured == (told or "not run")


def test_predictions_name_their_cases_and_what_is_shipped():
    by_word = {
        c.paper: c
        for c in claims(
            evidence(
                [
                    trial(case("slump_slip"), "pbd", 0.9, note=SHIPPED),
                    trial(case("cantilever_sag"), "pbd", verdict="diverged"),
                ]
            )
        )
    }
    assert by_word["cannot predict collapse"].measured == f"slump_slip: error 0.9 of 0.1 ({SHIPPED})"
    assert by_word["cannot predict deformation under load"].measured == "cantilever_sag: diverged"


def widths(mpm, sph, pbd):
    return {m: finished(m, measures={"bead_width_m": w}) for m, w in (("mpm", mpm), ("sph", sph), ("pbd", pbd))}


@pytest.mark.parametrize(
    ("first", "second", "verdict"),
    [
        ((10.0, 10.0, 11.1), (10.0, 10.0, 8.9), CONFIRMED),
        ((10.0, 10.0, 10.9), (10.0, 10.0, 9.1), REFUTED),
        ((10.0, 10.0, 11.1), (10.0, 10.0, 10.9), OPEN),
        ((10.5, 9.4, 20.0), (10.5, 9.4, 20.0), OPEN),  # the two are 11 % of their mean apart
        ((10.5, 9.6, 11.2), (10.5, 9.6, 11.2), CONFIRMED),  # 9 %, and 11.4 % from their mean of 10.05
    ],
)
def test_a_bead_is_a_tenth_off_the_mean_of_two_that_agree(first, second, verdict):
    level = widths(*first)
    cell = bead_width(evidence(repeats={m: [r] for m, r in level.items()}, second=widths(*second)))
    assert (cell.verdict, len(cell.runs)) == (verdict, 6)


def test_a_bead_that_was_not_laid_leaves_it_open():
    level = {m: [r] for m, r in widths(0.010, 0.010, 0.0112).items()}
    assert bead_width(evidence(repeats=level, second=widths(0.010, 0.010, 0.0112))).measured == (
        "mpm 10.0 mm, sph 10.0 mm, pbd 11.2 mm: off by 12%; mpm 10.0 mm, sph 10.0 mm, pbd 11.2 mm: off by 12%"
    )
    some = widths(0.010, 0.010, 0.0112) | {"sph": finished("sph", "timeout")}
    assert bead_width(evidence(repeats=level, second=some)).verdict == OPEN
    none = bead_width(evidence())
    assert none.verdict == OPEN and none.measured == "a method did not lay a bead"
