"""Published answers beside measures that are made to agree, or to be wrong by a known amount."""

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure.reference import answers, table
from fluidbench.process.stream import Stream

from ..conftest import bead, scenario


def emission_answers(s, final, until):
    return {a.quantity: a for a in answers(s, pd.DataFrame({"time_s": [0.0, until / 2, until]}), final)}


def test_emitted_mass_is_judged_in_discs():
    """rho Q t to the last sample; a disc is rho times the nozzle's area times a spacing."""
    s = bead(duration=0.4)
    disc = 1000.0 * np.pi * 0.006**2 * 0.002
    expected = 1000.0 * np.pi * 0.006**2 * 0.1 * 0.2
    (answer,) = answers(s, pd.DataFrame({"time_s": [0.0, 0.2]}), {"mass_kg": expected - 0.4 * disc})
    assert answer.quantity == "emitted mass [kg]" and answer.measured == expected - 0.4 * disc
    assert answer.reference == pytest.approx(expected) and answer.error == pytest.approx(0.4)
    late = emission_answers(s, {"mass_kg": 0.0}, 0.4)["emitted mass [kg]"]  # the path of 0.03 m ended at 0.3 s
    assert late.reference == pytest.approx(1.5 * expected) and late.error == pytest.approx(15.0)
    assert Stream(s).volume * len(Stream(s).offsets) == pytest.approx(disc / 1000.0)


def test_the_beads_section_is_what_is_fed_over_how_fast_it_is_laid():
    s = bead(duration=0.4, toolpath={"start": [0, 0], "end": [0.03, 0], "speed": 0.05})
    area = np.pi * 0.006**2 * 0.1 / 0.05
    found = emission_answers(s, {"mass_kg": 0.0, "bead_area_m2": 1.07 * area}, 0.4)["bead area [m^2]"]
    assert found.reference == pytest.approx(area) and found.error == pytest.approx(0.07)
    assert found.measured == 1.07 * area and found.measure == "relative" and found.source == "Q / V"
    thin = emission_answers(s, {"mass_kg": 0.0, "bead_area_m2": 0.9 * area}, 0.4)["bead area [m^2]"]
    assert thin.error == pytest.approx(0.1)


def test_the_section_of_foam_has_grown_by_the_mean_over_its_ages():
    """R = 1 + 3 (1 - exp(-t / 0.5)) from 0.02 s on, averaged over material 0.1 to 0.4 s old."""
    material = {"density": 100.0, "expansion": {"ratio": 4.0, "time": 0.5, "delay": 0.02}}
    s = bead(material=material, duration=0.4)
    ages = np.linspace(0.1, 0.4, 20001)
    grown = np.mean(4.0 - 3.0 * np.exp(-(ages - 0.02) / 0.5))
    found = emission_answers(s, {"mass_kg": 0.0, "bead_area_m2": 1.0}, 0.4)["bead area [m^2]"]
    assert found.reference == pytest.approx(np.pi * 0.006**2 * grown, rel=2e-3) and found.source == "R Q / V"


def test_pauses_lay_no_foam():
    """Two layers of 0.3 s with 0.6 s between them: the mean of R runs over what was laid, not over the pause."""
    material = {"density": 100.0, "expansion": {"ratio": 4.0, "time": 0.2}}
    path = {"kind": "wall", "start": [0, 0], "end": [0.03, 0], "speed": 0.1, "layers": 2, "layer_height": 0.004,
            "pause": 0.6}  # fmt: skip
    s = bead(material=material, duration=1.2, toolpath=path)
    ages = np.concatenate([np.linspace(0.9, 1.2, 1001), np.linspace(0.0, 0.3, 1001)])
    grown = np.mean(4.0 - 3.0 * np.exp(-ages / 0.2))
    found = emission_answers(s, {"mass_kg": 0.0, "bead_area_m2": 1.0}, 1.2)["bead area [m^2]"]
    assert found.reference == pytest.approx(np.pi * 0.006**2 * grown, rel=0.006)


def slump_answer(tau, slump, **more):
    """A cylinder of height 0.08 m; 1000 kg/m^3 and 10 m/s^2 make tau' = yield_stress / 800."""
    body = {"kind": "cylinder", "center": [0.1, 0.1, 0.04], "radius": 0.02, "height": 0.08}
    material = {"density": 1000.0, "youngs_modulus": 1e5, "yield_stress": 800.0 * tau}
    s = scenario(bodies=[body], material=material, gravity=[0, 0, -10.0], reference="viscoplastic_slump", **more)
    return answers(s, pd.DataFrame({"time_s": [0.0, 1.0]}), {"slump": slump})


@pytest.mark.parametrize(
    ("tau", "expected", "inside"),
    [
        (0.05, 0.611, True),  # one computation alone
        (0.1, (0.524 + 0.534) / 2, True),  # the mean of both
        (0.15, ((0.524 + 0.534) / 2 + 0.325) / 2, True),
        (0.3, 0.122, True),
        (0.25, (0.325 + 0.122) / 2, True),
        (0.04, 0.611, False),
        (0.31, 0.122, False),
    ],
)
def test_slump_is_compared_at_its_own_yield_number(tau, expected, inside):
    (answer,) = slump_answer(tau, 0.4)
    assert answer.reference == pytest.approx(expected) and answer.error == pytest.approx(abs(0.4 - expected))
    assert answer.measured == 0.4 and (answer.measure == "absolute") is inside
    assert answer.quantity == f"slump at tau' = {tau:.3g}"


def test_a_liquid_has_a_yield_number_of_zero():
    body = {"kind": "cylinder", "center": [0.1, 0.1, 0.04], "radius": 0.02, "height": 0.08}
    s = scenario(bodies=[body], reference="viscoplastic_slump")
    (answer,) = answers(s, pd.DataFrame({"time_s": [0.0, 1.0]}), {"slump": 0.5})
    assert answer.quantity == "slump at tau' = 0" and answer.reference == pytest.approx(0.611)


def test_no_slump_without_a_reference_or_a_measure():
    s = scenario(reference="viscoplastic_slump")
    assert answers(s, pd.DataFrame({"time_s": [0.0]}), {}) == []
    assert answers(scenario(), pd.DataFrame({"time_s": [0.0], "front_x_m": [0.1]}), {"slump": 0.4}) == []


A = 0.05
ROWS = table("dam_break_martin_moyce_front_n2_2")
ROWS = ROWS[ROWS["kind"] == "table"]  # not what was read from a figure


def front_answer(times, position):
    """Times [T = t sqrt(2 g / a)] and fronts [a] of a column twice as high as wide, as a run would measure them."""
    body = {"kind": "box", "center": [A / 2, 0.1, A], "size": [A, 0.04, 2 * A]}
    series = pd.DataFrame({"time_s": np.array(times) / np.sqrt(2 * 10.0 / A), "front_x_m": A * np.array(position)})
    (answer,) = answers(scenario(bodies=[body], gravity=[0, 0, -10.0], reference="martin_moyce_front"), series, {})
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
    assert np.isnan(front_answer([0.0, top - 0.31], [1.0, 3.0]).error)
    short = front_answer([0.0, top - 0.31], [1.0, 3.0])
    assert np.isnan(short.measured) and short.reference == 0.0 and short.measure == "run too short for the table"
    assert np.isfinite(front_answer([0.0, top - 0.29], [1.0, 3.0]).error)
