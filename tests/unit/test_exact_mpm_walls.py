"""MPM beside walls, at the outlet, and out of crowds: numbers worked out by hand."""

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.scene import Phase, Scene
from fluidbench.native.simulation import Simulation
from solvers.mpm import grid as mpm_grid
from solvers.mpm import particle as mpm
from solvers.mpm import walls as mpm_walls

from ..conftest import scenario

DX = 0.02
FIRST = int(mpm_grid.FIRST)


def grid_with(**kinds):
    s = scenario(domain={"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2], "walls": kinds}, spacing=0.01)
    return mpm_grid.grid_of(Scene(s), DX)


def column(grid, masses, momenta, axis=2, at=8):
    """(table, raw) of a grid whose nodes in one column hold masses and momenta along the axis, from two cells behind
    the lower wall on."""
    blocks = grid.blocks_per_world
    raw = np.zeros((blocks * 64, 4), np.float32)
    for k, (mass, momentum) in enumerate(zip(masses, momenta, strict=True)):
        node = [at, at, at]
        node[axis] = FIRST - 2 + k
        block = ((node[0] >> 2) * grid.blocks[1] + (node[1] >> 2)) * grid.blocks[2] + (node[2] >> 2)
        place = block * 64 + ((node[0] & 3) << 4) + ((node[1] & 3) << 2) + (node[2] & 3)
        raw[place, axis], raw[place, 3] = momentum, mass
    table = wp.array(np.arange(1, blocks + 1, dtype=np.int32), dtype=int, device="cpu")
    return table, wp.array(raw, dtype=wp.vec4, device="cpu")


@pytest.mark.parametrize(("gap", "hold"), [(0.0, 1.0), (0.28, 1.0), (0.385, 0.5), (0.49, 0.0), (0.9, 0.0)])
@pytest.mark.parametrize("width", [1.0, 0.3])
def test_contact_goes_by_the_gap_and_not_by_the_width_that_is_filled(gap, hold, width):
    grid = grid_with(z_lower="stick")
    depth = np.arange(gap, 4.0, 1e-4) + 0.5e-4
    masses = [width * 1e-4 * spline(depth - k - 0.5).sum() for k in (-2, -1, 0, 1, 2, 3)]
    table, raw = column(grid, masses, [0.0] * 6)
    got = asked(ask_grip, float, grid, wp.vec3i(8, 8, FIRST + 1), table, raw)
    assert got == pytest.approx(hold, abs=0.03)


@wp.kernel
def ask_grip(
    grid: mpm_grid.Grid,
    node: wp.vec3i,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    out: wp.array(dtype=float),
):
    out[0] = mpm_walls.grip(grid, 0, node, 2, table, raw)


@wp.kernel
def ask_folded(
    grid: mpm_grid.Grid,
    node: wp.vec3i,
    touching: wp.vec3i,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    out: wp.array(dtype=wp.vec4),
):
    out[0] = mpm_walls.folded(grid, 0, node, touching, table, raw)


@wp.kernel
def ask_touched(
    grid: mpm_grid.Grid,
    node: wp.vec3i,
    kick: wp.vec3,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    out: wp.array(dtype=wp.vec4),
):
    touching, hold, into = mpm_walls.touched(grid, 0, node, kick, table, raw)
    out[0] = wp.vec4(float(touching[0]), float(touching[2]), hold, into[2])


def asked(kernel, kind, *arguments):
    """What a kernel puts into the first place of its last array."""
    out = wp.zeros(1, dtype=kind, device="cpu")
    wp.launch(kernel, 1, [*arguments, out], device="cpu")
    return out.numpy()[0]


def spline(x):
    x = np.abs(x)
    return np.where(x < 0.5, 0.75 - x * x, np.where(x < 1.5, 0.5 * (1.5 - x) ** 2, 0.0))


@pytest.mark.parametrize("axis", [0, 2])
def test_what_is_behind_a_wall_is_folded_back_across_it(axis):
    """Slip walls turn the component across round, no-slip walls all; where no wall acts nothing is folded."""
    for kind, across in (("slip", 2.0 - 0.5), ("stick", 2.0 - 0.5), ({"friction": 0.5}, 2.0 - 0.5)):
        grid = grid_with(**{"xyz"[axis] + "_lower": kind})
        table, raw = column(grid, [0.0, 0.25, 0.75, 1.0, 1.0, 1.0], [0.0, 0.5, 2.0, 3.0, 0.0, 0.0], axis)
        node = [8, 8, 8]
        node[axis] = FIRST
        touching = wp.vec3i(*np.eye(3, dtype=int)[axis].tolist())
        got = asked(ask_folded, wp.vec4, grid, wp.vec3i(*node), touching, table, raw)
        assert got[axis] == pytest.approx(across) and got[3] == pytest.approx(1.0)
        assert np.delete(got[:3], axis) == pytest.approx(0.0)
        free = asked(ask_folded, wp.vec4, grid, wp.vec3i(*node), wp.vec3i(0, 0, 0), table, raw)
        assert free[axis] == pytest.approx(2.0) and free[3] == pytest.approx(0.75)


def test_friction_walls_act_on_what_goes_into_them_and_by_what_they_stop():
    """Momenta across -0.9 in front and -0.1 behind, masses 0.75 and 0.25, forces -0.5: without a wall both go down at
    1.5 on the mean, with it at (-0.9 + 0.1) / 1 - 0.5 in front and up behind, which leaves them -1.3 x 0.5."""
    grid = grid_with(z_lower={"friction": 0.5})
    for node in (FIRST, FIRST - 1):
        table, raw = column(grid, [0.0, 0.25, 0.75, 1.0, 1.0, 1.0], [0.0, -0.1, -0.9, 0.0, 0.0, 0.0])
        got = asked(ask_touched, wp.vec4, grid, wp.vec3i(8, 8, node), wp.vec3(0.0, 0.0, -0.5), table, raw)
        assert list(got) == pytest.approx([0.0, 1.0, 1.0, 1.5 - 1.3 * 0.5])
        table, raw = column(grid, [0.0, 0.25, 0.75, 1.0, 1.0, 1.0], [0.0, 0.1, 0.9, 0.0, 0.0, 0.0])
        off = asked(ask_touched, wp.vec4, grid, wp.vec3i(8, 8, node), wp.vec3(0.0, 0.0, -0.5), table, raw)
        assert off[1] == 0.0 and off[3] < 0.0  # it lifts off
    above = asked(ask_touched, wp.vec4, grid, wp.vec3i(8, 8, FIRST + 1), wp.vec3(0.0, 0.0, -0.5), table, raw)
    assert list(above[:2]) == [0.0, 0.0]


@pytest.mark.parametrize("kind", ["stick", "slip"])
@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0, 2.5])
def test_no_transfer_beside_a_wall_gains_energy(ratio, kind):
    """Scatter and gather of random velocities by particles in no order, a floor within their reach, nothing moving:
    the energy of the nodes falls, and nothing grows however often."""
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2], "walls": {"z_lower": kind}},
        bodies=[{"kind": "box", "center": [0.1, 0.1, 0.03], "size": [0.1, 0.1, 0.06]}],
        numerics={"mpm": {"grid_ratio": ratio}},
        spacing=0.01,
        jitter=0.3,
        gravity=[0, 0, 0],
    )
    sim = Simulation(s, "mpm", graphs=False)
    solver, pool = sim.solver, sim.pool
    random = np.random.default_rng(1)
    n = int(pool.count.numpy()[0])
    velocity = pool.velocity.numpy()
    velocity[:n] = random.normal(size=(n, 3))
    pool.velocity.assign(velocity)
    sim.scene.dt.zero_()
    solver.refresh()
    energies = []
    for _ in range(40):
        for name in solver.passes:
            getattr(solver, name)()
        used = int(solver.active.numpy()[0]) * 64
        moving, raw = solver.moving.numpy()[:used], solver.raw.numpy()[:used]
        energies.append(float((raw[:, 3] * (moving[:, :3].astype(float) ** 2).sum(axis=1)).sum()))
    assert energies[0] > 0.0 and max(np.diff(energies)) <= 1e-6 * energies[0]


