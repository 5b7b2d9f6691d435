"""What a rigid body does to particles near it: moments of a plane in closed form, tables on the device, and mirrors."""

import numpy as np
import pytest
import warp as wp

from fluidbench.native.scene import Scene
from fluidbench.scenario.outline import Outline
from solvers.pbd.solver import weights as weights_pbd
from solvers.smoothing import wendland_slope
from solvers.tool import FAR, Tool, distance_to, felt, outside, tool_of
from solvers.tool_map import Ball, Weights

from .test_exact_tip import BORE, D, pressed

wp.set_module_options({"enable_backward": False})
ONE = Weights(lambda r: 1.0, lambda r: 1.0, lambda r: 1.0, lambda r: 1.0)
REACH = 0.9


def behind_plane(gap, reach=REACH, spacing=0.2, weights=ONE):
    """Moments of the space beyond a plane that is `gap` above: an entry of a table without its first three."""
    plane = Outline(np.array([[-5.0, 0.0], [-5.0, 9.0], [5.0, 9.0], [5.0, 0.0]]))
    return Ball.of(spacing / 4, reach, spacing, weights).within(plane, 0.0, -gap)


@pytest.mark.parametrize("d", [0.1, 0.3, 0.6, 0.8])
def test_moments_of_a_plane_are_those_of_a_cap(d):
    """Of a ball of radius R cut at d: integrals of 1, z, x^2 and z^2 over d < z < R, and the same times z - d."""
    entry = behind_plane(d)
    z = np.linspace(d, REACH, 20001)
    disc = np.pi * (REACH**2 - z**2)

    def over(values):
        return float(np.trapezoid(values * disc, z))

    volume = over(np.ones_like(z))
    close = 0.03 * volume + 2e-3
    assert entry[0] == pytest.approx(volume, abs=close)
    assert entry[1:5] == pytest.approx([0.0, -over(z), 0.0, -over(z * (z - d))], abs=close)
    for second, deep in ((entry[5:9], 1.0), (entry[9:13], 1.0), (entry[13:17], z - d)):
        side = over(deep * (REACH**2 - z**2) / 4.0)
        assert second == pytest.approx([side, side, over(deep * z**2), 0.0], abs=close)
    assert entry[17] == pytest.approx(over(z - d), abs=close) and entry[18] == entry[20] == pytest.approx(entry[0])
    assert entry[19] == pytest.approx(0.2**3 * sum(entry[[5, 6, 7]]))


def test_what_is_out_of_reach_is_not_felt():
    assert (behind_plane(1.1) == 0.0).all()


def test_a_plane_completes_a_lattice():
    """Half of a lattice, and the body in place of the other half: gradients of a kernel add up to nothing."""
    d, h = 0.1, 0.18

    def slope(r):
        return wendland_slope(r / h, h)

    axis = np.arange(-4, 5) * d
    below = np.stack(np.meshgrid(axis, axis, (np.arange(-4, 0) + 0.5) * d, indexing="ij"), axis=-1).reshape(-1, 3)
    for gap in (0.05, 0.15):
        r = np.array([0.0, 0.0, -gap]) - below
        s = np.array([slope(x) if 0 < x < 2 * h else 0.0 for x in np.linalg.norm(r, axis=1)]) * d**3
        entry = behind_plane(gap, 2.0 * h, d, Weights(slope, slope, slope))
        assert abs(s @ r[:, 2] + entry[2]) < 0.12 * abs(s @ r[:, 2])
        assert -(s @ r[:, 2] ** 2 + entry[7]) == pytest.approx(1.0, abs=0.05)
        assert -(s @ r[:, 0] ** 2 + entry[5]) == pytest.approx(1.0, abs=0.05)


@wp.kernel
def ask(tool: Tool, place: wp.array(dtype=wp.vec3), found: wp.array(dtype=float, ndim=2)):
    i = wp.tid()
    x = place[i]
    near = felt(tool, x)
    gap, normal = distance_to(tool, x)
    kept = outside(tool, x)
    for a in range(3):
        found[i, a] = near.normal[a]
        found[i, 3 + a] = near.first[a]
        found[i, 6 + a] = normal[a]
        found[i, 9 + a] = kept[a]
    found[i, 12] = near.gap
    found[i, 13] = gap
    found[i, 14] = float(near.on)


@pytest.fixture(scope="module")
def tool():
    s = pressed(spacing=0.001)
    scene = Scene(s)
    scene.clock.set(0.0, s.schedule[0])
    scene.carriage.follow()
    return tool_of(scene, 0.003, weights_pbd(0.002))


def asked(tool, places):
    """What the device finds at places relative to where matter is let go, at (0, 0, 0.028)."""
    at = wp.array(np.asarray(places) + np.array([0.0, 0.0, 0.010 + BORE]), dtype=wp.vec3)
    out = wp.zeros((len(places), 15), dtype=float)
    wp.launch(ask, len(places), [tool, at], [out])
    return out.numpy().astype(float)


def test_the_device_finds_distances_and_normals_all_around(tool):
    rng = np.random.default_rng(3)
    angle, r, z = rng.uniform([0, 1e-3, -BORE - 0.005], [2 * np.pi, 0.017, -0.001], (500, 3)).T
    outline, found = pressed().nozzle.outline, asked(tool, np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))
    exact = outline.distance(r, z)
    near = np.abs(exact) < 0.0025
    assert np.abs(found[near, 12] - exact[near]).max() < 2e-4
    smooth = near & (np.linalg.norm(outline.normal(r, z, 4e-4), axis=1) > 0.999)
    radial, upward = outline.normal(r, z, 1e-6).T
    normal = np.stack([radial * np.cos(angle), radial * np.sin(angle), upward], axis=1)
    assert smooth.sum() > 200 and np.abs(found[smooth, :3] - normal[smooth]).max() < 0.05
    assert (found[near, 13] == found[near, 12]).all() and (found[near, 6:9] == found[near, :3]).all()


def test_what_sticks_out_of_the_body_is_put_in_front_of_it_and_no_further(tool):
    """A fifth of a spacing: in the bore, under the face, and inside either."""
    bore, face = D / 2, -BORE
    places = [
        [bore - 1e-4, 0, -0.01],
        [0, bore + 3e-4, -0.01],
        [0.009, 0, face - 5e-5],
        [0, 0.009, face + 2e-4],
        [0.002, 0, -0.01],
    ]
    found = asked(tool, places)
    wanted = [
        [bore - 2e-4, 0, -0.01],
        [0, bore - 2e-4, -0.01],
        [0.009, 0, face - 2e-4],
        [0, 0.009, face - 2e-4],
        [0.002, 0, -0.01],
    ]
    kept = found[:, 9:12] - [0.0, 0.0, 0.010 + BORE]
    assert kept == pytest.approx(np.array(wanted), abs=3e-5)


def test_nothing_is_felt_far_from_the_body(tool):
    found = asked(tool, [[0.1, 0.0, 0.0], [0.0, 0.0, -0.1]])
    assert (found[:, [3, 4, 5, 12, 14]] == 0.0).all() and (found[:, 13] == FAR).all()
