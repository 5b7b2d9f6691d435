"""What the manual says: every key of docs/scenario.md with its default, and the limits beyond which methods refuse."""

from pathlib import Path

import pytest

from fluidbench.registry import get_method
from fluidbench.scenario import Domain, Nozzle, Scenario, Walls
from fluidbench.scenario.body import Body
from fluidbench.scenario.collider import Collider, Part
from fluidbench.scenario.cure import Cure
from fluidbench.scenario.expansion import Expansion
from fluidbench.scenario.material import Material
from fluidbench.scenario.measured import Measured
from fluidbench.scenario.toolpath import Toolpath

from ..conftest import bead, scenario

MODELS = {
    "Top level": [Scenario],
    "[domain]": [Domain],
    "[domain.walls]": [Walls],
    "[material]": [Material],
    "[material.cure]": [Cure],
    "[material.expansion]": [Expansion],
    "[nozzle]": [Nozzle],
    "[toolpath]": [Toolpath],
    "[collider]": [Collider, Part],
    "[[measured]]": [Measured],
    "[[bodies]]": [Body],
    **{f"[numerics.{method}]": [get_method(method).Config] for method in ("mpm", "sph", "pbd")},
}
TABLES = {"cure", "expansion", "parts"}  # which have rows of their own
WORDS = {"none": None, "(empty)": "", "true": True, "false": False, "()": (), "{}": {}}


def documented():
    """{section: {key: default as it is written}}."""
    found, section = {}, None
    for line in (Path(__file__).parents[2] / "docs" / "scenario.md").read_text().splitlines():
        if line.startswith("## "):
            section = found.setdefault(line[3:], {})
        elif line.startswith("| `") and section is not None:
            key, default = (cell.strip() for cell in line.split("|")[1:3])
            section[key.strip("`")] = default
    return found


@pytest.mark.parametrize("section", MODELS)
def test_keys_and_defaults_are_as_documented(section):
    rows = documented()[section]
    fields = {key: field for model in MODELS[section] for key, field in model.model_fields.items()}
    assert rows.keys() == fields.keys() - TABLES
    for key, written in rows.items():
        field = fields[key]
        assert field.is_required() == (written == "required"), key
        if field.is_required() or written == "see below":
            continue
        if written in WORDS:
            assert field.default in (WORDS[written], written), key
        elif isinstance(field.default, str):
            assert field.default == written, key
        elif isinstance(field.default, tuple):
            assert field.default == tuple(float(v) for v in written.strip("()").split(",")), key
        else:
            assert field.default == pytest.approx(float(written), rel=1e-12), key


def test_every_section_of_the_manual_has_its_model():
    assert documented().keys() == MODELS.keys()


def moving(speed, **material):
    """A box that moves at this speed without gravity; 10 ticks of a quarter of a spacing and more."""
    body = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.08] * 3, "velocity": [speed, 0, 0]}
    return scenario(bodies=[body], gravity=[0, 0, 0], duration=0.1, material={"density": 1000.0, **material})


def refusal(method, made, **settings):
    solver = get_method(method)
    return solver.refuses(made, solver.Config(**settings))


def test_sph_refuses_what_moves_at_eight_tenths_of_its_sound_and_foam_at_three():
    assert refusal("sph", moving(0.79, sound_speed=1.0)) is None
    assert "0.81 m/s, too near its own sound (1 m/s)" in refusal("sph", moving(0.81, sound_speed=1.0))
    growth = {"ratio": 1.01, "time": 100.0}
    assert refusal("sph", moving(0.29, sound_speed=1.0, expansion=growth)) is None
    assert "too near its own sound" in refusal("sph", moving(0.31, sound_speed=1.0, expansion=growth))


def test_pbd_says_what_it_makes_of_a_material():
    solver = get_method("pbd")

    def words(**material):
        return [line.split(":")[0] for line in solver.approximates(moving(1.0, **material), solver.Config())]

    pressure, waves = "pressure is whatever keeps rho <= rho0", "elastic waves are damped"
    assert words() == [pressure]
    assert words(youngs_modulus=3e4) == [waves, pressure]
    tension = "isotropic tension is a density constraint's"
    assert words(viscosity=1e9) == [tension, pressure]
    assert words(youngs_modulus=3e4, yield_stress=10.0) == [waves, tension, pressure]


def test_pbd_refuses_a_solid_that_is_fed_in():
    """G = 6e3 / 2.9 = 2.07 kPa."""
    paste = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "plastic_viscosity": 1.0}
    assert refusal("pbd", bead(material=paste | {"yield_stress": 2.06e3})) is None
    words = refusal("pbd", bead(material=paste | {"yield_stress": 2.08e3}))
    assert "it yields at 2.08e+03 Pa, and its shear modulus is 2.07e+03 Pa" in words
    assert refusal("pbd", moving(1.0, youngs_modulus=6e3)) is None