def shifted(c, density=1.1, lean=(0.1, 0.0, -0.2), held=FREE, ratio=1.0, yield_stress=10.0, step=1e-3):
    phase = Phase()
    phase.density, phase.shear_modulus, phase.yield_stress = 1.0, 1e3, yield_stress
    sums = np.zeros((4, 4), np.float32)
    sums[:, 3] = [density, *lean]
    rows = wp.mat44(*sums.ravel())
    return np.array(mpm.shifted(grid_with(), phase, rows, wp.mat33(*np.ravel(c)), step, ratio, int(held)))


def test_particles_leave_a_crowd_as_fast_as_matter_shears():
    shear = np.zeros((3, 3))
    shear[0, 2] = 5.0  # rate 5 1/s
    assert shifted(shear) == pytest.approx(-1e-3 * 5.0 * 4.0 * DX * np.array([0.1, 0.0, -0.2]), rel=1e-5)
    assert shifted(1e6 * shear) == pytest.approx(-4.0 / 6.0 * DX * np.array([0.1, 0.0, -0.2]), rel=1e-5)  # no farther
    turn = np.array([[0.0, -5.0, 0.0], [5.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    still = np.zeros((3, 3))
    for left_alone in (still, turn, 3.0 * np.eye(3)):
        assert shifted(left_alone) == pytest.approx(0.0, abs=1e-9)
    for more in ({"density": 0.99}, {"ratio": 0.9}, {"density": 1e4}, {"held": CLAMPED}, {"held": CARRIED}):
        assert not shifted(shear, **more).any()
    assert not shifted(shear, yield_stress=1e3).any()  # a solid's volume is its strain
    assert shifted(shear, density=9.0).any() and not shifted(shear, density=11.0).any()  # a clamp's crowd
