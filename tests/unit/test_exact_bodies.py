"""Bodies of expressions, of arrays and of functions: which particles, where, how fast, and what is refused."""

import json
import math

import numpy as np
import pytest

import fluidbench as fb
from fluidbench.errors import UserError
from fluidbench.native.pool import Pool
from fluidbench.native.process.placement import Placement
from fluidbench.native.scene import Scene
from fluidbench.scenario import Body, Scenario
from fluidbench.scenario.expression import evaluate
from fluidbench.scenario.layout import emitted, lay_out
from fluidbench.scenario.packed import Packed

from ..conftest import scenario

POINTS = np.array([[0.0, 1.0, 2.0], [3.0, -4.0, 0.5]])
BOX = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.1, 0.1, 0.1]}


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1", [1, 1]),
        ("x + 2*y - z/4", [1.5, -5.125]),
        ("-x**2", [0, -9]),
        ("2 ** 3 ** 2", [512, 512]),
        ("cos(pi * x)", [1, -1]),
        ("max(x, z) * min(1, y)", [2, -12]),
        ("max(x, y, z)", [2, 3]),
        ("(x > 1) + (z > 0)", [1, 2]),
        ("-(x > 1)", [0, -1]),
        ("x > 1", [0, 1]),
        ("0 < x <= 3 and not y > 0", [0, 1]),
        ("x < 1 or z < 1", [1, 1]),
        ("where(y < 0, 5, z)", [2, 5]),
        ("hypot(x, y)", [1, 5]),
        ("10**10**10", [math.inf, math.inf]),
    ],
)
def test_expressions(text, values):
    assert evaluate(text, POINTS) == pytest.approx(np.array(values, float))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("q + 1", "unknown name 'q'"),
        ("sinn(x)", "unknown function 'sinn'; did you mean 'sin'"),
        ("x +", "is no expression"),
        ("x; y", "is no expression"),
        ("__import__('os')", "unknown function '__import__'"),
        ("x.real", "is nothing that an expression may hold"),
        ("'a'", "is nothing that an expression may hold"),
        ("[x for x in y]", "is nothing that an expression may hold"),
        ("sin(x, y)", "sin: not with 2 arguments"),
        ("where(x, y)", "where: not with 2 arguments"),
        ("sin(x=1)", "is nothing that an expression may hold"),
        ("(lambda: 1)()", "is nothing that an expression may hold"),
        ("x" * 1001, "1001 characters; 1000 at most"),
        ("(" * 300 + "x" + ")" * 300, "is no expression"),
    ],
)
def test_what_is_no_expression(text, words):
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        evaluate(text, POINTS)
    with pytest.raises(UserError, match=r"bodies\.0\.where: "):
        scenario(bodies=[BOX | {"where": text}])


def test_arrays_keep_their_bits_through_json():
    values = np.random.default_rng(1).normal(size=(5, 3))
    packed = Packed(values)
    again = Packed(json.loads(json.dumps(packed.as_json())))
    assert again == packed and hash(again) == hash(packed) and np.array_equal(np.asarray(again), values)
    assert packed != Packed(values + 1e-12) and packed != values.tolist() and len(packed) == 5
    with pytest.raises(ValueError, match="read-only"):
        packed.array[0, 0] = 1.0


def test_a_field_of_velocities_is_added_and_counts_for_the_speed():
    field = ["10 * (x - 0.1)", "0", "sin(pi * (z - 0.1) / 0.1)"]
    s = scenario(bodies=[BOX | {"velocity": [0.5, 0, 0], "velocity_field": field}], gravity=[0, 0, 0])
    laid = lay_out(s.bodies[0], s)
    x, _, z = laid.position.T
    expected = np.stack([0.5 + 10 * (x - 0.1), 0 * x, np.sin(np.pi * (z - 0.1) / 0.1)], axis=1)
    assert laid.velocity == pytest.approx(expected) and len(x) == 1000
    fastest = math.hypot(0.5 + 10 * 0.045, math.sin(math.pi * 0.45))  # of the particles next to the corner
    assert s.reference_speed == pytest.approx(fastest, rel=1e-6)


