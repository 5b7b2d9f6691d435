"""Particles laid out on the host by hand: the discs of a nozzle's stream, bodies, and the room they all need."""

import math

import numpy as np
import pytest

from fluidbench.errors import UserError
from fluidbench.scenario.layout import capacity_of, emitted, generations, sample, sources
from fluidbench.scenario.stream import Stream, disc

from ..conftest import bead, scenario

AREA = math.pi * 0.006**2


def rows(points):
    """Points in an order of their own, comparable whatever the order of making."""
    return np.array(sorted(np.round(points, 9).tolist()))


def test_a_disc_takes_the_lattice_nearest_to_its_area():
    """Radius 1: a quarter off the lattice 3 points fit, of 3.14. Radius 1.5: half off in x 8 fit, of 7.07, as many as a
    quarter off; the first found stays, and its rim counts, though 1.5 * 0.1 is a little more than 0.15.
    Then each is moved outwards until it owns its share."""
    expected = np.array([[0.25, 0.25], [-0.75, 0.25], [0.25, -0.75]]) * math.sqrt(math.pi / 3)
    assert rows(disc(0.1, 0.1)) == pytest.approx(0.1 * rows(expected))
    half = [[x, y] for x in (-0.5, 0.5) for y in (-1, 0, 1)] + [[-1.5, 0], [1.5, 0]]
    assert rows(disc(0.15, 0.1)) == pytest.approx(0.1 * rows(np.array(half) * math.sqrt(2.25 * math.pi / 8)))


@pytest.mark.parametrize("radius", [1.2, 2.0, 3.3, 4.0, 7.1])
def test_points_of_a_disc_own_its_area(radius):
    """Nearest neighbours are a stretched spacing apart, and n stretched cells are the circle."""
    points = disc(0.1 * radius, 0.1)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1) + 1e9 * np.eye(len(points))
    assert len(points) * gaps.min() ** 2 == pytest.approx(math.pi * (0.1 * radius) ** 2)
    assert abs(len(points) / (math.pi * radius**2) - 1) < 0.2


def test_discs_leave_half_a_period_early_and_carry_exactly_what_was_fed():
    """Spacing 2 mm at 0.1 m/s: one disc every 20 ms, the first after 10 ms; a path of 0.3 s takes 15 of them."""
    stream = Stream(bead(duration=0.5))
    assert stream.extruding == pytest.approx(0.01 + 0.02 * np.arange(15))
    assert stream.release_time == pytest.approx(stream.extruding) and stream.particles == 15 * len(stream.offsets)
    assert stream.offsets.tolist() == disc(0.006, 0.002).tolist()
    assert stream.volume * len(stream.offsets) == pytest.approx(AREA * 0.002)
    assert [stream.released(t) for t in (0.0, 0.0099, 0.0101, 0.0299, 0.0301, 0.2911, 9.0)] == [0, 0, 1, 1, 2, 15, 15]
    assert stream.released(float(stream.release_time[3])) == 4
    assert stream.mass(0.0301) == pytest.approx(2 * 1000.0 * AREA * 0.002)
    for t in np.linspace(0.0, 0.3, 77):
        assert abs(stream.mass(t) - 1000.0 * AREA * 0.1 * t) <= 0.5001 * 1000.0 * AREA * 0.002
    assert stream.velocity == pytest.approx(np.tile([0.1, 0.0, -0.1], (15, 1)))


@pytest.mark.parametrize(
    ("duration", "discs"), [(0.1, 5), (0.089, 4), (0.0901, 5), (0.15, 8), (0.29, 15), (0.3, 15), (5.0, 15)]
)
def test_the_stream_ends_with_the_path_or_the_run(duration, discs):
    assert len(Stream(bead(duration=duration)).extruding) == discs


def test_four_discs_wait_in_the_nozzle():
    """At time t those are in it, or beyond, that leave within four and a half periods."""
    stream = Stream(bead(duration=0.5))
    assert [stream.entered(t) for t in (0.0001, 0.0199, 0.0201, 0.0401, 9.0)] == [5, 5, 6, 7, 15]
    flow = {"diameter": 0.012, "flow_rate": AREA * 0.1, "standoff": 0.01}
    assert Stream(bead(duration=0.5, nozzle=flow)).entered(0.0201) == 6


