"""Numbers of the input, and methods as the toolkit sees them: demands, refusals, settings."""

import math
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from pydantic import ValidationError

from fluidbench.errors import UserError
from fluidbench.method.contract import Config
from fluidbench.method.features import Feature, needed
from fluidbench.method.suitability import Demands, approximations, check_backend, refusal
from fluidbench.method.target import Target
from fluidbench.method.timestep import Bound
from fluidbench.registry import get_method
from fluidbench.scenario.model import Model, NonNegative, Positive, Vector, check_number, check_size
from fluidbench.scenario.numerics import configure

from ..conftest import bead, scenario


class Numbers(Model):
    positive: Positive = 1.0
    some: NonNegative = 0.0
    place: Vector = (0.0, 0.0, 0.0)
    flag: bool = False


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("positive", (1e-18, 1e18, 1), (0.0, -1.0, 0.99e-18, 1.01e18, math.inf, math.nan, True)),
        ("some", (0.0, 1e-18, 1e18), (-1e-300, 0.99e-18, 1.01e18, False)),
        (
            "place",
            ([0, 1e18, -1e18], [1.3e-38, 0, 0], [-1.3e-38, 0, 0]),
            ([0, 1.01e18, 0], [0, 0, -1.01e18], [1.1e-38, 0, 0], [-1.1e-38, 0, 0], [math.nan, 0, 0], [True, 0, 0]),
        ),
        ("flag", (True, False), ("x",)),
    ],
)
def test_numbers_are_those_that_single_precision_can_square(key, good, bad):
    for value in good:
        Numbers(**{key: value})
    for value in bad:
        with pytest.raises(ValidationError):
            Numbers(**{key: value})


def test_numbers_beyond_reason_are_named():
    with pytest.raises(ValueError, match=r"^1.5e\+18 is beyond any physics; 1e\+18 is the most"):
        check_number(1.5e18)
    with pytest.raises(ValueError, match="a number of over 300 digits is beyond"):
        check_number(-(10**300))
    with pytest.raises(ValueError, match=r"a finite number is wanted \(got nan\)"):
        check_number(math.nan)
    check_number(-1e18)
    assert check_size(0.0) == 0.0 == check_size(-0.0) and check_size(1e-18) == 1e-18 and check_size(-1e-30) == -1e-30
    with pytest.raises(ValueError, match="1e-18 is the least that can be computed with"):
        check_size(9.9e-19)


def test_copies_forget_what_was_derived():
    s = scenario()
    assert s.reference_speed == s.model_copy().reference_speed
    faster = s.model_copy(update={"gravity": (0.0, 0.0, -4 * 9.81)})
    assert faster.reference_speed == pytest.approx(2 * s.reference_speed)
    assert s.replace(spacing=0.02).spacing == 0.02 and s.spacing == 0.01
    numbers = Numbers()
    assert numbers.replace(some=2.0) == Numbers(some=2.0) and numbers.some == 0.0
    with pytest.raises(UserError, match="numbers: some: "):
        numbers.replace(some=-1.0)


# --- methods as the toolkit sees them


class Paced:
    """A method whose only bound is a constant over the wave speed."""

    name, features, dt = "paced", frozenset(Feature), 1.0
    lacking: ClassVar = {"taichi": frozenset({Feature.YIELD})}
    Config: ClassVar = Config

    @classmethod
    def bounds(cls, s, config, speed):
        return [Bound("slow", 9e9, "", ""), Bound("waves", cls.dt / s.wave_speed, "", "")]

    @classmethod
    def refuses(cls, s, config):
        return "its own reason"

    @classmethod
    def approximates(cls, s, config):
        return ["a little"]


def soft_then_stiff(**more):
    cure = {"kind": "linear", "time": 0.005, "youngs_modulus": 4e4}
    return scenario(material={"density": 1000.0, "youngs_modulus": 1e4, "cure": cure}, **more)