def test_where_cuts_a_shape_and_leaves_each_particle_its_volume():
    s = scenario(bodies=[BOX | {"where": "z < 0.1 + 0.2 * (x - 0.1)"}])
    laid = lay_out(s.bodies[0], s)
    x, _, z = laid.position.T
    assert (z < 0.1 + 0.2 * (x - 0.1)).all() and laid.volume == pytest.approx(np.full(len(x), 1e-6))
    assert len(x) == emitted(s) == pytest.approx(500, abs=60)


def test_the_speed_of_a_field_is_that_of_its_particles():
    """A field of ten waves, whose nodes lie on any even grid: its crests are between them."""
    field = ["9 * sin(100 * pi * x)", "0", "0"]
    s = scenario(bodies=[BOX | {"velocity_field": field}])
    laid = lay_out(s.bodies[0], s)
    assert s.reference_speed == pytest.approx(np.linalg.norm(laid.velocity, axis=1).max()) == pytest.approx(9.0)


def test_points_are_taken_as_they_are(tmp_path):
    x = np.array([[0.05, 0.05, 0.05], [0.1, 0.12, 0.14], [0.5, 0.1, 0.1]])  # the last lies outside the domain
    v, w = np.arange(9.0).reshape(3, 3), np.array([1e-6, 1.5e-6, 1e-6])
    body = Body(kind="points", positions=x, velocities=v, volumes=w, velocity=(0.0, 0.0, 1.0))
    s = scenario(bodies=[body])
    assert Scenario.model_validate(json.loads(json.dumps(s.model_dump(mode="json")))) == s
    assert body.center == pytest.approx((0.275, 0.085, 0.095)) and body.extent == pytest.approx([0.225, 0.035, 0.045])
    # of those inside the domain, against sqrt(g H) and the gradient's none
    assert s.reference_speed == pytest.approx(np.linalg.norm([3, 4, 6]))
    laid = lay_out(body, s)
    assert laid.position == pytest.approx(x[:2]) and laid.volume == pytest.approx(w[:2])
    assert laid.velocity == pytest.approx(v[:2] + np.array([0.0, 0.0, 1.0]))
    scene = Scene(s)
    pool = Pool(scene, 2)
    Placement(s, pool)
    frame = pool.snapshot()
    assert frame["position"] == pytest.approx(x[:2]) and frame["mass"] == pytest.approx(1000 * w[:2])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"positions": [[0, 0]]}, r"positions have the shape \(n, 3\), got \(1, 2\)"),
        ({"positions": [[0.1, 0.1, math.nan]]}, "finite numbers"),
        ({"positions": "many"}, "an array of numbers is wanted"),
        ({"velocities": [[1, 2, 3], [4, 5, 6]]}, r"velocities have the shape \(1, 3\)"),
        ({"volumes": [1e-6, 1e-6]}, r"volumes have the shape \(1,\)"),
        ({"volumes": [-1e-6]}, "volumes must be positive"),
        ({"volumes": [1e-5]}, r"volumes span 10 \.\. 10 spacing\^3; a particle stands for one, within a factor of 2"),
        ({"positions": None}, "a points needs positions"),
        ({"size": [0.1, 0.1, 0.1]}, "size has no effect on kind = 'points'"),
        ({"start": 0.005, "velocities": [[1, 0, 0]]}, "moves as a whole"),
    ],
)
def test_what_is_wrong_with_points_is_said(change, words):
    table = {"kind": "points", "positions": [[0.1, 0.1, 0.1]], "center": [0.1, 0.1, 0.1]} | change
    with pytest.raises(UserError, match=words):
        scenario(bodies=[{key: value for key, value in table.items() if value is not None}])


