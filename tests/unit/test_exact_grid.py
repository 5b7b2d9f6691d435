"""Stress, cells, nodes and walls of MPM by hand: device functions called one by one."""

import numpy as np
import pytest
import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, SLIP, STICK, Scene
from solvers.mpm import grid as mpm_grid
from solvers.mpm import particle as mpm
from solvers.mpm import walls as mpm_walls

from ..conftest import scenario


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
    got = mpm.kirchhoff(phase, mpm.mean_stress(phase, ratio), wp.vec3(*b), wp.vec3(*off))
    assert np.array(got).reshape(3, 3) == pytest.approx(expected, rel=1e-4)
    drag = 2 * 3.0 * min(ratio, 1.0) * (rate - np.trace(rate) / 3 * one)
    got = mpm.viscous(phase, ratio, wp.mat33(*c.ravel()))
    assert np.array(got).reshape(3, 3) == pytest.approx(drag, rel=1e-4)


def test_cells_divide_the_domain_and_walls_lie_between_nodes():
    walled = {"lower": [0, 0, 0.1], "upper": [0.2, 0.13, 0.2], "walls": {"y_lower": "periodic", "y_upper": "periodic"}}
    s = scenario(domain=walled, bodies=[{"kind": "box", "center": [0.1, 0.06, 0.15], "size": [0.04] * 3}])
    cells, dx = mpm_grid.cells_of(s.domain, 0.02)
    assert cells.tolist() == [10, 6, 5] and dx == pytest.approx([0.02, 0.13 / 6, 0.02])
    grid = mpm_grid.grid_of(Scene(s), 0.02)
    assert list(grid.origin) == pytest.approx([-0.09, -4 * 0.13 / 6, 0.01]) and list(grid.wrap) == [0, 6, 0]
    assert grid.inv_volume == pytest.approx(1 / (0.02 * 0.13 / 6 * 0.02)) and list(grid.first) == [5, 4, 5]
    assert list(grid.inv_dx) == pytest.approx([50.0, 6 / 0.13, 50.0]) and grid.top_speed == Scene(s).box.top_speed
    assert list(mpm.first_node(grid, wp.vec3(0.11, 0.0, 0.2))) == [
        9,
        3,
        9,
    ]  # nodes 9, 10, 11 are 20 mm apart about 0.11 m
    lone = mpm_grid.grid_of(Scene(s), 0.13 / 5)
    assert list(lone.first) == [5, 6, 5] and lone.origin[1] == pytest.approx(-6 * 0.13 / 5)
    assert [mpm_grid.wrapped(n, 6, 5) for n in (4, 5, 6, 10, 11, 12)] == [9, 10, 6, 10, 6, 7]
    assert [mpm_grid.wrapped(n, 4, 0) for n in (0, 99)] == [0, 99]


def mpm_grid_of(**kinds):
    s = scenario(domain={"lower": [0, 0, 0], "upper": [0.2] * 3, "walls": kinds})
    return mpm_grid.grid_of(Scene(s), 0.02)  # ten cells: nodes 5 to 14 in front of walls


def test_nodes_near_walls_and_their_images():
    for kinds, images in (((SLIP, STICK), True), ((FRICTION, FRICTION), True), ((PERIODIC, PERIODIC), False)):
        kinds = [int(k) for k in kinds]
        mirrored = {n: mpm_walls.mirror(n, 10, *kinds) for n in (3, 4, 5, 6, 13, 14, 15, 16)}
        assert mirrored == (
            {3: 6, 4: 5, 5: 5, 6: 6, 13: 13, 14: 14, 15: 14, 16: 13} if images else {n: n for n in mirrored}
        )
        behind = {n: mpm_walls.image(n, 10, *kinds) for n in (4, 5, 6, 13, 14, 15)}
        assert behind == ({4: 4, 5: 4, 6: 6, 13: 13, 14: 15, 15: 15} if images else {n: n for n in behind})
    assert [mpm_walls.wall_kind(n, int(SLIP), int(STICK), 10) for n in (4, 9, 10, 15)] == [SLIP, SLIP, STICK, STICK]
    grid = mpm_grid_of(x_lower="periodic", x_upper="periodic")
    near = {n: bool(mpm_walls.near_any(grid, wp.vec3i(8, n, 8))) for n in (4, 5, 6, 13, 14, 15)}
    assert near == {4: True, 5: True, 6: False, 13: False, 14: True, 15: True}
    assert not mpm_walls.near_any(grid, wp.vec3i(4, 8, 8)) and mpm_walls.near_wall(grid, wp.vec3i(8, 8, 14), 2)
    assert not mpm_walls.near_wall(grid, wp.vec3i(8, 8, 14), 1)
    reached = {n: bool(mpm_walls.in_reach(grid, wp.vec3i(8, n, 8))) for n in (3, 4, 15, 16)}
    assert reached == {3: False, 4: True, 15: True, 16: False}
    assert list(mpm_walls.in_front(grid, wp.vec3i(3, 4, 15))) == [3, 5, 14]


