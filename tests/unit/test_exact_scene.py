"""What a scene holds: the phase table, walls, reach, force and dt."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.errors import UserError
from fluidbench.native.scene import (
    FRICTION,
    NEVER_YIELDS,
    PERIODIC,
    SLIP,
    STICK,
    Force,
    Scene,
    box_of,
    force_at,
    force_potential,
    is_solid,
    too_fast,
)

from ..conftest import scenario

wp.set_module_options({"enable_backward": False})

PASTE = {
    "density": 1000.0,
    "youngs_modulus": 2.6e4,
    "yield_stress": 50.0,
    "plastic_viscosity": 3.0,
    "flow_index": 0.5,
    "viscosity": 0.25,
}
NAMES = (
    "density",
    "bulk_modulus",
    "shear_modulus",
    "viscosity",
    "yield_stress",
    "plastic_viscosity",
    "flow_index",
    "relaxation_rate",
    "tait",
    "tension_limit",
    "wave_speed",
)


def rows(*materials, **more):
    """The phase table as {name: value} by row, world after world."""
    table = Scene([scenario(material=m, **more) for m in materials]).phases.numpy().ravel()
    return [{name: float(row[name]) for name in NAMES} for row in table]


def test_the_phase_of_a_paste():
    (row,) = rows(PASTE)
    k = 2.6e4 / (3 * 0.4)
    assert row == pytest.approx(
        {
            "density": 1000.0,
            "bulk_modulus": k,
            "shear_modulus": 1e4,
            "viscosity": 0.25,
            "yield_stress": 50.0,
            "plastic_viscosity": 3.0,
            "flow_index": 0.5,
            "relaxation_rate": 0.0,
            "tait": 0.0,
            "tension_limit": 1e30,
            "wave_speed": math.sqrt((k + 4e4 / 3) / 1000.0),
        }
    )


def test_the_phase_of_liquids():
    """A liquid cavitates; an Oldroyd-B liquid relaxes at 1 / lambda and holds together; neither yields."""
    (water,) = rows({"density": 1000.0, "equation_of_state": "tait"})
    c = 10 * math.sqrt(9.81 * 0.09)
    assert (water["tait"], water["tension_limit"], water["shear_modulus"]) == (1.0, 0.0, 0.0)
    assert water["wave_speed"] == pytest.approx(c) and water["bulk_modulus"] == pytest.approx(1000.0 * c**2)
    (oldroyd,) = rows({"density": 1000.0, "youngs_modulus": 2.6e4, "relaxation_time": 0.25})
    assert (oldroyd["relaxation_rate"], oldroyd["tension_limit"]) == (4.0, pytest.approx(1e30))
    (solid,) = rows({"density": 1000.0, "youngs_modulus": 2.6e4})
    assert solid["yield_stress"] == pytest.approx(1e30)


def test_cure_makes_a_row_a_level_and_worlds_follow_one_another():
    cure = {"kind": "stages", "time": 1.0, "stages": 4, "youngs_modulus": 5.2e4}
    table = rows(PASTE | {"cure": cure}, PASTE | {"cure": cure, "yield_stress": 70.0})
    assert len(table) == 10
    assert [row["shear_modulus"] for row in table[:5]] == pytest.approx([1e4, 1.25e4, 1.5e4, 1.75e4, 2e4])
    assert [row["yield_stress"] for row in table] == [50.0] * 5 + [70.0] * 5


def test_sounds_of_several_worlds_are_the_fastest():
    scene = Scene([scenario(gravity=[0, 0, -g]) for g in (1.0, 9.0, 4.0)])
    assert scene.sound_speed == scene.wave_speed == scene.top_wave_speed == pytest.approx(10 * math.sqrt(9.0 * 0.09))
    own = math.sqrt(1.0 * 0.09)  # of the first
    assert scene.top_speed == pytest.approx(3 * (scene.top_wave_speed + own)) == pytest.approx(scene.box.top_speed)
    hard = Scene(scenario(material=PASTE | {"cure": {"youngs_modulus": 4 * 2.6e4}}))
    assert hard.top_wave_speed == pytest.approx(2 * hard.wave_speed)


def test_worlds_may_differ_in_material_gravity_and_seed_only():
    Scene([scenario(), scenario(gravity=[0, 0, 0], body_force=[1, 0, 0], seed=2, name="b", title="t", material=PASTE)])
    with pytest.raises(UserError, match="world 2 differs in duration, spacing"):
        Scene([scenario(), scenario(), scenario(spacing=0.02, duration=0.02)])
    for section, value in (("cure", {"youngs_modulus": 1e5}), ("expansion", {"ratio": 2.0})):
        with pytest.raises(UserError, match=f"worlds must share material.{section}; world 1 differs"):
            Scene([scenario(material=PASTE), scenario(material=PASTE | {section: value})])


KINDS = {
    "liquid": ({"density": 1.0}, ()),
    "oil": ({"density": 1.0, "viscosity": 1.0}, ("viscous",)),
    "paste": ({"density": 1.0, "youngs_modulus": 9.0, "yield_stress": 1.0}, ("elastic",)),
    "solid": ({"density": 1.0, "youngs_modulus": 9.0}, ("elastic",)),
    "setting": (
        {"density": 1.0, "youngs_modulus": 9.0, "yield_stress": 1.0, "cure": {"yield_stress": 9.0, "viscosity": 1.0}},
        ("elastic", "viscous", "cures", "changes"),
    ),
    "growing": ({"density": 1.0, "expansion": {"ratio": 2.0}}, ("grows", "expands", "changes")),
    "spawning": ({"density": 1.0, "expansion": {"ratio": 2.0, "kind": "spawn"}}, ("expands", "changes")),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_scene_says_of_its_material(kind):
    material, true = KINDS[kind]
    scene = Scene(scenario(material=material))
    every = ("elastic", "viscous", "cures", "grows", "expands", "changes")
    assert tuple(name for name in every if getattr(scene, name)) == true
    assert scene.flows == (kind != "solid")
    assert Scene([scenario(), scenario(material=KINDS["oil"][0])]).viscous and scene.lanes == 1


def test_solid_is_what_never_flows():
    scene = Scene(scenario(material=PASTE))

    def solid(shear, stress, rate):
        made = type(scene._phase(scene.scenario, scene.scenario.material))()
        made.shear_modulus, made.yield_stress, made.relaxation_rate = shear, stress, rate
        return bool(is_solid(made))

    assert solid(5.0, 5.0, 0.0) and not solid(5.0, 4.9, 0.0) and not solid(5.0, 9.0, 0.1) and not solid(0.0, 5.0, 0.0)


def test_walls_are_laid_out_face_by_face():
    walls = {
        "x_lower": "stick",
        "x_upper": {"friction": 0.25},
        "y_lower": "periodic",
        "y_upper": "periodic",
        "z_lower": {"friction": 0.5},
        "z_upper": "slip",
    }
    s = scenario(domain={"lower": [0, -0.1, 0.01], "upper": [0.3, 0.1, 0.08], "walls": walls})
    box = box_of(s)
    assert list(box.lower) == pytest.approx([0, -0.1, 0.01]) and list(box.upper) == pytest.approx([0.3, 0.1, 0.08])
    assert list(box.lower_kind) == [STICK, PERIODIC, FRICTION] and list(box.upper_kind) == [FRICTION, PERIODIC, SLIP]
    assert list(box.lower_friction) == [0.0, 0.0, 0.5] and list(box.upper_friction) == [0.25, 0.0, 0.0]
    assert list(box.reach) == pytest.approx([0.08, 0.08, 0.07])  # eight spacings, or the domain where it is smaller
    assert Scene(s).periodic == (False, True, False) and len({SLIP, STICK, PERIODIC, FRICTION}) == 4


def test_the_force_field_on_the_device_is_the_scenarios():
    pull = [[-9.0, 1.0, 0.0], [1.0, -4.0, 0.0], [0.0, 0.0, -1.0]]
    s = scenario(body_force_gradient=pull, body_force_center=[0.1, 0.0, 0.05], body_force=[0.5, 0, 0])
    force = Scene(s).force.numpy()[0]
    x = np.array([0.12, 0.07, 0.02])
    expected = s.acceleration + np.array(pull) @ (x - [0.1, 0.0, 0.05])
    assert force["uniform"] + force["gradient"] @ x == pytest.approx(expected, rel=1e-6)
    field = Force()
    field.uniform, field.gradient = wp.vec3(*force["uniform"].tolist()), wp.mat33(*force["gradient"].ravel().tolist())
    assert list(force_at(field, wp.vec3(*x))) == pytest.approx(expected, rel=1e-6)
    h = 1e-3
    slope = [
        (force_potential(field, wp.vec3(*(x + h * e))) - force_potential(field, wp.vec3(*(x - h * e)))) / (2 * h)
        for e in np.eye(3)
    ]
    assert slope == pytest.approx(expected, rel=1e-4)
    assert force_potential(field, wp.vec3(0.0, 0.0, 0.0)) == 0.0


def test_what_is_too_fast():
    for v, fast in (
        ((3.0, 4.0, 0.0), False),
        ((3.0, 4.01, 0.0), True),
        ((math.nan, 0, 0), True),
        ((0, math.inf, 0), True),
    ):
        assert bool(too_fast(wp.vec3(*v), 5.0)) is fast


def test_a_step_of_time_is_positive_and_reaches_every_world():
    scene = Scene([scenario(), scenario(seed=1)])
    scene.set_dt(0.25)
    assert scene.dt.numpy().tolist() == [0.25, 0.25]
    scene.set_dt(0.5)
    assert scene.dt.numpy().tolist() == [0.5, 0.5]
    for dt in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="dt must be positive"):
            scene.set_dt(dt)


def test_matter_cavitates_at_the_tension_that_the_scenario_gives():
    """Else a liquid does at once, and what has strength never."""
    never = float(NEVER_YIELDS)
    paste = {"youngs_modulus": 1e4, "yield_stress": 50.0}
    for more, limit in (
        ({}, 0.0),
        (paste, never),
        ({"tension_limit": 80.0}, 80.0),
        (paste | {"tension_limit": 9.0}, 9.0),
    ):
        table = Scene(scenario(material={"density": 1000.0, **more})).phases.numpy()
        assert table["tension_limit"].ravel().tolist() == pytest.approx([limit])