def test_demands_are_the_fresh_material_and_the_stiffest_so_far():
    """Ages are a 64th of 10 ms apart; the modulus grows from 1 to 4 in the first half."""
    demands = Demands(Paced, soft_then_stiff(), None)
    assert len(demands.ages) == 65 and demands.worst().material.youngs_modulus == pytest.approx(4e4)

    def moduli(time):
        return [s.material.youngs_modulus for s in demands.until(time)]

    assert moduli(0.0) == [1e4] and moduli(1e-9) == pytest.approx([1e4, 1e4 * (1 + 3 / 32)], rel=0.02)
    half = demands.ages[16]
    assert moduli(half) == pytest.approx([1e4, 2.5e4], rel=0.02) and moduli(half + 1e-6)[1] > moduli(half)[1]
    assert moduli(0.005) == moduli(0.01) == moduli(9.0) == pytest.approx([1e4, 4e4])
    softer = {"kind": "linear", "time": 0.005, "youngs_modulus": 1e3}
    fresh = Demands(Paced, scenario(material={"density": 1000.0, "youngs_modulus": 1e4, "cure": softer}), None)
    assert fresh.worst().material.youngs_modulus == 1e4 and len(fresh.until(9.0)) == 1
    assert [s.material for s in Demands(Paced, scenario(), None).until(1.0)] == [scenario().material]


def lossy(share, speed):
    """Paced at a dt that loses this share of a speed in a domain that reaches to 0.2 m."""
    half = 0.5 * float(np.spacing(np.float32(0.2)))
    body = {"kind": "box", "center": [0.1] * 3, "size": [0.08] * 3, "velocity": [speed, 0, 0]}
    s = scenario(bodies=[body], gravity=[0, 0, 0], material={"density": 1.0, "sound_speed": 100.0})
    return type("Lossy", (Paced,), {"dt": 100.0 * half / (share * speed)}), s


def test_a_step_that_loses_a_tenth_of_the_speed_is_refused_and_a_hundredth_is_told():
    for share, lost in ((0.101, True), (0.099, False)):
        method, s = lossy(share, 2.0)
        assert ("too small for single precision" in refusal(method, s, None)) is lost
    assert "(bound 'waves')" in refusal(*lossy(0.2, 2.0), None)
    still, s = lossy(9.0, 1e-3)
    assert refusal(still, s, None) == "its own reason"  # nothing moves, so nothing can be lost
    assert [len(approximations(*lossy(share, 2.0), None)) for share in (0.0101, 0.0099)] == [2, 1]
    assert approximations(*lossy(0.02, 2.0), None) == [
        "a little",
        "motion slower than 0.04 m/s is lost in single precision at this time step",
    ]


SOLID = {"density": 1000.0, "youngs_modulus": 1e4}
BOX = {"kind": "box", "center": [0.05] * 3, "size": [0.08] * 3}
ASKS = {
    Feature.VISCOSITY: {"material": {"density": 1000.0, "viscosity": 1.0}},
    Feature.ELASTICITY: {"material": SOLID},
    Feature.YIELD: {"material": SOLID | {"yield_stress": 9.0}},
    Feature.RELAXATION: {"material": SOLID | {"relaxation_time": 0.1}},
    Feature.FRICTION: {"domain": {"lower": [0] * 3, "upper": [0.2] * 3, "walls": {"z_lower": {"friction": 0.3}}}},
    Feature.PERIODIC: {
        "domain": {"lower": [0] * 3, "upper": [0.2] * 3, "walls": {"x_lower": "periodic", "x_upper": "periodic"}}
    },
    Feature.CURE: {"material": SOLID | {"cure": {"delay": 1.0, "youngs_modulus": 2e4}}},
    Feature.EXPANSION: {"material": SOLID | {"expansion": {"ratio": 2.0}}},
    Feature.CLAMP: {"bodies": [BOX | {"clamped": True}]},
    Feature.LATER: {"bodies": [BOX, BOX | {"center": [0.15] * 3, "start": 0.005}]},
    Feature.FIELD: {"body_force_gradient": np.diag([-1.0] * 3).tolist()},
}
PRESSING = {"diameter": 0.012, "exit_speed": 0.1, "standoff": 0.010, "tip": "flat"}
PRINTS = {
    Feature.EMISSION: {},
    Feature.TIP: {"domain": {"lower": [-0.1, -0.1, 0.0], "upper": [0.3, 0.1, 0.4]}, "nozzle": PRESSING},
    Feature.COLLIDER: {"collider": {"parts": [{"kind": "sphere", "center": [0.0, 0.0, 0.03], "radius": 0.005}]}},
}