def test_a_body_is_filled_by_functions():
    def ball(points):
        return np.linalg.norm(points - 0.1, axis=1) < 0.04

    body = fb.fill([0.05] * 3, [0.15] * 3, 0.01, inside=ball, velocity=lambda x: 2.0 * x, clamped=True)
    x = body.positions.array
    assert ball(x).all() and len(x) == 280 and body.clamped  # of 1,000, a ball of 4 spacings
    assert body.velocities.array == pytest.approx(2.0 * x) and body.volumes.array == pytest.approx(np.full(280, 1e-6))
    assert emitted(scenario(bodies=[body])) == 280
    assert len(fb.fill([0] * 3, [0.1] * 3, 0.01).positions) == 1000
    assert fb.fill(["0 mm"] * 3, np.full(3, 0.1), "1 cm") == fb.fill((0, 0, 0), [0.1] * 3, 0.01)
    assert fb.fill([0] * 3, [1.0] * 3, 0.5, velocity=lambda x: 2.0).velocities.array.tolist() == [[2.0] * 3] * 8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"spacing": 1e-9}, r"spacing = 1e-09 m: between the corners are 1e\+27 particles.*67108864 can be addressed"),
        ({"spacing": 1.0 / 407}, "6.74e.07 particles"),
        ({"spacing": 1e-320, "upper": [1e18] * 3}, "1e.54 particles"),
        ({"spacing": 0.0}, "spacing: a positive length is wanted"),
        ({"spacing": "5 kg"}, "spacing: '5 kg' is of another kind than m"),
        ({"spacing": "wide"}, "spacing: 'wide' is no number"),
        ({"spacing": math.nan}, "spacing: a finite number is wanted"),
        ({"spacing": True}, "spacing: true and false are no lengths"),
        ({"lower": [0, 0]}, "lower: three lengths are wanted"),
        ({"upper": [[1, 1, 1]]}, "upper: three lengths are wanted"),
        ({"upper": 1.0}, "upper: three lengths are wanted"),
        ({"upper": [1, 1, None]}, "upper: None is no number"),
        ({"upper": [1, -1, 1]}, "upper is to lie above lower; along y they are -1 and 0 m"),
        ({"lower": [0, 0, 1]}, "along z they are 1 and 1 m"),
        ({"inside": lambda x: x[:, 0] > 1}, "no point of the lattice is inside"),
        (
            {"inside": lambda x: x > 0.5},
            r"inside: values of shape \(n,\), n = 1000, .*got shape \(1000, 3\)",
        ),
        ({"inside": lambda x: x[:, 0] > 0 and x[:, 1] > 0}, "inside failed for points of shape .*truth value"),
        ({"inside": "x > 0"}, "inside: a function of points"),
        ({"velocity": lambda x: x[:, 0]}, r"velocity: values of shape \(n, 3\)"),
        ({"velocity": lambda x: "fast"}, r"velocity: values of shape .*\(got 'fast'\)"),
        ({"velocity": lambda x: x / 0.0}, "finite numbers"),
        ({"clampt": True}, "unknown key 'clampt'; did you mean 'clamped'"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_what_cannot_be_filled_is_said(change, words):
    with pytest.raises(UserError, match=f"^fill: .*?{words}"):
        fb.fill(**{"lower": [0, 0, 0], "upper": [1, 1, 1], "spacing": 0.1} | change)


def test_what_is_cut_is_not_compared_with_what_is_whole():
    whole = {"kind": "box", "center": [0.05, 0.1, 0.05], "size": [0.1, 0.2, 0.1]}
    assert "front_x_m" in fb.run(scenario(bodies=[whole], spacing=0.02), "mpm", progress=False).record.measures
    cut = scenario(bodies=[whole | {"where": "z < 0.05"}], spacing=0.02, reference="martin_moyce_front")
    record = fb.run(cut, "mpm", progress=False).record
    assert not record.answers and "it is of one column" in record.not_compared[0]


@pytest.mark.parametrize("text", ["max(x, y, z)", "min(z, y, x)", "abs(x) + hypot(y, z)", "where(x > 0, y, z)"])
def test_an_expression_leaves_the_places_alone(text):
    points = POINTS.copy()
    evaluate(text, points)
    assert np.array_equal(points, POINTS)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"where": "x > 100"}, "no place of it is inside the domain where it is to be"),
        ({"where": "log(-1) > 0"}, "no place of it is inside"),
        ({"velocity_field": ["log(-1)", "0", "0"]}, "it is no number somewhere in the body"),
        ({"velocity_field": ["1 / (x - x)", "0", "0"]}, "it is no number somewhere in the body"),
    ],
)
def test_a_body_that_is_none_is_refused(change, words):
    with pytest.raises(UserError, match=rf"bodies\.0.*{words}"):
        scenario(bodies=[BOX | change])


def test_only_real_numbers_are_packed():
    for wrong in (np.ma.masked_array([1.0, 2.0], [0, 1]), np.array([1j])):
        with pytest.raises(ValueError, match="masked and complex"):
            Packed(wrong)