def test_two_walls_never_share_a_cell():
    thin = {"lower": [0, 0, 0], "upper": [0.012, 0.2, 0.2]}
    s = scenario(domain=thin, bodies=[{"kind": "box", "center": [0.006, 0.1, 0.1], "size": [0.01, 0.04, 0.04]}])
    assert mpm_grid.cells_of(s.domain, 0.02)[0].tolist() == [2, 10, 10]


def test_velocities_seen_in_walls_and_rubbed_by_them():
    v = (1.0, 2.0, 4.0, 9.0)
    assert list(mpm_walls.flipped(wp.vec4(*v), 1, int(SLIP))) == [1.0, -2.0, 4.0, 9.0]
    assert list(mpm_walls.flipped(wp.vec4(*v), 1, int(FRICTION))) == [1.0, -2.0, 4.0, 9.0]
    assert list(mpm_walls.flipped(wp.vec4(*v), 1, int(STICK))) == [-1.0, -2.0, -4.0, 9.0]
    grid = mpm_grid_of(x_lower="stick", y_lower={"friction": 0.25}, y_upper={"friction": 0.5}, z_lower="slip")
    low, high, inner = wp.vec3i(8, 4, 8), wp.vec3i(8, 15, 8), wp.vec3i(8, 8, 8)
    assert list(mpm_walls.seen(grid, low, wp.vec3i(8, 5, 8), wp.vec4(*v))) == [1.0, -2.0, 4.0, 9.0]
    assert list(mpm_walls.seen(grid, wp.vec3i(4, 8, 8), wp.vec3i(5, 8, 8), wp.vec4(*v))) == [-1.0, -2.0, -4.0, 9.0]
    assert list(mpm_walls.seen(grid, inner, inner, wp.vec4(*v))) == list(v)
    assert [mpm_walls.friction_of(grid, n, 1) for n in (low, high)] == [0.25, 0.5]
    assert mpm_walls.friction_of(grid, low, 0) < 0.0 and mpm_walls.friction_of(grid, low, 2) < 0.0
    rubbed = mpm_walls.rubbed_by_walls(grid, low, wp.vec3(0.0, 2.0, 0.0), wp.vec3(3.0, 7.0, 4.0))
    assert list(rubbed) == pytest.approx([2.7, 7.0, 3.6])  # 5 - 0.25 x 2
    rubbed = mpm_walls.rubbed_by_walls(grid, high, wp.vec3(0.0, 20.0, 0.0), wp.vec3(3.0, 7.0, 4.0))
    assert list(rubbed) == [0.0, 7.0, 0.0]
    free = mpm_walls.rubbed_by_walls(grid, low, wp.vec3(0.0, -1.0, 0.0), wp.vec3(3.0, 7.0, 4.0))
    assert list(free) == [3.0, 7.0, 4.0]
    assert list(mpm_walls.unbound(wp.vec4(2.0, 4.0, 6.0, 2.0), wp.vec3(0.0, 0.0, -1.0), 5.0)) == [1.0, 2.0, 2.0, 5.0]
    assert list(mpm_walls.unbound(wp.vec4(2.0, 4.0, 6.0, 0.0), wp.vec3(0.0, 0.0, -1.0), 5.0)) == [0.0, 0.0, 0.0, 5.0]
