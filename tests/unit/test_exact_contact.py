"""One substep of contact on hand-placed particles: what is taken out of velocities, where, and for whom."""

import numpy as np
import pytest

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.pool import Pool
from fluidbench.native.process.contact import Contact
from fluidbench.native.process.placement import Placement
from fluidbench.native.scene import Scene
from fluidbench.scenario.layout import capacity_of

from ..conftest import scenario

D, DT = 0.01, 1e-3
BLOCK = {"kind": "box", "center": [0.0, 0.06, 0.0], "size": [0.04, 0.06, 0.08]}
BALL = {"kind": "sphere", "center": [0.0, -0.1, 0.0], "radius": 0.02}
MIDDLE = np.array([0.0, 0.06, 0.06])  # of the block: exit at z = 0.05, raised by 0.01
HALF = np.array([0.02, 0.03, 0.04])


def touch(places, velocities, held=0, friction=0.3, parts=(BLOCK,), substeps=1, speed=0.0, now=0.0, spare=0, earlier=0):
    """Velocities (n, 3) of particles at these places after some substeps of 1 ms, `earlier` ones in the tick before;
    `spare` last ones are not active."""
    places, n = np.asarray(places, np.float32), len(places)
    path = {"start": [0.0, 0.0], "speed": speed, **({"end": [0.1, 0.0]} if speed else {"dwell": 1.0})}
    body = {"kind": "box", "center": [-0.2, 0.0, 0.02], "size": [0.04, 0.04, 0.01 * max(n - spare, 16) / 16]}
    table = scenario(
        domain={"lower": [-0.3] * 3, "upper": [0.3] * 3},
        spacing=D,
        bodies=[body],
        toolpath=path,
        duration=1.0,
        nozzle={"diameter": 0.02, "exit_speed": 1e-3, "standoff": 0.35},
        collider={"parts": list(parts), "clearance": 0.01, "friction": friction},
    )
    scene = Scene([table, table])
    pool = Pool(scene, capacity_of(table))
    Placement(table, pool)
    for name, values in (("position", places), ("velocity", velocities), ("held", held)):
        full = pool.fields[name].numpy().copy()
        for world in range(2):
            full[world * pool.capacity : world * pool.capacity + n] = values
        pool.fields[name].assign(full)
    for world in range(2):
        pool.set_count(world, n - spare)
    contact = Contact(scene, pool)
    scene.set_dt(DT)
    for start, number in ((now - 0.004, earlier), (now, substeps)):
        scene.clock.set(start, 0.004)
        scene.carriage.follow()
        for _ in range(number):
            scene.carriage.substep()
            contact.substep()
    after = pool.velocity.numpy().copy()
    assert (after[:n] == after[pool.capacity : pool.capacity + n]).all()
    assert (pool.position.numpy()[:n] == places).all()
    return after[:n]


def below(depth):
    """A point under the block whose skin of half a spacing it has entered by this much."""
    return MIDDLE + np.array([0.0, 0.0, -HALF[2] - 0.5 * D + depth])


@pytest.mark.parametrize(("friction", "slide"), [(0.0, 3.0), (0.3, 3.0 - 0.3 * 2.1), (1.0, 0.9), (5.0, 0.0)])
def test_a_sliding_particle_loses_friction_times_the_normal_impulse(friction, slide):
    """1 mm in: a tenth of it is taken back in 1 ms, 0.1 m/s. It came at 2 m/s, so the normal impulse is 2.1 m/s."""
    got = touch([below(0.001), below(0.001)], [[3.0, 0.0, 2.0], [0.0, -1.8, 2.0]], friction=friction)
    along = max(1.8 - friction * 2.1, 0.0)
    assert got == pytest.approx(np.array([[slide, 0.0, -0.1], [0.0, -along, -0.1]]), abs=2e-4)


def test_friction_acts_against_the_whole_slide():
    (got,) = touch([below(0.001)], [[3.0, -4.0, 2.0]])
    assert got == pytest.approx([3.0 * (1 - 0.63 / 5), -4.0 * (1 - 0.63 / 5), -0.1], abs=2e-4)


def test_pushing_out_is_limited_to_a_tenth_of_a_spacing_a_substep():
    depths = np.array([1e-4, 1e-3, 5e-3, 9e-3, 15e-3, 18e-3])
    got = touch([below(depth) for depth in depths], np.zeros((6, 3)), friction=0.0)
    assert got[:, 2] == pytest.approx(-np.minimum(0.1 * depths, 0.1 * D) / DT, rel=1e-3)


