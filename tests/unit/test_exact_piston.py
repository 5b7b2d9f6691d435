"""MPM's piston by hand: which nodes it drives, how fast, and when."""

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED
from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.scenario.bore import Bore
from fluidbench.scenario.library import define
from fluidbench.scenario.material import Material
from solvers.mpm.grid import Grid
from solvers.mpm.piston import Piston, driven, reach, sharpened
from solvers.smoothing import quadratic_spline

DOWN = -0.3  # of the nozzle at 0.2 m/s upwards, extruding half of the time at 1 m/s


@wp.kernel
def ask(piston: Piston, grid: Grid, places: wp.array(dtype=wp.vec3), velocity: wp.vec3, found: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    found[i] = driven(piston, grid, places[i], velocity)


def plug(radius):
    return np.ones_like(radius)


def parabola(radius):
    return 2.0 * (1.0 - (radius / 0.1) ** 2)


def answers(places, velocity, feeding=0.5, firm=0, still=0, walled=0, profile=plug, bore=0.1):
    """Of nodes that would move at `velocity`, about a nozzle of radius 0.1 at (1, 2, 3) that goes at (4, 5, 0.2)."""
    piston, grid = Piston(), Grid()
    piston.on, piston.bore = 1, bore
    piston.speed = wp.array(sharpened(profile, 0.1, 0.04**2).astype(np.float32))
    piston.firm, piston.still, piston.walled = firm, still, walled
    piston.reach = reach(bore, (0.04, 0.04, 0.02), walled == 1)
    piston.row, piston.feeding = wp.array([2], dtype=int), wp.array([9.0, feeding, 9.0], dtype=float)
    nowhere = [9.0] * 3
    piston.exit = wp.array([nowhere, nowhere, [1, 2, 3]], dtype=wp.vec3)
    piston.drift = wp.array([nowhere, [4, 5, 0.2], nowhere], dtype=wp.vec3)
    grid.dx = wp.vec3(0.04, 0.04, 0.02)
    found = wp.zeros(len(places), dtype=wp.vec3)
    wp.launch(ask, len(places), [piston, grid, wp.array(places, dtype=wp.vec3), wp.vec3(*velocity)], [found])
    return found.numpy().astype(float)


INSIDE = [[1, 2, 2.995], [1.079, 2, 3.5], [1.056, 2.056, 3.001]]
OUTSIDE = [[1, 2, 2.993], [1.081, 2, 3.5], [1.057, 2.057, 3.001]]  # half a cell of 0.04 from a rim at 0.1


def test_it_drives_the_bore_from_the_first_row_at_the_exit_upwards():
    assert answers(INSIDE, (7, 8, 9)) == pytest.approx(np.tile([4, 5, DOWN], (3, 1)))
    assert answers(OUTSIDE, (7, 8, 9)) == pytest.approx(np.tile([7, 8, 9], (3, 1)))


def test_of_a_bore_of_less_than_two_cells_it_drives_the_node_next_to_the_axis():
    next_to_it = [[1 + x, 2 + y, 3.01] for x in (-0.019, 0.019) for y in (-0.019, 0.019)]
    assert answers(next_to_it, (7, 8, 9), bore=0.03) == pytest.approx(np.tile([4, 5, DOWN], (4, 1)))
    assert answers([[1.03, 2, 3.01]], (7, 8, 9), bore=0.03) == pytest.approx(np.tile([7, 8, 9], (1, 1)))


def test_what_flows_away_faster_is_not_held_back():
    assert answers(INSIDE, (7, 8, -0.5)) == pytest.approx(np.tile([4, 5, -0.5], (3, 1)))


def test_where_viscosity_is_solved_for_what_is_faster_is_held_and_nothing_yields():
    assert answers(INSIDE, (7, 8, -0.5), firm=1) == pytest.approx(np.tile([4, 5, DOWN], (3, 1)))
    assert answers(INSIDE, (7, 8, 9), still=1) == pytest.approx(0.0)
    assert answers(OUTSIDE, (7, 8, 9), firm=1, still=1) == pytest.approx(np.tile([7, 8, 9], (3, 1)))


def test_a_nozzle_that_does_not_extrude_drives_nothing():
    assert answers(INSIDE, (7, 8, 9), feeding=0.0) == pytest.approx(np.tile([7, 8, 9], (3, 1)))


def test_in_the_bore_of_a_body_it_drives_the_wall_too_and_holds_when_nothing_is_extruded():
    wall = [*INSIDE, *OUTSIDE[1:]]
    assert answers(wall, (7, 8, -9), firm=1, walled=1) == pytest.approx(np.tile([4, 5, DOWN], (5, 1)))
    assert answers(wall, (7, 8, 9), feeding=0.0, firm=1, walled=1) == pytest.approx(np.tile([4, 5, 0.2], (5, 1)))
    reach = 0.1 + 1.5 * np.hypot(0.04, 0.04)  # of matter in the bore, on both axes
    beyond = [OUTSIDE[0], [1.0 + 1.01 * reach, 2, 3.5]]
    assert answers(beyond, (7, 8, 9), firm=1, walled=1) == pytest.approx(np.tile([7, 8, 9], (2, 1)))


def test_particles_gather_the_profile_from_what_it_gives_to_nodes():
    """Of a parabola exactly, up to the wall, in which some of the nodes lie: cells of 0.04 in a bore of radius 0.1."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-0.07, 0.07, (40, 2))
    base = np.floor(x / 0.04 - 0.5)
    share = np.stack(np.vectorize(quadratic_spline)(x / 0.04 - base), axis=-1)  # (point, axis, node)
    gathered = np.zeros(len(x))
    for i in range(3):
        for j in range(3):
            node = 0.04 * (base + np.array([i, j]))
            places = np.column_stack([node + np.array([1.0, 2.0]), np.full(len(x), 3.1)])
            speed = 0.2 - answers(places, (0, 0, 0), feeding=1.0, firm=1, walled=1, profile=parabola)[:, 2]
            gathered += share[:, 0, i] * share[:, 1, j] * speed
    assert gathered == pytest.approx(parabola(np.hypot(*x.T)), abs=2e-5)


def test_a_rim_thinner_than_a_cell_is_not_overshot():
    """A Bingham plug: what nodes hold stays within a parabola's share of the mean speed."""
    law = Material(density=2000.0, youngs_modulus=1e6, yield_stress=1e3, plastic_viscosity=0.1)
    bore = Bore(law, 0.2, 0.2)
    nodes = sharpened(bore.profile, 0.1, 0.025**2)
    s = 4.0 * np.linspace(0.0, 1.0, len(nodes))
    exact = bore.profile(0.1 * np.sqrt(s))
    inside = s <= 1.0
    assert exact[inside].min() < 0.5 < 1.0 < exact[0] < 1.1
    assert np.abs(nodes - exact)[inside].max() <= 1.001 * 0.25**2 * exact[inside].mean()


PASTE = {"density": 2000.0, "youngs_modulus": 1e5, "poisson_ratio": 0.45, "yield_stress": 1e3}
SYRUP = {"density": 1000.0, "viscosity": 10.0, "sound_speed": 10.0}
NOZZLE = {"diameter": 0.02, "exit_speed": 0.02, "standoff": 0.02}
DROP = {"bodies": [{"kind": "sphere", "center": [0.05] * 3, "radius": 0.02}], "material": SYRUP}


@pytest.mark.parametrize(
    ("on", "table"),
    [
        (1, {"material": PASTE, "nozzle": NOZZLE}),
        (1, {"material": SYRUP, "nozzle": NOZZLE}),
        (1, {"material": SYRUP, "nozzle": NOZZLE, "numerics": {"mpm": {"viscosity": "implicit"}}}),
        (1, {"material": SYRUP, "nozzle": NOZZLE | {"tip": "flat"}}),
        (1, {"material": PASTE, "nozzle": NOZZLE | {"profile": "developed"}}),
        (0, DROP),
    ],
    ids=["paste", "liquid", "implicit", "body", "developed", "drop"],
)
def test_it_acts_wherever_something_is_fed(on, table):
    path = {"toolpath": {"kind": "line", "start": [0.04, 0.05], "end": [0.06, 0.05], "speed": 0.02}}
    scenario = define(
        "piston",
        domain={"lower": [0, 0, 0], "upper": [0.1] * 3},
        duration=0.1,
        spacing=2.5e-3,
        **table,
        **(path if "nozzle" in table else {}),
    )
    assert Simulation(scenario, "mpm", Target()).solver.piston.on == on


def test_it_goes_as_what_is_carried_does():
    """Around a corner, at the end of a stroke, in travel, and where the clock's rows are written anew."""
    corner = {"kind": "polyline", "points": [[0.03, 0.03], [0.06, 0.03], [0.06, 0.05]], "speed": 0.02}
    scenario = define(
        "corner",
        domain={"lower": [0, 0, 0], "upper": [0.1] * 3},
        material=PASTE,
        nozzle=NOZZLE,
        toolpath=corner,
        duration=2.6,
        tick=2e-3,
        spacing=5e-3,
    )
    sim = Simulation(scenario, "mpm", Target())
    sim.prepare()
    seen = set()
    while sim.done < sim.ticks:
        sim.advance_tick()
        sim.look()
        row, hours = int(sim.scene.clock.hours.row.numpy()[0]), sim.scene.clock.hours
        drift, feeding = hours.drift.numpy()[row - 1], float(hours.feeding.numpy()[row - 1])
        frame = sim.frame()
        carried = frame["velocity"][frame["held"] == CARRIED]
        piston = drift - [0.0, 0.0, feeding * sim.solver.piston.speed.numpy()[0]]
        if len(carried):
            assert carried.mean(axis=0) == pytest.approx(piston, abs=1e-4)
        seen.add(tuple(np.round(piston, 3)))
    assert {(0.02, 0.0, -0.02), (0.0, 0.02, -0.02)} <= seen
