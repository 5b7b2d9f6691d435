"""Scenarios: what is accepted, what is refused and in which words."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fluidbench.errors import UserError
from fluidbench.method.timestep import Bound, damped_limit, plan
from fluidbench.scenario.layout import sample
from fluidbench.scenario.library import load, parse_override, shipped, validate
from fluidbench.scenario.material import Material
from fluidbench.scenario.toolpath import Toolpath
from fluidbench.scenario.track import Track

from ..conftest import bead, scenario


@pytest.mark.parametrize("name", shipped())
def test_shipped_scenarios_are_valid_and_titled(name):
    s = load(name)
    assert s.title and s.name == name and not s.warnings()


WRONG = [
    ("material.densty=5", "did you mean 'density'"),
    ("material.density=-1", "greater than 0"),
    ("material.poisson_ratio=0.5", "less than 0.5"),
    ("nozzle.standoff=1.0", "leaves the domain"),
    ("toolpath.end=[9.0, 0.0]", "leaves the domain"),
    ("spacing=0.01", "too coarse"),
    ("spacing=0.05", "too coarse"),
    ("material.bulk_modulus=1e5", None),
    ("material.sound_speed=1.0\nmaterial.bulk_modulus=1e5", "not both"),
    ("domain.walls.x_lower='periodic'", "must both be periodic"),
    ("domain.upper=[-1.0, 1.0, 1.0]", "must exceed lower"),
]


@pytest.mark.parametrize(("override", "words"), WRONG)
def test_mistakes_are_named(override, words):
    if words is None:
        assert load("line_bead", override.split("\n"))
        return
    with pytest.raises(UserError, match=words):
        load("line_bead", override.split("\n"))


def test_unknown_scenario_suggests_the_nearest():
    with pytest.raises(UserError, match="did you mean 'line_bead'"):
        load("line_beed")


def test_extends_merges_tables_and_finds_loops(tmp_path):
    (tmp_path / "a.toml").write_text('extends = "line_bead"\n[material]\nyield_stress = 99.0\n')
    s = load(tmp_path / "a.toml")
    assert s.material.yield_stress == 99.0 and s.material.density == load("line_bead").material.density
    (tmp_path / "b.toml").write_text('extends = "b.toml"\n')
    with pytest.raises(UserError, match="extends itself"):
        load(tmp_path / "b.toml")
    (tmp_path / "c.toml").write_text("= 3")
    with pytest.raises(UserError, match="not valid TOML"):
        load(tmp_path / "c.toml")


def test_overrides_reach_into_lists():
    s = load("dam_break", ["bodies.0.velocity=[1.0, 0.0, 0.0]"])
    assert s.bodies[0].velocity == (1.0, 0.0, 0.0)
    with pytest.raises(UserError, match="number below 1"):
        load("dam_break", ["bodies.7.velocity=[1.0, 0.0, 0.0]"])
    with pytest.raises(UserError, match="key=value"):
        parse_override("nonsense")


def test_wrong_units_are_warned_about():
    assert any("kg/m^3" in w for w in load("line_bead", ["material.density=1.2"]).warnings())


@given(st.floats(1, 1e5), st.floats(10, 1e9), st.floats(-0.5, 0.499))
def test_moduli_are_consistent(density, youngs, poisson):
    """E = 9 K G / (3 K + G) whatever the input."""
    m = Material(density=density, youngs_modulus=youngs, poisson_ratio=poisson)
    k, g = m.bulk(1.0), m.shear_modulus
    assert 9 * k * g / (3 * k + g) == pytest.approx(youngs, rel=1e-9)
    assert m.wave_speed(1.0) == pytest.approx(math.sqrt((k + 4 * g / 3) / density))


@given(st.dictionaries(st.text(min_size=1), st.one_of(st.none(), st.floats(), st.text()), min_size=1))
def test_any_junk_is_a_user_error(table):
    with pytest.raises(UserError):
        validate(table, "junk")


@given(st.lists(st.floats(1e-7, 1e-1), min_size=1, max_size=5), st.floats(1e-5, 1e-1))
def test_plan_respects_every_bound(limits, tick):
    steps = plan([Bound(str(i), dt, "", "") for i, dt in enumerate(limits)], tick)
    assert steps.dt <= min(limits) * (1 + 1e-6)
    assert steps.dt * steps.substeps == pytest.approx(tick)
    assert steps.binding.dt == min(limits)


def test_damped_limit_meets_both_ends_and_the_oscillator():
    """Exact spectral radius of symplectic Euler on a damped oscillator is 1 at the limit."""
    assert damped_limit(2.0, math.inf) == 2.0
    w, rate = 3.0, 5.0
    dt = damped_limit(2 / w, 2 / rate)
    step = np.array([[1 - rate * dt, -w * w * dt], [dt * (1 - rate * dt), 1 - w * w * dt * dt]])
    assert max(abs(np.linalg.eigvals(step))) == pytest.approx(1.0, abs=1e-9)


def test_track_of_a_wall_goes_back_and_forth_with_pauses():
    path = Toolpath(kind="wall", start=(0, 0), end=(1, 0), speed=0.5, layers=2, layer_height=0.1, pause=1.0)
    track = Track.of(path, floor=0.0, standoff=0.2)
    assert track.end == pytest.approx(5.0)
    assert np.allclose(track.at(1.0), [0.5, 0, 0.2]) and np.allclose(track.at(4.0), [0.5, 0, 0.3])
    assert track.extruded(2.5) == pytest.approx(2.0)
    assert np.allclose(track.velocity_in, [[0.5, 0, 0], [0, 0, 0.1], [-0.5, 0, 0]])
    assert track.release_time(2.5) == pytest.approx(3.5)
    assert list(track.layer_at(np.array([0.5, 4.5]))) == [0, 1]


def test_ring_keeps_its_radius():
    track = Track.of(Toolpath(kind="ring", center=(1, 2), radius=0.5, speed=1.0), 0.0, 0.1)
    points = track.at(np.linspace(0, track.end, 1000))
    assert np.abs(np.hypot(points[:, 0] - 1, points[:, 1] - 2) / 0.5 - 1).max() < 2e-4


def test_schedule_is_the_same_for_all_methods_and_divides_outputs():
    tick, ticks, per_output = bead().schedule
    assert tick * per_output == pytest.approx(bead().duration / 20)
    assert ticks * tick == pytest.approx(bead().duration)


def test_sound_speed_follows_the_fastest_expected_speed():
    s = scenario()
    assert s.liquid_sound_speed == pytest.approx(10 * math.sqrt(9.81 * 0.09), rel=1e-6)


def test_wave_and_gradient_add_to_the_velocity():
    body = {
        "kind": "box",
        "center": [0.1, 0.1, 0.1],
        "size": [0.1, 0.1, 0.1],
        "velocity": [1.0, 0.0, 0.0],
        "wave": {"amplitude": [0.0, 2.0, 0.0], "number": [0.0, 0.0, 10.0], "phase": 0.5},
    }
    made = scenario(bodies=[body]).bodies[0]
    at = made.velocity_at(np.array([[0.1, 0.1, 0.13]]))
    assert np.allclose(at, [[1.0, 2.0 * np.sin(0.8), 0.0]])
    assert made.top_speed == pytest.approx(3.0)


def test_force_field_has_a_potential_whose_gradient_it_is():
    pull = [[-9.0, 1.0, 0.0], [1.0, -4.0, 0.0], [0.0, 0.0, -1.0]]
    s = scenario(body_force_gradient=pull, body_force_center=[0.1, 0.0, 0.05])
    x, h = np.array([0.12, 0.07, 0.02]), 1e-6
    slope = [(s.potential_at((x + h * e)[None]) - s.potential_at((x - h * e)[None]))[0] / (2 * h) for e in np.eye(3)]
    assert np.allclose(slope, s.acceleration + np.array(pull) @ (x - [0.1, 0.0, 0.05]), atol=1e-6)
    with pytest.raises(UserError, match="must be symmetric"):
        scenario(body_force_gradient=[[0, 1, 0], [0, 0, 0], [0, 0, 0]])


@pytest.mark.parametrize("spacing", [0.0101, 0.011, 0.0125, 0.0137])
def test_a_body_that_a_symmetry_plane_halves_keeps_half_its_mass(spacing):
    ball = {"kind": "sphere", "center": [0.0, 0.0, 0.5], "radius": 0.05}
    s = scenario(domain={"lower": [0, 0, 0], "upper": [1, 1, 1]}, bodies=[ball], spacing=spacing)
    points, volume = sample(s.bodies[0], s)
    assert len(points) * volume == pytest.approx(s.bodies[0].volume / 4, rel=1e-9)
    assert points[:, :2].min() > 0.4 * spacing