def test_what_does_not_touch_comes_not_nearer_or_is_held_is_left_alone():
    places = [below(-1e-5), below(0.001), below(0.001), below(0.001), below(0.001), below(0.001)]
    held = [int(FREE), int(FREE), int(FREE), int(CARRIED), int(CLAMPED), int(FREE)]
    before = np.array([[1, 0, 2], [1, 2, -0.11], [1, 2, -3], [1, 0, 2], [1, 0, 2], [1, 0, 2]], np.float32)
    got = touch(places, before, held, spare=1)
    assert (got == before).all()
    odd = np.array([[1 / 3, 1 / 7, 1 / 11]] * 2, np.float32)  # no bit changes, however fast the part
    assert (touch([below(-0.01), below(-0.002)], odd, speed=0.2) == odd).all()
    slow = touch([below(0.001)], [[0.0, 0.0, -0.09]])  # leaves, but not fast enough
    assert slow[0] == pytest.approx([0, 0, -0.1], abs=2e-4)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("depth", [0.001, 0.012])
def test_each_face_pushes_along_its_normal_from_outside_and_inside(axis, side, depth):
    """Slightly off the middle of a face; 12 mm in is 7 mm under the face, where the same face is still the nearest."""
    place = MIDDLE + 0.002 * np.array([1, -1, 1])
    place[axis] = MIDDLE[axis] + side * (HALF[axis] + 0.5 * D - depth)
    (got,) = touch([place], [np.zeros(3)], friction=0.0)
    expected = np.zeros(3)
    expected[axis] = side * min(0.1 * depth, 0.1 * D) / DT
    assert got == pytest.approx(expected, rel=1e-3)


def test_edges_and_corners_push_towards_the_particle():
    """3 and 2 mm off an edge, (1, 2, 2) mm off a corner: 3.6 and 3 mm away, 1.4 and 2 mm inside the skin."""
    edge, corner = np.array([0.003, 0.0, -0.002]), np.array([-0.001, 0.002, 0.002])
    places = [MIDDLE + edge + HALF * [1, 0, -1], MIDDLE + corner + HALF * [-1, 1, 1]]
    got = touch(places, np.zeros((2, 3)), friction=0.0)
    for velocity, arm in zip(got, (edge, corner), strict=True):
        away = np.linalg.norm(arm)
        assert velocity == pytest.approx(0.1 * (0.005 - away) / DT * arm / away, rel=2e-3)


def test_a_ball_pushes_outwards_and_every_part_acts():
    arm = np.array([2.0, -1.0, 2.0]) / 3.0
    centre = np.array([0.0, -0.1, 0.06])
    places = [centre + arm * (0.02 + 0.5 * D - 0.002), centre + arm * 0.011, below(0.001)]
    got = touch(places, [-1.0 * arm, -1.0 * arm, [0, 0, 0]], friction=0.0, parts=(BALL, BLOCK))
    assert got == pytest.approx(np.array([0.2 * arm, arm, [0, 0, -0.1]]), abs=1e-3)
    (turned,) = touch(places[:1], [[0.3, 0.6, 0.0]], friction=0.5, parts=(BALL,))  # along the surface at first
    slide = np.array([0.3, 0.6, 0.0])
    assert turned == pytest.approx(slide * (1 - 0.5 * 0.2 / np.linalg.norm(slide)) + 0.2 * arm, abs=1e-3)


@pytest.mark.parametrize("earlier", [0, 3])
@pytest.mark.parametrize("now", [0.004, 0.25])
def test_a_moving_part_carries_on_within_the_tick_and_pushes_at_its_own_speed(now, earlier):
    """0.2 m/s, 0.2 mm a substep; 0.1 mm beyond the skin it meets after the first, then 0.1 mm in, then 0.3 mm."""
    place = [[0.2 * now + HALF[0] + 0.5 * D + 1e-4, 0.061, 0.061]]
    for substeps, expected in ((1, 0.2 + 0.01), (2, 0.2 + 0.03), (3, 0.2 + 0.05)):
        got = touch(place, np.zeros((1, 3)), friction=0.0, speed=0.2, now=now, substeps=substeps, earlier=earlier)
        assert got[0] == pytest.approx([expected, 0.0, 0.0], abs=2e-4)


def test_friction_is_that_of_the_slide_relative_to_the_part():
    """A particle at rest under a block at 0.2 m/s is dragged along: 0.3 times the impulse of 0.1 m/s."""
    place = [below(0.001)]
    assert touch(place, np.zeros((1, 3)), speed=0.2)[0] == pytest.approx([0.03, 0.0, -0.1], abs=2e-4)
    assert touch(place, [[0.2, 0.0, 0.0]], speed=0.2)[0] == pytest.approx([0.2, 0.0, -0.1], abs=2e-4)
