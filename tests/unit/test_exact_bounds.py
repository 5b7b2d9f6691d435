"""Every bound on the time step by hand, and the plan, the damped limit and the lost speed that follow from them."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from fluidbench.method.timestep import Bound, damped_limit, lost_speed, plan
from fluidbench.registry import get_method
from fluidbench.scenario.numerics import configure
from solvers.lattice import hourglass_limit, stiffest_drag

from ..conftest import scenario

C, V, D = 12.0, 3.0, 0.01
THIN = 1.8**2 * stiffest_drag(3.6, 0.25) / 18.0  # how much faster than artificial viscosity that of liquids damps


def bounds(method, speed=V, numerics=None, **table):
    """{name: dt} of water with c = 12 m/s in a domain of 0.2 m and 0.15 m."""
    material = {"density": 1000.0, "sound_speed": C, **table.pop("material", {})}
    domain = {"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.15]}
    s = scenario(material=material, domain=domain, spacing=D, **table)
    solver = get_method(method)
    return {b.name: b.dt for b in solver.bounds(s, solver.Config(**(numerics or {})), speed)}


def test_mpm_by_hand():
    """Wanted cells of 2 d = 0.02; eight of 0.01875 divide 0.15 m, and the smallest edge counts."""
    dx = 0.15 / 8
    got = bounds("mpm")
    assert got == pytest.approx({"acoustic": 0.8 * dx / (math.sqrt(3) * (C + V)), "advective": 0.5 * dx / V})
    assert bounds("mpm", speed=0.0)["advective"] > 1e6
    nu = 5.0 / 1000.0
    got = bounds("mpm", material={"viscosity": 5.0})
    assert got["viscous"] == pytest.approx(0.8 * dx**2 / (4 * nu))
    x = got["acoustic-viscous"] / 0.8
    assert (x / (got["acoustic"] / 0.8)) ** 2 + x / (got["viscous"] / 0.8) == pytest.approx(1.0)
    assert list(got) == ["acoustic", "advective", "viscous", "acoustic-viscous"]


def test_mpm_follows_its_settings():
    got = bounds("mpm", numerics={"grid_ratio": 3.0, "safety": 0.5, "advection": 0.25}, material={"viscosity": 5.0})
    assert got["acoustic"] == pytest.approx(0.5 * 0.2 / 7 / (math.sqrt(3) * (C + V)))  # seven cells of 0.0286 in 0.2 m
    assert got["advective"] == pytest.approx(0.25 * 0.2 / 7 / V)
    assert got["viscous"] == pytest.approx(0.5 * (0.2 / 7) ** 2 / (4 * 5e-3))


@pytest.mark.parametrize(
    ("material", "ratio", "alpha"),
    [
        ({}, 1.8, 0.01),
        ({"viscosity": 2.0}, 1.8, 0.01),
        ({"youngs_modulus": 1e4}, 1.3, 1.0),
        ({"youngs_modulus": 1e4, "relaxation_time": 0.1}, 1.3, 0.3),
        ({"cure": {"delay": 1.0, "youngs_modulus": 1e4}}, 1.3, 1.0),
    ],
)
def test_sph_by_hand(material, ratio, alpha):
    """Alpha acts as nu = alpha h c / 10 and damps 18 nu / h^2 at most, the material's own more where matter is thin; h
    is 1.8 d in liquids and 1.3 d in what is or becomes solid."""
    h = ratio * D
    shear = material.get("youngs_modulus", 0.0) / 2.6
    c = math.sqrt(C**2 + 4 * shear / 3000.0)
    nu = THIN * material.get("viscosity", 0.0) / 1000.0 + alpha * h * c / 10.0
    got = bounds("sph", material=material, gravity=[0, 0, -4.0])
    expected = {"acoustic": 0.4 * h / (c + V), "viscous": 0.09 * h**2 / nu, "force": 0.25 * math.sqrt(h / 4.0)}
    if ratio == 1.3:  # it has shear stiffness, or will
        expected["hourglass"] = 0.8 * D * hourglass_limit(1.3, 2.0, math.sqrt(shear / 1000.0), alpha * c)
    else:
        expected["hourglass"] = math.inf
    assert got == pytest.approx(expected)


def test_sph_follows_its_settings_and_leaves_out_what_is_not_there():
    settings = {
        "smoothing_ratio": 2.0,
        "cfl": 0.2,
        "viscous_number": 0.05,
        "force_number": 0.5,
        "artificial_viscosity": 0.02,
    }
    got = bounds("sph", numerics=settings, gravity=[0, 0, -4.0])
    expected = {"acoustic": 0.2 * 0.02 / 15.0, "viscous": 0.05 * 4e-4 / 4.8e-4, "force": 0.5 * math.sqrt(0.02 / 4.0)}
    expected["hourglass"] = math.inf
    assert got == pytest.approx(expected)
    still = bounds("sph", numerics={"artificial_viscosity": 0.0}, gravity=[0, 0, 0])
    assert still["viscous"] == still["force"] == math.inf
    weak = bounds("sph", numerics={"artificial_viscosity": 0.0}, gravity=[0, 0, -0.5], material={"viscosity": 0.1})
    assert weak["viscous"] == pytest.approx(0.09 * 0.018**2 / (THIN * 1e-4))
    assert weak["force"] == pytest.approx(0.25 * math.sqrt(0.018 / 0.5))


def test_pbd_by_hand():
    """An eighth of a spacing a substep, moving or falling from rest."""
    got = bounds("pbd", gravity=[0, 0, -4.0])
    assert got == pytest.approx({"accuracy": 0.125 * D / V, "free fall": math.sqrt(0.125 * D / 4.0)})
    got = bounds("pbd", numerics={"advance": 0.5}, gravity=[0, 0, -0.5])
    assert got == pytest.approx({"accuracy": 0.5 * D / V, "free fall": math.sqrt(0.5 * D / 0.5)})
    still = bounds("pbd", speed=0.0, gravity=[0, 0, 0])
    assert list(still) == ["accuracy"] and still["accuracy"] > 1e6


def test_pbd_pushes_as_hard_as_stress_pulls():
    """n iterations, of which more than 5 count as 5, push against a yield stress of 0.02 n rho (d / dt)^2 and a viscous
    stress mu U / 8 d of 20 n rho (d / dt)^2; foam that has grown is lighter."""
    paste = {"youngs_modulus": 1e6, "yield_stress": 500.0}
    for given, n in ((1, 1), (2, 2), (5, 5), (12, 5), (None, 5)):
        got = bounds("pbd", numerics={"iterations": given}, material=paste)
        assert got["yield push"] == pytest.approx(D * math.sqrt(0.02 * n * 1000.0 / 500.0))
    for other in ({}, {"yield_stress": 1e9}, {"yield_stress": 0.0}, {"yield_stress": None, "relaxation_time": 0.1}):
        assert "yield push" not in bounds("pbd", material={"youngs_modulus": 1e6, **other})
    u = scenario(material={"density": 1000.0}, spacing=D).reference_speed
    for n in (1, 5):
        got = bounds("pbd", numerics={"iterations": n}, material={"viscosity": 50.0})
        assert got["viscous push"] == pytest.approx(D * math.sqrt(20.0 * n * 1000.0 / (50.0 * u / (8.0 * D))))


def pbd_iterations(**table):
    s = scenario(spacing=D, duration=2.0, **table)
    return configure(get_method("pbd"), s).iterations


@pytest.mark.parametrize(("ratio", "n"), [(0.01, 2), (0.66, 2), (0.68, 3), (1.32, 4), (1.35, 5), (50.0, 5)])
def test_pbd_goes_through_its_constraints_as_often_as_matter_is_stiff(ratio, n):
    """n rho (d / dt)^2 is thrice E + mu / dt at least, and n from 2 to 5; `ratio` is (E dt^2 + mu dt) / rho d^2."""
    speed = scenario(material={"density": 500.0}, spacing=D).reference_speed
    dt = 0.125 * D / speed  # less than a tick, and than free fall allows
    elastic = ratio * 500.0 * (D / dt) ** 2
    soft = {"density": 500.0, "youngs_modulus": elastic, "yield_stress": 1e-3 * elastic}
    assert pbd_iterations(material=soft) == n
    assert pbd_iterations(material=soft, numerics={"pbd": {"iterations": 7}}) == 7
    assert pbd_iterations(material={"density": 500.0}) == 2


def test_pbd_goes_by_the_stiffest_that_matter_becomes():
    cure = {"delay": 0.5, "youngs_modulus": 1e6, "yield_stress": 500.0}
    curing = {"density": 1000.0, "youngs_modulus": 10.0, "yield_stress": 0.01}
    assert pbd_iterations(material=curing) == 2
    assert pbd_iterations(material=curing | {"cure": cure}) == 5
    assert pbd_iterations(material={"density": 1000.0, "viscosity": 1e-3}) == 2
    assert pbd_iterations(material={"density": 1000.0, "viscosity": 1e3}) == 5


def test_formulas_name_the_numbers_that_were_used():
    made = {}
    for method in ("mpm", "sph", "pbd"):
        solver, s = get_method(method), scenario(material={"density": 1000.0, "viscosity": 5.0})
        made |= {f"{method} {b.name}": b.formula for b in solver.bounds(s, solver.Config(), V)}
    assert made["mpm acoustic"].startswith("0.8 dx") and made["mpm advective"].startswith("0.5 dx")
    assert made["mpm viscous"].startswith("0.8 dx^2 / (4 nu)")
    assert made["sph acoustic"].startswith("0.4 h") and made["sph viscous"].startswith("0.09 h^2")
    assert made["sph force"].startswith("0.25 sqrt")
    assert made["pbd accuracy"] == "0.125 d / v" and made["pbd free fall"] == "sqrt(0.125 d / |g|)"


@pytest.mark.parametrize(
    ("method", "key", "accepted", "refused"),
    [
        ("mpm", "grid_ratio", (1.0, 4.0), (0.99, 4.01)),
        ("mpm", "safety", (0.01, 1.0), (0.0, 1.01)),
        ("mpm", "advection", (0.01, 0.99), (0.0, 1.0)),
        ("sph", "smoothing_ratio", (1.0, 3.0), (0.99, 3.01)),
        ("sph", "smoothing_ratio_solid", (1.0, 3.0), (0.99, 3.01)),
        ("sph", "cfl", (0.01, 1.5), (0.0, 1.51)),  # 1.73 is unstable
        ("sph", "viscous_number", (0.01, 0.1), (0.0, 0.101)),  # 0.111 is unstable
        ("sph", "force_number", (0.01, 1.0), (0.0, 1.01)),
        ("sph", "artificial_viscosity", (0.0, 9.0), (-0.01,)),
        ("pbd", "support_ratio", (2.0, 3.5), (1.99, 3.51)),
        ("pbd", "hourglass", (0.0, 1.0), (-0.01, 1.01)),
        ("pbd", "advance", (0.01, 1.0), (0.0, 1.01)),
    ],
)
def test_settings_that_no_bound_could_answer_for_are_refused(method, key, accepted, refused):
    settings = get_method(method).Config
    for value in accepted:
        assert getattr(settings(**{key: value}), key) == value
    for value in refused:
        with pytest.raises(ValidationError, match=key):
            settings(**{key: value})


@pytest.mark.parametrize(
    ("limits", "tick", "substeps", "binding"),
    [
        ((0.3, 0.25), 1.0, 4, 1),
        ((0.25 - 1e-12, 0.3), 1.0, 4, 0),  # rounding alone adds no substep
        ((0.2499, 0.3), 1.0, 5, 0),
        ((5.0, 7.0), 1.0, 1, 0),
        ((math.inf, 0.5), 1.0, 2, 1),
        ((math.inf,), 1.0, 1, 0),
    ],
)
def test_the_plan_takes_the_fewest_substeps_that_the_smallest_bound_allows(limits, tick, substeps, binding):
    made = [Bound(str(i), dt, "", "") for i, dt in enumerate(limits)]
    steps = plan(made, tick)
    assert steps.substeps == substeps and steps.dt == pytest.approx(tick / substeps, rel=1e-12)
    assert steps.binding is made[binding]


@pytest.mark.parametrize(("dt", "tick"), [(0.0, 1.0), (-1.0, 1.0), (math.nan, 1.0), (1.0, math.inf), (1.0, math.nan)])
def test_what_allows_no_step_is_refused(dt, tick):
    with pytest.raises(ValueError, match=r"bound 'a' is .* which allows no step"):
        plan([Bound("a", dt, "", "")], tick)


@pytest.mark.parametrize(
    ("acoustic", "viscous", "expected"),
    [
        (1.0, math.inf, 1.0),
        (1.0, 2.0 / 3.0, 0.5),  # 1/4 + 3/4
        (4.0, 8.0 / 3.0, 2.0),
        (3.0, 1.2, 1.0 / (math.sqrt(1.0 / 9.0 + 0.25 / 1.44) + 0.5 / 1.2)),
        (1e3, 1.0, pytest.approx(1.0, rel=1e-5)),
    ],
)
def test_waves_and_damping_share_one_limit(acoustic, viscous, expected):
    assert damped_limit(acoustic, viscous) == (pytest.approx(expected) if isinstance(expected, float) else expected)


def test_motion_below_half_a_unit_in_the_last_place_is_lost():
    """At a reach of 1 m single precision steps by 2^-23."""
    assert lost_speed(1e-3, 1.0) == pytest.approx(2.0**-24 / 1e-3)
    assert lost_speed(0.5, 3.0) == pytest.approx(2.0**-22)
    here = np.float32(1.0)
    dt = 1e-3
    assert here + np.float32(0.99 * lost_speed(dt, 1.0) * dt) == here
    assert here + np.float32(1.01 * lost_speed(dt, 1.0) * dt) > here