def test_pauses_hold_the_stream_back_and_corners_turn_it():
    """Two legs of 30 mm at 0.1 m/s on each of two layers; the pause of 0.1 s comes before disc 30."""
    path = {
        "kind": "polyline",
        "points": [[0, 0], [0.03, 0], [0.03, 0.03]],
        "speed": 0.1,
        "layers": 2,
        "layer_height": 0.004,
        "pause": 0.1,
    }
    domain = {"lower": [-0.02, -0.02, 0], "upper": [0.05, 0.05, 0.025]}
    stream = Stream(bead(toolpath=path, domain=domain, duration=2.0))
    expected = 0.01 + 0.02 * np.arange(60)
    assert stream.release_time == pytest.approx(np.where(np.arange(60) < 30, expected, expected + 0.1))
    ways = [[0.1, 0], [0, 0.1], [0, -0.1], [-0.1, 0]]
    assert stream.velocity == pytest.approx(np.repeat([[*way, -0.1] for way in ways], 15, axis=0))


def test_a_disc_released_at_a_corner_still_moves_as_the_nozzle_did():
    path = {"kind": "polyline", "points": [[0, 0], [0.005, 0], [0.005, 0.01]], "speed": 0.1}
    velocity = Stream(bead(toolpath=path, duration=2.0)).velocity
    assert velocity[:4] == pytest.approx(np.array([[0.1, 0, -0.1]] * 3 + [[0, 0.1, -0.1]]))


def body(**table):
    return {"kind": "box", "center": [0.05, 0.05, 0.05], "size": [0.08, 0.05, 0.034], **table}


def test_a_box_is_a_lattice_stretched_to_its_faces():
    """34 mm hold three layers of 11.3 mm."""
    s = scenario(bodies=[body()])
    points, volume = sample(s.bodies[0], s)
    axes = [0.05 + (np.arange(n) + 0.5 - n / 2) * size for n, size in ((8, 0.01), (5, 0.01), (3, 0.034 / 3))]
    expected = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    assert rows(points) == pytest.approx(rows(expected)) and volume == pytest.approx(0.01 * 0.01 * 0.034 / 3)
    tall = scenario(bodies=[body(size=[0.04, 0.04, 0.036])])
    assert len(sample(tall.bodies[0], tall)[0]) == 4 * 4 * 4  # 3.6 layers are nearer to four than to three
    thin = scenario(bodies=[body(size=[0.04, 0.04, 0.0101])])
    assert len(sample(thin.bodies[0], thin)[0]) == 16


def test_a_cylinder_keeps_whole_layers_and_a_sphere_its_volume():
    """Radius of two spacings: 12 of 16 points a layer, 32 of 64 in a ball; stretched in plan, or in space."""
    s = scenario(bodies=[{"kind": "cylinder", "center": [0.1, 0.08, 0.05], "radius": 0.02, "height": 0.034}])
    points, volume = sample(s.bodies[0], s)
    assert len(points) == 36 and volume == pytest.approx(math.pi * 0.02**2 * 0.034 / 36)
    assert np.unique(points[:, 2].round(9)) == pytest.approx(0.05 + 0.034 / 3 * np.array([-1, 0, 1]))
    stretch = math.sqrt(math.pi * 0.02**2 / (12 * 1e-4))
    plan = [[x, y] for x in (-1.5, -0.5, 0.5, 1.5) for y in (-1.5, -0.5, 0.5, 1.5) if abs(x * y) < 2]
    assert rows(points[::3, :2] - [0.1, 0.08]) == pytest.approx(rows(0.01 * stretch * np.array(plan)))
    s = scenario(bodies=[{"kind": "sphere", "center": [0.1, 0.08, 0.05], "radius": 0.02}])
    points, volume = sample(s.bodies[0], s)
    assert len(points) == 32 and volume == pytest.approx(4 / 3 * math.pi * 0.02**3 / 32)
    arms = np.linalg.norm(points - [0.1, 0.08, 0.05], axis=1)
    assert np.unique(arms.round(9)) == pytest.approx(np.cbrt(volume) * np.array([0.75, 2.75]) ** 0.5)


