"""Moduli and material at any age by hand; shapes, bodies and the collider's distances."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from fluidbench.scenario.body import Body, Wave
from fluidbench.scenario.collider import Collider, Part
from fluidbench.scenario.cure import Cure
from fluidbench.scenario.expansion import Expansion
from fluidbench.scenario.material import Material

RHO = 800.0


def material(**more):
    return Material(**{"density": RHO, **more})


def test_shear_and_bulk_modulus_and_what_overrides_them():
    solid = material(youngs_modulus=5200.0, poisson_ratio=0.3)
    assert solid.shear_modulus == pytest.approx(2000.0) and solid.bulk(9.0) == pytest.approx(5200.0 / 1.2)
    assert material().shear_modulus == 0.0 and material().bulk(9.0) == pytest.approx(RHO * 81.0)
    assert material(sound_speed=5.0).bulk(9.0) == pytest.approx(RHO * 25.0)
    assert material(bulk_modulus=7e4).bulk(9.0) == 7e4
    assert material(youngs_modulus=5200.0, bulk_modulus=7e4).bulk(9.0) == 7e4
    assert material(youngs_modulus=5200.0, sound_speed=5.0).bulk(9.0) == pytest.approx(RHO * 25.0)


def test_wave_speed():
    assert material(bulk_modulus=RHO * 16.0).wave_speed(9.0) == pytest.approx(4.0)
    assert material().wave_speed(9.0) == pytest.approx(9.0)
    stiff = material(youngs_modulus=5200.0, poisson_ratio=0.3, bulk_modulus=6e3)
    assert stiff.wave_speed(9.0) == pytest.approx(math.sqrt((6e3 + 4.0 * 2000.0 / 3.0) / RHO))


def test_what_flows_and_what_never_does():
    """A solid yields not before a shear of 100 %, and does not relax; here G = 2000 Pa."""
    elastic = {"youngs_modulus": 5200.0, "poisson_ratio": 0.3}
    assert material().flow_threshold == 0.0 and not material().is_solid
    assert material(**elastic).flow_threshold == math.inf and material(**elastic).is_solid
    assert material(**elastic, yield_stress=60.0).flow_threshold == 60.0
    assert not material(**elastic, yield_stress=1999.0).is_solid and material(**elastic, yield_stress=2001.0).is_solid
    edge = {"youngs_modulus": 4.0, "poisson_ratio": 0.0}
    assert material(**edge, yield_stress=2.0).is_solid and not material(**edge, yield_stress=1.99).is_solid
    assert not material(**elastic, relaxation_time=0.1).is_solid


def test_whether_it_is_elastic_and_whether_it_changes():
    cure = Cure(youngs_modulus=1e4)
    assert not material().elastic and material(youngs_modulus=1.0).elastic
    assert material(sound_speed=9.0, cure=cure).elastic and not material(cure=Cure(viscosity=9.0)).elastic
    assert not material().changes and material(cure=Cure(viscosity=9.0)).changes
    assert material(expansion=Expansion(ratio=2.0)).changes


def test_material_at_a_degree_a_level_and_an_age():
    foam = material(
        youngs_modulus=1e3,
        viscosity=2.0,
        cure=Cure(kind="stages", delay=2.0, jitter=0.5, time=4.0, stages=4, youngs_modulus=9e3, viscosity=10.0),
        expansion=Expansion(kind="spawn", ratio=4.0, passes=2, delay=1.0, jitter=0.25, interval=1.0),
    )
    assert (foam.at().density, foam.at().youngs_modulus, foam.at().viscosity) == (RHO, 1e3, 2.0)
    half = foam.at(0.5, 4.0)
    assert (half.density, half.youngs_modulus, half.viscosity) == pytest.approx((RHO / 4.0, 5e3, 6.0))
    assert [m.youngs_modulus for m in foam.levels()] == pytest.approx([1e3, 3e3, 5e3, 7e3, 9e3])
    never = material(youngs_modulus=1e3, cure=Cure(yield_stress=50.0))  # fresh it does not yield: not at 0 Pa
    assert [m.yield_stress for m in never.levels()] == [None, 50.0] and never.at(0.5).yield_stress == 25.0
    assert {m.density for m in foam.levels()} == {RHO} and len(material().levels()) == 1
    # Jitter counts as early: stages at 2.5, 3.5, ... and passes at 0.75, 1.75 s.
    aged = foam.by_age([0.7, 0.8, 1.7, 1.8, 2.4, 2.6, 5.4, 5.6])
    assert [RHO / m.density for m in aged] == pytest.approx([1, 2, 2, 4, 4, 4, 4, 4])
    assert [m.youngs_modulus for m in aged] == pytest.approx([1e3, 1e3, 1e3, 1e3, 1e3, 3e3, 7e3, 9e3])
    assert [m.density for m in material().by_age([0.0, 9.0])] == [RHO, RHO]


CURE = {"delay": 1.0, "youngs_modulus": 1e4}
HARDENS = {"hardening": 9.0, "saturated_yield_stress": 0.2}
WRONG = [
    ({"sound_speed": 1.0, "bulk_modulus": 1.0}, "not both"),
    ({"yield_stress": 1.0}, "need youngs_modulus"),
    ({"relaxation_time": 1.0}, "need youngs_modulus"),
    ({"youngs_modulus": 1.0, "relaxation_time": 1.0, "yield_stress": 1.0}, "Oldroyd-B"),
    ({"youngs_modulus": 1.0, "relaxation_time": 1.0, "plastic_viscosity": 0.1}, "Oldroyd-B"),
    ({"youngs_modulus": 1.0, "plastic_viscosity": 0.1}, "needs yield_stress"),
    ({"youngs_modulus": 1.0, "relaxation_time": 1.0, "cure": CURE}, "cannot cure"),
    ({"youngs_modulus": 1.0, "cure": CURE, "expansion": {"ratio": 2.0, "delay": 1.1}}, "comes before"),
    ({"cure": {"yield_stress": 1.0}}, "needs a youngs_modulus"),
    ({"cure": CURE}, "needs bulk_modulus or sound_speed"),
    ({"youngs_modulus": 1.0, "yield_stress": 0.1, "hardening": 9.0}, "belong together"),
    ({"youngs_modulus": 1.0, "yield_stress": 0.1, "saturated_yield_stress": 0.2}, "belong together"),
    ({"youngs_modulus": 1.0, "hardening": 9.0, "saturated_yield_stress": 0.2}, "needs a yield_stress above 0"),
    ({"youngs_modulus": 1.0, "yield_stress": 0.3} | HARDENS, "fresh, .* = 0.2 lies below yield_stress = 0.3"),
    ({"youngs_modulus": 1.0, "yield_stress": 0.1, "cure": {"yield_stress": 0.3}} | HARDENS, "cured, .* = 0.2 lies"),
    ({"youngs_modulus": 1.0, "yield_stress": 0.1, "cure": {"saturated_yield_stress": 0.3}}, "needs hardening"),
    ({"poisson_ratio": -1.0}, "greater than -1"),
    ({"poisson_ratio": 0.5}, "less than 0.5"),
    ({"density": 0.0}, "greater than 0"),
    ({"viscosity": -1.0}, "greater than or equal to 0"),
    ({"flow_index": 0.0}, "greater than 0"),
]


@pytest.mark.parametrize(("table", "words"), WRONG)
def test_materials_that_make_no_sense_are_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        material(**table)


def test_materials_at_the_edge_of_sense_are_accepted():
    assert material().poisson_ratio == 0.3 and material().flow_index == 1.0 and material().viscosity == 0.0
    assert material().plastic_viscosity == 0.0 and material().equation_of_state == "linear"
    material(youngs_modulus=1.0, relaxation_time=1.0)
    material(youngs_modulus=1.0, yield_stress=0.0, plastic_viscosity=1.0)
    material(youngs_modulus=1.0, cure=CURE, expansion={"ratio": 2.0, "delay": 1.0})
    material(youngs_modulus=1.0, cure={"yield_stress": 1.0})
    material(bulk_modulus=1e4, cure={"youngs_modulus": 1e4, "yield_stress": 1.0})
    material(sound_speed=10.0, cure=CURE)
    material(cure={"viscosity": 10.0})
    assert material(youngs_modulus=1.0, yield_stress=0.1, **HARDENS).strength == 0.2
    assert material(youngs_modulus=1.0, yield_stress=0.2, **HARDENS).flow_threshold == 0.2
    assert material(poisson_ratio=-0.99).poisson_ratio == -0.99


BOX = {"kind": "box", "center": (1.0, 2.0, 3.0), "size": (2.0, 4.0, 6.0)}
CYLINDER = {"kind": "cylinder", "center": (1.0, 2.0, 3.0), "radius": 2.0, "height": 5.0}
SPHERE = {"kind": "sphere", "center": (1.0, 2.0, 3.0), "radius": 3.0}


@pytest.mark.parametrize(
    ("shape", "extent", "volume"),
    [(BOX, [1, 2, 3], 48.0), (CYLINDER, [2, 2, 2.5], 20 * math.pi), (SPHERE, [3, 3, 3], 36 * math.pi)],
)
def test_extent_and_volume(shape, extent, volume):
    assert Body(**shape).extent.tolist() == extent and Body(**shape).volume == pytest.approx(volume)


def test_velocity_is_the_sum_of_its_parts():
    gradient = ((1.0, 2.0, 0.0), (0.0, -1.0, 3.0), (4.0, 0.0, 0.5))
    wave = Wave(amplitude=(0.0, 0.5, 0.25), number=(2.0, 0.0, 1.0), phase=0.3)
    body = Body(**BOX, velocity=(10, 20, 30), velocity_gradient=gradient, angular_velocity=(0.1, 0.2, 0.3), wave=wave)
    arm = np.array([0.5, -1.0, 2.0])
    turn = [0.2 * 2.0 - 0.3 * -1.0, 0.3 * 0.5 - 0.1 * 2.0, 0.1 * -1.0 - 0.2 * 0.5]
    strain = [0.5 - 2.0, 1.0 + 6.0, 2.0 + 1.0]
    crest = math.sin(2.0 * 0.5 + 2.0 + 0.3)
    expected = np.array([10, 20, 30]) + turn + strain + crest * np.array([0.0, 0.5, 0.25])
    assert body.velocity_at(arm[None] + [1, 2, 3])[0] == pytest.approx(expected)
    assert Wave(amplitude=(1, 0, 0), number=(1, 0, 0)).at(np.array([[0.0, 5, 5]]))[0].tolist() == [0, 0, 0]


def test_top_speed_is_that_of_the_fastest_corner_plus_the_crest():
    assert Body(**BOX, velocity=(3, 4, 0)).top_speed == pytest.approx(5.0)
    assert Body(**BOX, angular_velocity=(0, 0, 2)).top_speed == pytest.approx(2 * math.hypot(1, 2))
    assert Body(**BOX, angular_velocity=(2, 0, 0)).top_speed == pytest.approx(2 * math.hypot(2, 3))
    assert Body(**BOX, angular_velocity=(0, 2, 0)).top_speed == pytest.approx(2 * math.hypot(1, 3))
    stretch = ((1.0, 0, 0), (0, 0, 0), (0, 0, 0))
    for axis in range(3):  # backwards too, about whatever centre
        back, grow = np.zeros(3), np.zeros((3, 3))
        back[axis], grow[axis, axis] = -3.0, 1.0
        assert Body(**BOX, velocity=back, velocity_gradient=grow).top_speed == pytest.approx(3.0 + [1, 2, 3][axis])
    assert Body(**BOX, velocity=(3, 4, 0), velocity_gradient=stretch).top_speed == pytest.approx(math.hypot(4, 4))
    wave = Wave(amplitude=(0.3, 0.4, 0.0), number=(1, 1, 1))
    assert Body(**BOX, velocity=(3, 4, 0), wave=wave).top_speed == pytest.approx(5.5)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({**BOX, "size": None}, "a box needs size"),
        ({**BOX, "size": (1, 1, 0)}, "size must be positive"),
        ({**CYLINDER, "radius": None, "height": None}, "a cylinder needs radius and height"),
        ({**SPHERE, "radius": None}, "a sphere needs radius"),
        ({**BOX, "radius": 1.0}, "radius has no effect"),
        ({**SPHERE, "height": 1.0}, "height has no effect"),
        ({**CYLINDER, "size": (1, 1, 1)}, "size has no effect"),
        ({**BOX, "start": -1.0}, "greater than or equal to 0"),
        ({**BOX, "start": 1.0, "angular_velocity": (0, 0, 1)}, "appears later"),
        ({**BOX, "start": 1.0, "velocity_gradient": ((1, 0, 0), (0, 0, 0), (0, 0, 0))}, "appears later"),
        ({**BOX, "start": 1.0, "wave": {"amplitude": (1, 0, 0), "number": (1, 0, 0)}}, "appears later"),
    ],
)
def test_bodies_that_make_no_sense_are_refused(table, words):
    with pytest.raises(ValidationError, match=words):
        Body(**table)


def test_defaults_of_a_body():
    body = Body(**BOX)
    assert Body(**{**BOX, "size": (0.1, 0.2, 0.3)}).volume == pytest.approx(0.006)
    assert body.start == 0.0 and not body.clamped and body.velocity == body.angular_velocity == (0, 0, 0)
    assert Body(**BOX, start=1.0, velocity=(1, 0, 0)).start == 1.0
    assert Body(**BOX, angular_velocity=(0, 0, 1), velocity_gradient=((1, 0, 0), (0, 0, 0), (0, 0, 0)))


def test_distance_from_a_box_a_sphere_and_from_both():
    box = Part(kind="box", center=(1, 0, 0), size=(2, 4, 6))
    points = np.array([[3, 0, 0], [5, 6, 0], [4, 6, 15], [1, 0, 0], [1.5, 0, 0], [1, 1.9, 0], [-1, 0, 2.0]], float)
    assert box.distance(points) == pytest.approx([1, 5, 12.80625, -1, -0.5, -0.1, 1], abs=1e-5)
    ball = Part(kind="sphere", center=(0, 0, 4), radius=2.0)
    assert ball.distance(points[:4]) == pytest.approx([3, 77**0.5 - 2, 173**0.5 - 2, 17**0.5 - 2])
    assert box.half.tolist() == [1, 2, 3] and ball.half.tolist() == [2, 2, 2]
    both = Collider(parts=(box, ball), clearance=0.5)
    for point in points:
        lowered = point[None] - [0, 0, 0.5]
        assert both.distance(point[None])[0] == min(box.distance(lowered)[0], ball.distance(lowered)[0])
    assert both.distance(np.array([[0, 0, 8.0], [5, 0, 0.5]])) == pytest.approx([1.5, 3.0])


def test_parts_that_make_no_sense_are_refused_and_defaults():
    for table in ({"kind": "box"}, {"kind": "box", "size": (1, 1, 0)}):
        with pytest.raises(ValidationError, match="a box needs size"):
            Part(center=(0, 0, 0), **table)
    with pytest.raises(ValidationError, match="radius has no effect"):
        Part(kind="box", center=(0, 0, 0), size=(1, 1, 1), radius=1.0)
    with pytest.raises(ValidationError, match="size has no effect"):
        Part(kind="sphere", center=(0, 0, 0), size=(1, 1, 1), radius=1.0)
    with pytest.raises(ValidationError, match="at least 1 item"):
        Collider(parts=())
    with pytest.raises(ValidationError, match="a sphere needs radius"):
        Part(kind="sphere", center=(0, 0, 0))
    assert Part(kind="box", center=(0, 0, 0), size=(0.1, 0.2, 0.3)).half == pytest.approx([0.05, 0.1, 0.15])
    ball = Part(kind="sphere", center=(0, 0, 4), radius=2.0)
    assert Collider(parts=(ball,)).friction == 0.3 and Collider(parts=(ball,)).clearance == 0.0
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        Collider(parts=(ball,), friction=-0.1)
