"""Edges of the input that the other tables leave open: units other than one, lower corners beyond zero, exact ends."""

import math

import pytest
from pydantic import ValidationError

from fluidbench.cli.options import budget_of, placed
from fluidbench.errors import UserError
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.scenario import library
from fluidbench.scenario.body import Body
from fluidbench.scenario.cure import Cure
from fluidbench.scenario.extent import ADDRESSABLE, RESOLVED
from fluidbench.scenario.model import check_number
from fluidbench.study.workplace import Workplace, methods_of, target_of

from ..conftest import bead, scenario

CUBE = {"kind": "box", "center": [0.1] * 3, "size": [0.04] * 3}


def refused(words, make=scenario, **table):
    with pytest.raises(UserError, match=words):
        make(**table)


@pytest.mark.parametrize(("key", "good", "bad"), [("jitter", (0.0, 0.5), (-0.01, 0.51)), ("seed", (0, 7), (-1,))])
def test_ranges_of_plain_keys(key, good, bad):
    for value in good:
        assert getattr(scenario(**{key: value}), key) == value
    for value in bad:
        refused(key, **{key: value})
    refused("greater than or equal to 1", pool=0)


@pytest.mark.parametrize("d", [0.5, 2.0])
def test_sizes_are_counted_in_spacings(d):
    edge = (8 * ADDRESSABLE) ** (1 / 3) * d

    def cube(share):
        body = {"kind": "box", "center": [1000.0 * d] * 3, "size": [share * edge] * 3}
        return scenario(
            domain={"lower": [0, 0, 0], "upper": [2000.0 * d] * 3}, spacing=d, duration=1.0, tick=1.0, bodies=[body]
        )

    cube(0.995)
    refused("bodies and nozzle would be", cube, share=1.0)
    table = {
        "domain": {"lower": [-200.0 * d] * 3, "upper": [200.0 * d] * 3},
        "spacing": d,
        "tick": 1.0,
        "gravity": [0, 0, 0],
        "toolpath": {"kind": "line", "start": [0, 0], "speed": 0.0, "dwell": 1.0},
        "output_interval": 1.0,
    }

    def stream(particles):
        nozzle = {"diameter": 10.0 * d, "flow_rate": 1e6 * d**3, "standoff": d}
        return bead(nozzle=nozzle, duration=(particles - 15.0**2) / 1e6, **table)

    stream(8 * ADDRESSABLE - 2)
    refused("bodies and nozzle would be", stream, particles=8 * ADDRESSABLE + 2)

    def far(reach):
        body = {"kind": "box", "center": [4.0 * d] * 3, "size": [4.0 * d] * 3}
        return scenario(
            domain={"lower": [0, 0, 0], "upper": [8.0 * d, reach * d, 8.0 * d]}, bodies=[body], spacing=d, duration=1.0
        )

    far(RESOLVED)
    refused("domain: it reaches to", far, reach=RESOLVED + 1)


def test_a_periodic_axis_is_as_long_as_from_face_to_face():
    walls = {"y_lower": "periodic", "y_upper": "periodic"}
    refused(
        "y has 5.99",
        domain={"lower": [0, 0.04, 0], "upper": [0.2, 0.0999, 0.2], "walls": walls},
        bodies=[{"kind": "box", "center": [0.1, 0.07, 0.1], "size": [0.04] * 3}],
    )


def test_bodies_that_only_touch_the_domain_lie_outside():
    for center in ([0.25, 0.125, 0.125], [-0.125, 0.125, 0.125]):
        refused(
            "lies outside",
            domain={"lower": [0, 0, 0], "upper": [0.125 + 0.0625] * 3},
            spacing=0.03125,
            bodies=[{"kind": "box", "center": center, "size": [0.125 if center[0] > 0 else 0.25] * 3}],
        )
    late = scenario(bodies=[CUBE | {"start": 0.75}], duration=1.0, tick=0.25, output_interval=0.5)
    assert late.bodies[0].start == 0.75


