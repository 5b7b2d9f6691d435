"""Published answers beside measures that are made to agree, or to be wrong by a known amount."""

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure.reference import answers, table
from fluidbench.scenario.stream import Stream

from ..conftest import bead, scenario


def emission_answers(s, final, until):
    found, _ = answers(s, pd.DataFrame({"time_s": [0.0, until / 2, until]}), final)
    return {answer.quantity: answer for answer in found}


def test_emitted_mass_is_judged_in_discs():
    """rho Q t to the last sample; a disc is rho times the nozzle's area times a spacing."""
    s = bead(duration=0.4)
    disc = 1000.0 * np.pi * 0.006**2 * 0.002
    expected = 1000.0 * np.pi * 0.006**2 * 0.1 * 0.2
    ((answer,), reasons) = answers(s, pd.DataFrame({"time_s": [0.0, 0.2]}), {"mass_kg": expected - 0.4 * disc})
    assert reasons == []
    assert answer.quantity == "emitted mass [kg]" and answer.measured == expected - 0.4 * disc
    assert answer.reference == pytest.approx(expected) and answer.error == pytest.approx(0.4)
    late = emission_answers(s, {"mass_kg": 0.0}, 0.4)["emitted mass [kg]"]  # the path of 0.03 m ended at 0.3 s
    assert late.reference == pytest.approx(1.5 * expected) and late.error == pytest.approx(15.0)
    assert Stream(s).volume * len(Stream(s).offsets) == pytest.approx(disc / 1000.0)


def laid(area, matter):
    return {"mass_kg": 0.0, "bead_area_m2": area, "bead_matter_m2": matter}


def test_the_beads_section_is_held_against_the_matter_that_lies_there():
    s = bead(duration=0.7)
    found = emission_answers(s, laid(0.93e-4, 1.2e-4), 0.1)["bead area [m^2]"]  # whatever is left of the path
    assert found.measured == 0.93e-4 and found.reference == 1.2e-4 and found.error == pytest.approx(0.225)
    assert (found.measure, found.source, found.reads) == ("relative", "its matter", "bead_area_m2")
    none, reasons = answers(s, pd.DataFrame({"time_s": [0.0, 0.1]}), laid(0.0, 0.0))
    assert [answer.quantity for answer in none] == ["emitted mass [kg]"]
    assert "bead area against its matter: none lies along the path" in reasons


def test_the_matter_that_lies_there_is_what_is_fed_over_how_fast_it_is_laid():
    s = bead(duration=0.7, toolpath={"start": [0, 0], "end": [0.03, 0], "speed": 0.05})
    area = np.pi * 0.006**2 * 0.1 / 0.05
    found = emission_answers(s, laid(1.0, 1.07 * area), 0.7)["bead matter [m^2]"]
    assert found.reference == pytest.approx(area) and found.error == pytest.approx(0.07)
    assert found.measured == 1.07 * area and found.measure == "relative" and found.source == "Q / V"
    assert emission_answers(s, laid(1.0, 0.9 * area), 0.6)["bead matter [m^2]"].error == pytest.approx(0.1)
    assert "bead matter [m^2]" in emission_answers(s, laid(1.0, area), 0.6 * (1 - 1e-7))
    found, reasons = answers(s, pd.DataFrame({"time_s": [0.0, 0.59]}), laid(1.0, area))
    assert [answer.quantity for answer in found] == ["emitted mass [kg]", "bead area [m^2]"]  # the path takes 0.6 s
    assert reasons == ["bead matter against Q / V: the path takes 0.6 s, the run ends at 0.59 s"]


def test_the_matter_of_foam_has_grown_by_the_mean_over_its_ages():
    """R = 1 + 3 (1 - exp(-t / 0.5)) from 0.02 s on, averaged over material 0.1 to 0.4 s old."""
    material = {"density": 100.0, "expansion": {"ratio": 4.0, "time": 0.5, "delay": 0.02}}
    s = bead(material=material, duration=0.4)
    ages = np.linspace(0.1, 0.4, 20001)
    grown = np.mean(4.0 - 3.0 * np.exp(-(ages - 0.02) / 0.5))
    found = emission_answers(s, laid(1.0, 1.0), 0.4)["bead matter [m^2]"]
    assert found.reference == pytest.approx(np.pi * 0.006**2 * grown, rel=2e-3) and found.source == "R Q / V"


