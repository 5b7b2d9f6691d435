"""How crowded MPM lets go of what is carried: by hand, for grids that move as told."""

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.clock import Hours
from fluidbench.native.scene import Scene
from solvers.mpm.grid import grid_of
from solvers.mpm.release import crowd

from ..conftest import scenario

DX, D, U, OUTLET, RATE = 0.02, 0.01, 0.1, 0.098, 40.0


def let_go(speeds, dt, start=1.2 * D, slope=2.0, drift=0.0, held=CARRIED):
    """J that is owed by a particle that is carried down at U from `start` above the outlet [m], while nodes there go
    down at each of these speeds [m/s] for dt [s], and slower by `slope` [1/s] with height; outlet and all go at `drift`
    [m/s]."""
    grid = grid_of(Scene(scenario(domain={"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2]}, spacing=D)), DX)
    nodes = np.arange(grid.blocks_per_world * 64)
    block = nodes // 64
    height = (block % grid.blocks[2]) * 4 + (nodes & 3)
    ints = {"dtype": int, "device": "cpu"}
    table = wp.array(np.arange(grid.blocks_per_world) + 1, **ints)
    owed, ratio = (wp.array([v], dtype=float, device="cpu") for v in (0.0, 1.0))
    hours = Hours()
    hours.row = wp.array([1], **ints)
    hours.drift = wp.array([[0.0, 0.0, drift], [9.0] * 3], dtype=wp.vec3, device="cpu")
    velocity = wp.array([[0.0, 0.0, drift - U]], dtype=wp.vec3, device="cpu")
    for step, speed in enumerate(speeds):
        outlet = OUTLET + drift * dt * step
        moving = np.zeros((nodes.size, 4), np.float32)
        moving[:, 2] = drift - speed + slope * (grid.origin[2] + DX * height - outlet)
        place = [[0.1, 0.1, outlet + start - U * dt * (step + 1)]]  # where it has come to in this step
        hours.exit = wp.array([[9.0] * 3, [0.0, 0.0, outlet]], dtype=wp.vec3, device="cpu")
        matter = [wp.array([int(held)], **ints), wp.array(place, dtype=wp.vec3, device="cpu"), velocity]
        some = [wp.vec3i(0, 1, 0), grid, 1, wp.array([1], **ints), wp.array([dt], dtype=float, device="cpu"), D, RATE]
        given = [*some, hours, *matter, table, wp.array(moving, dtype=wp.vec4, device="cpu"), owed, ratio]
        wp.launch(crowd, dim=1, inputs=given, device="cpu")
    assert ratio.numpy()[0] == 1.0  # what is owed by what is carried presses nothing
    return float(np.exp(owed.numpy()[0]))


@pytest.mark.parametrize("drift", [0.0, -0.3, 0.2])
@pytest.mark.parametrize("below", [0.03, 0.08, 0.1, 0.15, 0.4])
def test_flux_is_the_same_on_both_sides_of_the_outlet(below, drift):
    """J = u / U at the outlet, whatever u is above, where what is carried is still; within a factor of two of 1."""
    assert let_go([below] * 12, 0.01, drift=drift) == pytest.approx(min(max(below / U, 0.5), 2.0), rel=1e-4)


def test_what_beats_with_the_rows_of_the_stream_is_averaged_over_one_of_them():
    """Faster right after a row was let go, slower before the next: the mean of a spacing, not what is seen at its end,
    nor what was seen before."""
    beat = [0.13, 0.11, 0.1, 0.1, 0.1, 0.09, 0.09, 0.08, 0.08, 0.08]
    assert let_go([0.2, 0.2, *beat], 0.01) == pytest.approx(np.mean(beat) / U, rel=1e-4)
    finer = np.repeat([0.2, 0.2, *beat], 7)
    assert let_go(finer, 0.01 / 7) == pytest.approx(np.mean(beat) / U, rel=1e-3)


def test_only_what_is_carried_and_nearly_out_is_crowded():
    assert let_go([0.05] * 10, 0.01, held=FREE) == 1.0
    assert let_go([0.05] * 10, 0.01, held=CLAMPED) == 1.0
    assert let_go([0.05] * 10, 0.01, start=2.1 * D) == 1.0  # a spacing or more above it all the time
    assert let_go([0.05], 0.0) == 1.0  # no time, no way


def test_what_is_owed_is_paid_in_the_time_in_which_the_rest_of_a_disc_passes():
    """J comes to exactly that, however long steps are, by an e-th of what is left in a quarter of d / U."""
    ints = {"dtype": int, "device": "cpu"}
    nothing = [wp.zeros(1, dtype=kind, device="cpu") for kind in (wp.vec3, wp.vec3, int, wp.vec4)]
    for owing, dt in ((-0.2, 1e-3), (0.1, 7e-3)):
        count, steps, free = wp.array([1], **ints), wp.array([dt], dtype=float, device="cpu"), wp.array([FREE], **ints)
        owed = wp.array([owing], dtype=float, device="cpu")
        ratio = wp.array([0.9], dtype=float, device="cpu")
        grid = grid_of(Scene(scenario(domain={"lower": [0, 0, 0], "upper": [0.2, 0.2, 0.2]}, spacing=D)), DX)
        given = [wp.vec3i(0, 1, 0), grid, 1, count, steps, D, RATE, Hours(), free, *nothing, owed, ratio]
        seen = []
        for _ in range(round(0.5 / dt)):
            wp.launch(crowd, dim=1, inputs=given, device="cpu")
            seen.append(float(ratio.numpy()[0]))
        after = round(1.0 / (RATE * dt))
        left = np.log(0.9 * np.exp(owing) / seen[after - 1]) / owing
        assert left == pytest.approx(np.exp(-RATE * dt * after), rel=0.01)
        assert seen[-1] == pytest.approx(0.9 * np.exp(owing), rel=1e-5) and owed.numpy()[0] == 0.0