def carried(offset, size=0.02, body=(0.03, 0.0, 0.01)):
    """A box carried beside the nozzle's exit, 10 mm above the floor at x = 0; and a body 10 mm wide on the floor."""
    return bead(
        collider={"parts": [{"kind": "box", "center": list(offset), "size": [size] * 3}]},
        bodies=[{"kind": "box", "center": list(body), "size": [0.01, 0.01, 0.02]}],
    )


def test_a_collider_starts_clear_of_bodies_and_of_the_jet():
    """Edges: the body spans x = 25 .. 35 mm, the jet -6 .. 6 mm, from the exit down to the floor."""
    carried((0.0145, 0.0, 0.0), size=0.0165)
    refused(r"starts inside bodies\.0", carried, offset=(0.0165, 0.0, 0.0), size=0.0185)
    carried((0.0465, 0.0, 0.0))
    refused(r"starts inside bodies\.0", carried, offset=(0.0435, 0.0, 0.0))
    carried((0.03, 0.0, 0.0205), body=(0.03, 0.0, 0.01))
    refused(r"starts inside bodies\.0", carried, offset=(0.03, 0.0, 0.0195), body=(0.03, 0.0, 0.01))
    for side in (-1.0, 1.0):
        for axis in (0, 1):
            offset = [0.0, 0.0, -0.005]
            offset[axis] = side * 0.0165
            carried(offset, body=(0.045, 0.014, 0.01))
            offset[axis] = side * 0.0155
            refused(
                "starts inside the material that leaves the nozzle", carried, offset=offset, body=(0.045, 0.014, 0.01)
            )
    carried((0.0, 0.0, 0.0105), body=(0.045, 0.014, 0.01))
    refused("leaves the nozzle", carried, offset=(0.0, 0.0, 0.0095), body=(0.045, 0.014, 0.01))
    refused("leaves the nozzle", carried, offset=(0.0, 0.0, -0.0195), body=(0.045, 0.014, 0.01))


def test_a_collider_needs_something_to_carry_it():
    refused("give nozzle and toolpath", collider={"parts": [{"kind": "sphere", "center": [0, 0, 0.1], "radius": 0.01}]})


def test_exactly_five_mistakes_are_all_told():
    with pytest.raises(UserError) as error:
        library.validate({f"wrong{i}": 1 for i in range(2)} | {"spacing": 1.0}, "here")
    assert len(str(error.value).splitlines()) == 5 and "more" not in str(error.value)


def test_keys_without_effect_suggest_those_that_have_one():
    with pytest.raises(ValidationError, match=r"size has no effect on kind = 'sphere'; known: radius \["):
        Body(kind="sphere", center=(0, 0, 0), radius=1.0, size=(1, 1, 1))
    with pytest.raises(ValidationError) as error:
        Cure(youngs_modulus=1.0, rate=1.0)
    stresses = "saturated_yield_stress, viscosity, yield_stress, youngs_modulus"
    assert f"known: delay, interpolation, jitter, plastic_viscosity, {stresses}" in str(error.value)


def test_numbers_of_many_digits():
    with pytest.raises(ValueError, match=r"^1e\+299 is beyond any physics"):
        check_number(10**299)


def test_a_new_pool_is_empty():
    pool = Pool(Scene([scenario(), scenario(seed=1)]), 8)
    assert pool.count.numpy().tolist() == [0, 0] and pool.fault.numpy().tolist() == [0] and pool.stale


def test_methods_and_devices_must_exist():
    with pytest.raises(UserError, match="did you mean 'mpm'"):
        methods_of(["mpm", "mpn"])
    with pytest.raises(UserError, match="no device 'cuda:99' on this machine; it has cpu"):
        target_of("cuda:99", "warp", 1)


def test_results_lie_where_they_are_asked_to_or_by_their_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def store(**options):
        return Workplace.of(placed(options, "name"), 1.0).store

    assert store(fresh=True).root == tmp_path / "fluidbench-out" / "name"
    assert store(out=tmp_path / "x").root == tmp_path / "x" and store(fresh=True).fresh and not store().fresh
    assert not list(tmp_path.iterdir())


def test_budgets_without_an_end_are_infinite_alone():
    assert all(math.isinf(v) and v > 0 for v in budget_of("none"))