def test_pauses_lay_no_foam():
    """Two layers of 0.3 s with 0.6 s between them: the mean of R runs over what was laid, not over the pause."""
    material = {"density": 100.0, "expansion": {"ratio": 4.0, "time": 0.2}}
    path = {
        "kind": "wall",
        "start": [0, 0],
        "end": [0.03, 0],
        "speed": 0.1,
        "layers": 2,
        "layer_height": 0.004,
        "pause": 0.6,
    }
    s = bead(material=material, duration=1.2, toolpath=path)
    ages = np.concatenate([np.linspace(0.9, 1.2, 1001), np.linspace(0.0, 0.3, 1001)])
    grown = np.mean(4.0 - 3.0 * np.exp(-ages / 0.2))
    found = emission_answers(s, laid(1.0, 1.0), 1.2)["bead matter [m^2]"]
    assert found.reference == pytest.approx(np.pi * 0.006**2 * grown, rel=0.006)


CYLINDER = {"kind": "cylinder", "center": [0.1, 0.1, 0.04], "radius": 0.04, "height": 0.08}


def slump_answers(tau, slump, body=CYLINDER, gravity=-10.0, **more):
    """A cylinder of height 0.08 m; 1000 kg/m^3 and 10 m/s^2 make tau' = yield_stress / 800."""
    material = {"density": 1000.0, "youngs_modulus": 1e5, "yield_stress": 800.0 * tau}
    s = scenario(bodies=[body], material=material, gravity=[0, 0, gravity], reference="viscoplastic_slump", **more)
    return answers(s, pd.DataFrame({"time_s": [0.0, 1.0]}), {} if slump is None else {"slump": slump})


@pytest.mark.parametrize(
    ("tau", "expected"),
    [
        (0.05, 0.611),  # one computation alone
        (0.1, (0.524 + 0.534) / 2),  # the mean of both
        (0.15, ((0.524 + 0.534) / 2 + 0.325) / 2),
        (0.25, (0.325 + 0.122) / 2),
        (0.3 - 1e-9, 0.122),
    ],
)
def test_slump_is_compared_at_its_own_yield_number(tau, expected):
    for slump in (0.1, 0.7):
        ((answer,), reasons) = slump_answers(tau, slump)
        assert answer.reference == pytest.approx(expected) and answer.error == pytest.approx(abs(slump - expected))
        assert answer.measured == slump and answer.measure == "absolute" and reasons == []
        assert answer.quantity == f"slump at tau' = {tau:.3g}"


@pytest.mark.parametrize(
    ("tau", "more", "words"),
    [
        (0.049, {}, "tau' = 0.049 lies outside the table, 0.05 .. 0.3"),
        (0.301, {}, "tau' = 0.301 lies outside"),
        (0.2, {"slump": None}, "one cylinder with a yield stress"),
        (0.0, {}, "one cylinder with a yield stress"),
        (0.2, {"gravity": 10.0}, "slumps under its weight"),
        (0.2, {"gravity": 0.0}, "slumps under its weight"),
        (0.2, {"body": {"kind": "box", "center": [0.1] * 3, "size": [0.08] * 3}}, "one cylinder"),
        (0.2, {"body": {**CYLINDER, "radius": 0.0406}}, "H / R = 2"),
        (0.2, {"body": {**CYLINDER, "radius": 0.0394}}, "H / R = 2"),
        (0.2, {"domain": {"lower": [0] * 3, "upper": [0.2] * 3, "walls": {"z_lower": "slip"}}}, "floor that sticks"),
    ],
)
def test_other_slumps_are_compared_with_nothing(tau, more, words):
    found, (reason,) = slump_answers(tau, **{"slump": 0.4, **more})
    assert found == [] and words in reason


def test_proportions_may_differ_by_what_a_lattice_does():
    for radius, near in ((0.0397, True), (0.0403, True), (0.08 / 2.0205, False), (0.08 / 1.9795, False)):
        assert len(slump_answers(0.2, 0.4, {**CYLINDER, "radius": radius})[0]) == near
    for ratio, near in ((2.038, True), (1.962, True), (2.041, False), (1.959, False)):
        assert len(front_answers([0.0, 5.0], [1.0, 4.0], ratio=ratio)[0]) == near


def test_weak_gravity_will_do():
    """tau' = 8 / (1000 * 0.5 * 0.08) = 0.2; and T runs slower."""
    ((answer,), _) = slump_answers(0.01, 0.4, gravity=-0.5)
    assert answer.reference == pytest.approx(0.325)
    assert front_answer(5.0 * ROWS["T"], ROWS["Z"], gravity=-0.4).error == pytest.approx(0.0, abs=1e-9)


