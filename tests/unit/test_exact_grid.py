"""Stress, cells, nodes and walls of MPM by hand: device functions called one by one."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, SLIP, STICK, Scene
from solvers.mpm import grid as mpm_grid
from solvers.mpm import particle as mpm
from solvers.mpm import walls as mpm_walls

from ..conftest import scenario

V = (1.0, 2.0, 4.0)


@pytest.mark.parametrize("ratio", [0.99, 1.01])
def test_kirchhoff_stress_by_hand(ratio):
    """J p and G dev b, and 2 eta min(J, 1) dev D, of a paste that may carry tension."""
    material = {"density": 1000.0, "youngs_modulus": 2.6e4, "viscosity": 3.0}
    s = scenario(material=material)
    phase = Scene(s)._phase(s, s.material)
    g, k = 1e4, 2.6e4 / 1.2
    b, off = np.array([1.1, 0.9, 1.3]), (0.05, -0.1, 0.2)
    c = np.array([[0.5, 1.0, 0.0], [2.0, -0.25, 0.0], [0.0, 4.0, 0.125]])
    tensor = np.diag(b) + np.array([[0, off[0], off[1]], [off[0], 0, off[2]], [off[1], off[2], 0]])
    rate = 0.5 * (c + c.T)
    one = np.eye(3)
    expected = g * (tensor - b.mean() * one) - ratio * k * (1 / ratio - 1) * one
    got = mpm.kirchhoff(phase, ratio, wp.vec3(*b), wp.vec3(*off))
    assert np.array(got).reshape(3, 3) == pytest.approx(expected, rel=1e-4)
    drag = 2 * 3.0 * min(ratio, 1.0) * (rate - np.trace(rate) / 3 * one)
    got = mpm.viscous(phase, ratio, wp.mat33(*c.ravel()))
    assert np.array(got).reshape(3, 3) == pytest.approx(drag, rel=1e-4)


def test_cells_divide_the_domain_and_walls_lie_on_nodes():
    walled = {"lower": [0, 0, 0.1], "upper": [0.2, 0.13, 0.2], "walls": {"y_lower": "periodic", "y_upper": "periodic"}}
    s = scenario(domain=walled, bodies=[{"kind": "box", "center": [0.1, 0.06, 0.15], "size": [0.04] * 3}])
    cells, dx = mpm_grid.cells_of(s.domain, 0.02)
    assert cells.tolist() == [10, 6, 5] and dx == pytest.approx([0.02, 0.13 / 6, 0.02])
    grid = mpm_grid.grid_of(Scene(s), 0.02)
    assert list(grid.origin) == pytest.approx([-0.08, -4 * 0.13 / 6, 0.02]) and list(grid.wrap) == [0, 6, 0]
    assert grid.inv_volume == pytest.approx(1 / (0.02 * 0.13 / 6 * 0.02)) and list(grid.first) == [4, 4, 4]
    assert list(grid.inv_dx) == pytest.approx([50.0, 6 / 0.13, 50.0]) and grid.top_speed == Scene(s).box.top_speed
    assert list(mpm.first_node(grid, wp.vec3(0.1, 0.0, 0.2))) == [8, 3, 8]  # nodes 8, 9, 10 are 20 mm apart about 0.1 m
    lone = mpm_grid.grid_of(Scene(s), 0.13 / 5)
    assert list(lone.first) == [4, 6, 4] and lone.origin[1] == pytest.approx(-6 * 0.13 / 5)
    assert [mpm_grid.wrapped(n, 6, 5) for n in (4, 5, 6, 10, 11, 12)] == [9, 10, 6, 10, 6, 7]
    assert [mpm_grid.wrapped(n, 4, 0) for n in (0, 99)] == [0, 99]


def mpm_grid_of(**kinds):
    s = scenario(domain={"lower": [0, 0, 0], "upper": [0.2] * 3, "walls": kinds})
    return mpm_grid.grid_of(Scene(s), 0.02)  # ten cells: walls at nodes 4 and 14


def test_nodes_near_walls_and_their_images():
    for kinds, images in (((SLIP, STICK), True), ((FRICTION, FRICTION), False), ((PERIODIC, PERIODIC), False)):
        kinds = [int(k) for k in kinds]
        mirrored = {n: mpm_walls.mirror(n, 10, *kinds) for n in (2, 3, 4, 5, 13, 14, 15, 16)}
        assert mirrored == (
            {2: 6, 3: 5, 4: 4, 5: 5, 13: 13, 14: 14, 15: 13, 16: 12} if images else {n: n for n in mirrored}
        )
        behind = {n: mpm_walls.image(n, 10, *kinds) for n in (3, 4, 5, 6, 12, 13, 14)}
        assert behind == ({3: 3, 4: 4, 5: 3, 6: 6, 12: 12, 13: 15, 14: 14} if images else {n: n for n in behind})
    assert [mpm_walls.wall_kind(n, int(SLIP), int(STICK), 10) for n in (3, 8, 9, 15)] == [SLIP, SLIP, STICK, STICK]
    grid = mpm_grid_of(x_lower="periodic", x_upper="periodic")
    near = {n: bool(mpm_walls.near_wall(grid, wp.vec3i(8, n, 8))) for n in (3, 4, 5, 6, 12, 13, 14, 15)}
    assert near == {3: True, 4: True, 5: True, 6: False, 12: False, 13: True, 14: True, 15: True}
    assert not mpm_walls.near_wall(grid, wp.vec3i(4, 8, 8)) and mpm_walls.near_wall(grid, wp.vec3i(8, 8, 13))
    shares = [mpm_walls.plane_share(grid, wp.vec3i(*n)) for n in ((4, 8, 8), (8, 4, 8), (8, 14, 4), (8, 5, 13))]
    assert shares == [1.0, 2.0, 4.0, 1.0]


def test_velocities_seen_in_walls_and_rubbed_by_them():
    v = (1.0, 2.0, 4.0, 9.0)
    assert list(mpm_walls.flipped(wp.vec4(*v), 1, int(SLIP))) == [1.0, -2.0, 4.0, 9.0]
    assert list(mpm_walls.flipped(wp.vec4(*v), 1, int(STICK))) == [-1.0, -2.0, -4.0, 9.0]
    assert list(mpm_walls.wall_friction(wp.vec3(3.0, 4.0, -2.0), 2, -1.0, 0.5)) == pytest.approx(
        [2.4, 3.2, 0.0]
    )  # 5 - 0.5 x 2
    assert list(mpm_walls.wall_friction(wp.vec3(3.0, 4.0, -2.0), 2, -1.0, 3.0)) == [0.0, 0.0, 0.0]
    assert list(mpm_walls.wall_friction(wp.vec3(3.0, 4.0, 2.0), 2, -1.0, 0.5)) == [3.0, 4.0, 2.0]  # it may lift off
    assert list(mpm_walls.wall_friction(wp.vec3(3.0, 4.0, 2.0), 2, 1.0, 0.5)) == pytest.approx([2.4, 3.2, 0.0])
    assert list(mpm_walls.unbound(wp.vec4(2.0, 4.0, 6.0, 2.0), wp.vec3(0.0, 0.0, -1.0), 5.0)) == [1.0, 2.0, 2.0, 5.0]
    assert list(mpm_walls.unbound(wp.vec4(2.0, 4.0, 6.0, 0.0), wp.vec3(0.0, 0.0, -1.0), 5.0)) == [0.0, 0.0, 0.0, 5.0]


def test_walls_act_on_nodes_on_and_behind_them_by_their_kind():
    grid = mpm_grid_of(
        x_lower="stick", y_lower="slip", y_upper={"friction": 0.25}, z_lower={"friction": 0.5}, z_upper="slip"
    )
    rows = {
        (4, 8, 8): (0.0, 0.0, 0.0),
        (5, 8, 8): V,
        (8, 4, 8): (1.0, 0.0, 4.0),
        (8, 3, 8): (1.0, 0.0, 4.0),
        (8, 8, 4): V,
        (8, 8, 14): (1.0, 2.0, 0.0),
        (14, 8, 8): (0.0, 2.0, 4.0),
        (8, 14, 8): (1.0 * (1 - 0.5 / math.sqrt(17)), 0.0, 4.0 * (1 - 0.5 / math.sqrt(17))),
    }
    for node, expected in rows.items():
        got = mpm_walls.wall_velocity(grid, wp.vec3i(*node), wp.vec3i(1, 1, 1), wp.vec3(*V))
        assert list(got) == pytest.approx(expected), node
    down = mpm_walls.wall_velocity(grid, wp.vec3i(8, 8, 4), wp.vec3i(1, 1, 1), wp.vec3(3.0, 4.0, -2.0))
    assert list(down) == pytest.approx([2.4, 3.2, 0.0])
    untouched = mpm_walls.wall_velocity(grid, wp.vec3i(4, 4, 4), wp.vec3i(0, 0, 0), wp.vec3(*V))
    assert list(untouched) == list(V)
