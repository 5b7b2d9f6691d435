"""Quantities as people write them, by hand: sizes, prefixes, powers, and what is of another kind."""

import math

import pytest

from fluidbench.errors import UserError
from fluidbench.scenario.library import define, load
from fluidbench.scenario.model import Model
from fluidbench.scenario.scenario import Scenario
from fluidbench.scenario.units import amount, in_si, unit

from ..conftest import bead


@pytest.mark.parametrize(
    ("text", "wanted", "value"),
    [
        ("20 mm", "m", 0.02),
        ("20mm", "m", 0.02),
        ("-3 cm", "m", -0.03),
        ("1.3 kPa", "Pa", 1300.0),
        ("0.5 MPa", "Pa", 5e5),
        ("2 GPa", "Pa", 2e9),
        ("1 bar", "Pa", 1e5),
        ("15 Pa s", "Pa s", 15.0),
        ("15 Pa*s", "Pa s", 15.0),
        ("15 Pa·s", "Pa s", 15.0),
        ("100 cP", "Pa s", 0.1),
        ("2100 kg/m^3", "kg/m^3", 2100.0),
        ("2.1 g/cm³", "kg/m^3", 2100.0),
        ("1.2 t/m**3", "kg/m^3", 1200.0),
        ("1200 mm/min", "m/s", 0.02),
        ("3 l/min", "m^3/s", 5e-5),
        ("3 m s^-1", "m/s", 3.0),
        ("9.81 m/s/s", "m/s^2", 9.81),
        ("5 %", "", 0.05),
        ("180 deg", "rad", math.pi),
        ("30 rpm", "rad/s", math.pi),
        ("2 min", "s", 120.0),
        ("1e3 mm", "m", 1.0),
        (".5 in", "m", 0.0127),
        ("7 1/s", "1/s", 7.0),
        ("4 Pa s^0.5", "Pa s^0.5", 4.0),
        ("4 kPa s^0.3", "Pa s^n", 4000.0),
        ("3 µm", "m", 3e-6),
    ],
)
def test_a_quantity_is_a_number_in_si(text, wanted, value):
    assert in_si(text, wanted) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("millimetres", [20, 12, 1.5, 0.1, 33.3, 7])
def test_a_length_in_millimetres_is_the_very_number_of_metres(millimetres):
    assert in_si(f"{millimetres} mm", "m") == float(f"{millimetres}e-3")


def test_an_amount_is_a_number_whatever_it_was_written_as():
    assert [amount(value, "m") for value in (0.02, 2, "0.02", "20 mm")] == [0.02, 2.0, 0.02, 0.02]
    for wrong in ("abc", None, "12 Pa"):
        with pytest.raises(ValueError, match=r"no number|another kind"):
            amount(wrong, "m")


def test_what_is_no_text_or_has_no_unit_stays_as_it_is():
    assert in_si(0.02, "m") == 0.02 and in_si("0.02", "m") == "0.02" and in_si("abc", "m") == "abc"
    assert in_si(None, "m") is None


@pytest.mark.parametrize(
    ("text", "wanted", "words"),
    [
        ("12 Pa", "m", "another kind than m"),
        ("12 mm", "", "a plain number"),
        ("12 Pa", "Pa s^n", "another kind"),
        ("4 Pa s^0.5", "Pa s^1", "another kind"),
        ("12 mn", "m", "no unit; did you mean"),
        ("12 m/", "m", "no unit"),
        ("12 m^^2", "m", "no unit"),
        ("12 km", "Pa", "another kind"),
    ],
)
def test_what_is_of_another_kind_is_refused(text, wanted, words):
    with pytest.raises(ValueError, match=words):
        in_si(text, wanted)


def test_every_unit_that_a_key_is_described_in_is_known():
    def models(model):
        for field in model.model_fields.values():
            parts = [field.annotation]
            while parts:
                part = parts.pop()
                parts += getattr(part, "__args__", ())
                if isinstance(part, type) and issubclass(part, Model):
                    yield part
                    yield from models(part)

    found = {
        (m, key): wanted for m in (Scenario, *models(Scenario)) for key in m.model_fields if (wanted := m.unit_of(key))
    }
    assert len(found) > 50
    for wanted in found.values():
        assert unit(wanted.removesuffix("^n"))[0] == 1.0, wanted


def test_a_scenario_in_millimetres_is_the_same_one():
    table = bead().model_dump(exclude_unset=True)
    plain = define("bead", **{k: v for k, v in table.items() if k != "name"})
    table["nozzle"] = {"diameter": "12 mm", "exit_speed": "100 mm/s", "standoff": f"{1e3 * plain.nozzle.standoff:g} mm"}
    table["domain"] = table["domain"] | {"lower": [f"{1e3 * x:g} mm" for x in plain.domain.lower]}
    table["spacing"] = f"{1e3 * plain.spacing:g} mm"
    written = define("bead", **{k: v for k, v in table.items() if k != "name"})
    assert written == plain and written.model_dump_json() == plain.model_dump_json()


def test_overrides_take_units_and_name_the_key_of_a_wrong_one():
    changed = load("line_bead", ["nozzle.diameter=12 mm", "material.yield_stress=0.06 kPa", "spacing=1.5mm"])
    assert changed == load("line_bead")
    with pytest.raises(UserError, match=r"nozzle\.diameter: '12 Pa' is of another kind than m"):
        load("line_bead", ["nozzle.diameter=12 Pa"])
    with pytest.raises(UserError, match=r"material\.plastic_viscosity: .* another kind than Pa s\^0\.5"):
        load("line_bead", ["material.plastic_viscosity=1 Pa s", "material.flow_index=0.5"])


def test_quick_coarsens_a_spacing_with_a_unit(tmp_path):
    """A file without a [quick] table gets a third more."""
    file = tmp_path / "a.toml"
    file.write_text('extends = "column_slump"\nspacing = "3 mm"\n')
    assert load(file).spacing == 0.003 and load(file, quick=True).spacing == pytest.approx(0.004)
