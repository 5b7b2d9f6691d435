"""Which of MPM's nodes a clamp holds, by hand."""

import numpy as np
import pytest

from fluidbench.native.simulation import Simulation
from solvers.mpm.clamp import ANCHOR

from ..conftest import scenario

D, GOING = 0.01, [0.1, -0.2, 0.3]


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("off", [0.0, 0.3, 0.7])
def test_nodes_up_to_a_cell_in_front_of_a_clamp_go_with_it_and_others_hardly_feel_it(ratio, off):
    """A grip that moves beside matter at rest; its face lies anywhere between nodes."""
    block = {"kind": "box", "size": [0.08, 0.08, 0.08]}
    s = scenario(
        domain={"lower": [-0.1 - off * ratio * D, -0.1, 0.0], "upper": [0.2, 0.1, 0.2]},
        bodies=[
            block | {"center": [-0.04, 0.0, 0.1], "clamped": True, "velocity": GOING},
            block | {"center": [0.04, 0.0, 0.1]},
        ],
        gravity=[0, 0, 0],
        spacing=D,
        material={"density": 1000.0, "youngs_modulus": 1e4, "poisson_ratio": 0.3},
        numerics={"mpm": {"grid_ratio": ratio}},
    )
    sim = Simulation(s, "mpm", graphs=False)
    sim.prepare()
    sim.begin()
    solver, grid = sim.solver, sim.solver.grid
    sim.scene.set_dt(1e-9)
    for name in ("clear_grid", "p2g", "grid_step"):
        getattr(solver, name)()
    blocks = solver.block_of.numpy()[: int(solver.active.numpy()[0])]
    rows = solver.moving.numpy()[: 64 * len(blocks)].reshape(len(blocks), 4, 4, 4, 4)
    corners = 4 * np.stack(np.unravel_index(blocks, tuple(grid.blocks)), axis=-1)
    places = corners[:, None, None, None, :] + np.stack(np.indices((4, 4, 4)), axis=-1)
    places = np.array(grid.origin) + places * np.array(grid.dx)
    inside = (np.abs(places[..., 1]) < 0.02) & (np.abs(places[..., 2] - 0.1) < 0.02)
    ahead = places[inside][:, 0] / grid.dx[0]
    velocity = rows[inside][:, :3].astype(float)
    near = (ahead > -2.0) & (ahead < 0.98)
    beyond = (ahead > 1.02) & (ahead < 3.0)
    assert near.any() and beyond.any()
    assert velocity[near] == pytest.approx(np.tile(GOING, (near.sum(), 1)), abs=50.0 / ANCHOR)
    assert (np.abs(velocity[beyond]) < 0.2 * np.abs(GOING)).all()  # of the gradient that matter at rest begins with