@pytest.mark.parametrize("feature", Feature, ids=lambda f: f.name)
def test_what_a_method_cannot_do_is_refused_by_name(feature):
    """One feature less than all: only what needs it is refused."""
    lacks = type("Lacks", (Paced,), {"features": frozenset(Feature) - {feature}})
    for asked, table in (ASKS | PRINTS).items():
        s = bead(**table) if asked in PRINTS else scenario(**table)
        refused = feature is asked or feature in needed(s)
        assert (refusal(lacks, s, None) == f"it has no {feature.value}") is refused
        assert asked in needed(s)
    assert refusal(lacks, scenario(), None) == "its own reason"


def test_all_that_a_method_lacks_is_listed_in_order():
    plain = type("Plain", (Paced,), {"features": frozenset()})
    both = SOLID | {"expansion": {"ratio": 2.0}, "cure": {"delay": 1.0, "youngs_modulus": 2e4}}
    assert refusal(plain, scenario(material=both), None) == (
        "it has no elastic shear stress and no material parameters that change with age and no rest volumes that grow"
    )
    assert needed(scenario()) == frozenset() and refusal(plain, scenario(), None) == "its own reason"
    assert needed(scenario(material=SOLID)) == {Feature.ELASTICITY}


def test_what_a_method_lacks_in_one_language_is_refused_there_alone():
    yields = bead()
    assert refusal(Paced, yields, None) == "its own reason"
    assert refusal(Paced, yields, None, Target(backend="taichi")) == "it has no yield stress on the backend taichi"
    assert refusal(Paced, scenario(), None, Target(backend="taichi")) == "its own reason"


@pytest.mark.parametrize("method", ["mpm", "sph", "pbd"])
def test_taichi_presses_nothing_through_a_body(method):
    """The same scenario without one runs."""
    solver, config = get_method(method), get_method(method).Config()
    target, thick = Target(backend="taichi"), {"material": {"density": 1000.0, "viscosity": 5.0}}
    pressed = bead(**PRINTS[Feature.TIP] | thick)
    words = "it has no bodies that matter is pressed through on the backend taichi"
    assert refusal(solver, pressed, config, target) == words
    assert refusal(solver, pressed, config) is None and refusal(solver, bead(), config, target) is None


def test_settings_of_methods_are_read_or_refused():
    assert configure(get_method("mpm"), scenario(numerics={"mpm": {"safety": 0.5}})).safety == 0.5
    for numerics, words in (
        ({"mpn": {}}, "numerics.mpn: no method of that name; did you mean 'mpm'"),
        ({"mpm": {"safty": 1}}, "numerics.mpm: unknown key 'safty'; did you mean 'safety'"),
        ({"mpm": {"safety": 2.0}}, r"numerics.mpm.safety: .*less than or equal to 1 \(got 2.0\)"),
    ):
        with pytest.raises(UserError, match=words):
            scenario(numerics=numerics)
    with pytest.raises(UserError, match="no solver named 'mpn'; did you mean 'mpm'"):
        get_method("mpn")
    with pytest.raises(UserError, match="mpm has no backend 'cuda'; it has warp and taichi"):
        check_backend(get_method("mpm"), SimpleNamespace(backend="cuda"))