def test_what_lies_outside_the_domain_is_cut_off_and_no_layer_lies_in_a_plane_of_symmetry():
    """A box of 50 mm about the corner: four layers, not five, of which two are inside; along z it stays as it is."""
    s = scenario(bodies=[body(center=[0.0, 0.2, 0.05], size=[0.05, 0.07, 0.03])])
    points, volume = sample(s.bodies[0], s)
    assert np.unique(points[:, 0].round(9)) == pytest.approx([0.00625, 0.01875])
    assert np.unique(points[:, 1].round(9)) == pytest.approx(0.2 - 0.07 / 8 * np.array([3.5, 2.5, 1.5, 0.5]))
    assert len(np.unique(points[:, 2].round(9))) == 3 and volume == pytest.approx(0.05 * 0.07 * 0.03 / (4 * 8 * 3))
    tiny = scenario(bodies=[body(center=[0.0, 0.05, 0.05], size=[0.011, 0.03, 0.03])])
    assert len(sample(tiny.bodies[0], tiny)[0]) == 9


def test_jitter_shifts_by_up_to_its_share_of_a_spacing():
    cube = [body(center=[0.1, 0.1, 0.1], size=[0.1, 0.1, 0.1])]
    plain = scenario(bodies=cube)
    still, _ = sample(plain.bodies[0], plain)
    shifts = {}
    for seed in (0, 1):
        s = scenario(bodies=cube, jitter=0.4, seed=seed)
        shifts[seed] = (sample(s.bodies[0], s)[0] - still) / 0.01
        assert 0.39 < shifts[seed].max() <= 0.4 and -0.39 > shifts[seed].min() >= -0.4
        assert shifts[seed].std() == pytest.approx(0.4 / math.sqrt(3), rel=0.03)
        assert abs(shifts[seed].mean()) < 0.02
    assert (shifts[0] != shifts[1]).any()


def foam(expansion, **more):
    material = {"density": 100.0, "youngs_modulus": 1e3, "expansion": expansion}
    return scenario(material=material, bodies=[body(size=[0.05, 0.05, 0.04])], **more)


def test_sources_are_bodies_and_the_stream():
    s = bead(duration=0.5, bodies=[body(center=[0.02, 0, 0.01], size=[0.008, 0.008, 0.008], kind="box")])
    (many, volume), (fed, share) = sources(s)
    assert many == 64 and volume == pytest.approx(0.002**3)
    assert fed == Stream(s).particles and share == Stream(s).volume and emitted(s) == 64 + fed
    assert capacity_of(s) == emitted(s)


def test_room_for_offspring():
    """100 particles: doubled for every halving of growth; 6 standard deviations where chance decides."""
    assert generations(scenario()) == 0
    assert generations(foam({"ratio": 12.0})) == 3 and capacity_of(foam({"ratio": 12.0})) == 800
    assert capacity_of(foam({"ratio": 12.0, "split": False})) == 100
    spawn = {"kind": "spawn", "ratio": 9.0, "passes": 2}
    assert generations(foam(spawn)) == 2 and capacity_of(foam(spawn)) == 900
    chance = {"kind": "spawn", "ratio": 2.5, "passes": 1}
    assert capacity_of(foam(chance)) == 250 + 150
    assert capacity_of(foam({**chance, "ratio": 2.53})) == math.ceil(253 + 151.8)
    assert capacity_of(foam(spawn, pool=900)) == 900 and capacity_of(foam(spawn, pool=1000)) == 1000
    with pytest.raises(UserError, match="pool = 899 is too small: test will hold up to 900"):
        capacity_of(foam(spawn, pool=899))


def test_the_largest_particles_decide_how_often_growth_halves():
    """A box of 15 mm is one layer of 15 mm: half as much again as the spacing, one halving more."""
    s = foam({"ratio": 3.0})
    assert generations(s) == 1
    thick = scenario(
        material=s.material.model_dump(), bodies=[body(size=[0.04, 0.04, 0.0149]), *s.model_dump()["bodies"]]
    )
    assert [n for n, _ in sources(thick)] == [16, 100] and generations(thick) == 2