def test_nothing_is_compared_with_what_was_not_asked_for():
    series = pd.DataFrame({"time_s": [0.0], "front_x_m": [0.1]})
    assert answers(scenario(), series, {"slump": 0.4, "bead_area_m2": 1.0}) == ([], [])


A = 0.05
ROWS = table("dam_break_martin_moyce_front_n2_2")
ROWS = ROWS[ROWS["kind"] == "table"]  # not what was read from a figure


def front_answers(times, position, ratio=2.0, gravity=-10.0, kind="box"):
    """Times [T = t sqrt(2 g / a)] and fronts [a] of a column twice as high as wide, as a run would measure them."""
    shape = {"size": [A, 0.04, ratio * A]} if kind == "box" else {"radius": A / 2, "height": ratio * A}
    body = {"kind": kind, "center": [A / 2, 0.1, ratio * A / 2], **shape}
    series = pd.DataFrame({"time_s": np.array(times) / np.sqrt(ratio * 10.0 / A)})
    if position is not None:
        series["front_x_m"] = A * np.array(position)
    s = scenario(bodies=[body], gravity=[0, 0, gravity], reference="martin_moyce_front", duration=1.0)
    return answers(s, series, {})


def front_answer(times, position, **more):
    ((answer,), reasons) = front_answers(times, position, **more)
    assert reasons == []
    return answer


@pytest.mark.parametrize("shift", [0.0, 0.07, -0.3, 0.3])
@pytest.mark.parametrize("scale", [1.0, 1.04])
def test_a_front_as_published_but_late_and_too_far(shift, scale):
    """The clock's shift is found; what is too far by 4 % everywhere errs by less only as far as a shift can help."""
    t = np.concatenate([[-1.0], ROWS["T"] + shift, [9.0]])
    z = np.interp(t - shift, ROWS["T"], ROWS["Z"])
    answer = front_answer(t, scale * z)
    if scale == 1.0:
        last = ROWS[ROWS["T"] <= 3.33]["Z"].iloc[-1]
        assert answer.error == pytest.approx(0.0, abs=1e-9) and answer.measured == pytest.approx(last)
        assert f"clock shifted by {shift:+.2f}" in answer.measure and answer.reference == last
    else:
        assert 0.001 < answer.error <= 0.04 + 1e-9


def test_a_front_that_never_moves_errs_by_its_distance():
    """Whatever the shift: RMS of Z0 / Z - 1 over the rows from 0.84 to 3.33."""
    rows = ROWS[(ROWS["T"] >= 0.84) & (ROWS["T"] <= 3.33)]
    answer = front_answer([0.0, 5.0], [2.0, 2.0])
    assert answer.error == pytest.approx(np.sqrt(np.mean((2.0 / rows["Z"] - 1.0) ** 2)))
    assert answer.measured == pytest.approx(2.0) and len(rows) >= 10


def test_a_run_too_short_for_the_table_has_no_answer():
    top = ROWS["T"][ROWS["T"] <= 3.33].max()
    found, (reason,) = front_answers([0.0, top - 0.31], [1.0, 3.0])
    assert found == [] and reason.endswith("the table ends at T = 3.33, the run at T = 3.02")
    assert np.isfinite(front_answer([0.0, top - 0.29], [1.0, 3.0]).error)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"ratio": 2.05}, "the column has 2.05"),
        ({"ratio": 1.95}, "the column has 1.95"),
        ({"ratio": 1.5}, "the column has 1.5"),
        ({"ratio": 0.9}, "the column has 0.9"),
        ({"kind": "cylinder"}, "one column of a liquid in a box"),
        ({"gravity": 10.0}, "with gravity"),
        ({"gravity": 0.0}, "with gravity"),
    ],
)
def test_other_columns_are_compared_with_nothing(more, words):
    found, (reason,) = front_answers([0.0, 5.0], [1.0, 4.0], **more)
    assert found == [] and words in reason
    found, (reason,) = front_answers([0.0, 5.0], None)
    assert found == [] and "one column of a liquid in a box" in reason


def test_the_clock_runs_with_the_columns_own_proportions():
    """1 % too high is near enough, and its T counts with its own n^2."""
    answer = front_answer(ROWS["T"], ROWS["Z"], ratio=2.02)
    assert answer.error == pytest.approx(0.0, abs=1e-9)
