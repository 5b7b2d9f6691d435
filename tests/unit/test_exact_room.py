"""What MPM's nodes tell of the space that matter shares, by hand."""

import numpy as np
import pytest
import warp as wp

from fluidbench.native.simulation import Simulation
from solvers.mpm.grid import Grid
from solvers.mpm.nodes import room_of

from ..conftest import scenario

EDGE, D, DENSITY = 0.16, 0.01, 1000.0


@wp.kernel
def ask(
    grid: Grid,
    position: wp.array(dtype=wp.vec3),
    density: float,
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    found: wp.array(dtype=wp.vec2),
):
    p = wp.tid()
    room, least, _slope = room_of(grid, 0, position[p], density, table, moving)
    found[p] = wp.vec2(room, least)


def rooms(moved, walls="periodic", heavier=1.0):
    """(room, least share of a node) of the particles of a cube that fills its domain, each `moved` from its place in a
    lattice [m], where the nodes of every other plane are heavier by a factor."""
    sides = {f"{axis}_{side}": walls for axis in "xyz" for side in ("lower", "upper")}
    s = scenario(
        domain={"lower": [0.0] * 3, "upper": [EDGE] * 3, "walls": sides},
        bodies=[{"kind": "box", "center": [EDGE / 2] * 3, "size": [EDGE] * 3}],
        gravity=[0, 0, 0],
        spacing=D,
        material={"density": DENSITY, "viscosity": 1.0},
    )
    sim = Simulation(s, "mpm", graphs=False)
    sim.prepare()
    sim.begin()
    pool, solver = sim.pool, sim.solver
    x = pool.position.numpy().astype(float) + moved(pool.size)
    pool.position.assign((x % EDGE if walls == "periodic" else x).astype(np.float32))
    solver.refresh()
    sim.scene.set_dt(1e-9)
    for name in ("clear_grid", "p2g", "grid_step"):
        getattr(solver, name)()
    rows = solver.moving.numpy()
    with np.errstate(over="ignore", invalid="ignore"):  # of nodes that are not in use, which hold anything
        rows[::2, 3] *= heavier  # along z nodes follow each other
    solver.moving.assign(rows)
    found = wp.zeros(pool.size, dtype=wp.vec2)
    wp.launch(ask, pool.size, [solver.grid, pool.position, DENSITY, solver.table, solver.moving], [found])
    return found.numpy().astype(float).T


@pytest.mark.parametrize("walls", ["periodic", "stick"])
def test_a_lattice_has_its_own_space_and_walls_mirror_it(walls):
    assert rooms(lambda n: np.zeros((n, 3)), walls) == pytest.approx(1.0, abs=1e-4)


def test_nodes_that_a_clamp_holds_are_full_and_lighter_ones_leave_room():
    """Inertia of clamps is 1e4 times their own (clamp.py). Of the weights of particles a quarter of a cell from a
    node 11/16 are on that, the others on its neighbours, of which one in two is light."""

    def still(n):
        return np.zeros((n, 3))

    assert rooms(still, heavier=1e4) == pytest.approx(1.0, abs=1e-4)
    room, least = rooms(still, heavier=0.8)
    light = np.where(room > 1.125, 11 / 16, 5 / 16)
    assert room == pytest.approx(1.0 + light * (1.0 / 0.8 - 1.0), abs=1e-4) and room.mean() == pytest.approx(1.125)
    assert least == pytest.approx(0.8, abs=1e-4)


def test_all_particles_take_all_of_the_space_however_they_lie():
    """Each has as much mass as any other: the mean of their shares is 1."""
    rng = np.random.default_rng(5)
    found, least = rooms(lambda n: rng.uniform(-0.9 * D, 0.9 * D, (n, 3)))
    assert found.mean() == pytest.approx(1.0, abs=1e-4)
    assert found.std() > 0.03 and (least < 1.0).all()
