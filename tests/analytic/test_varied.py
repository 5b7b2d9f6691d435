"""What the known answers hold fixed, varied: how long matter rests, grid ratios, sound speeds, the speed of a bead."""

import numpy as np
import pytest

from fluidbench.measure.ledger import final_lengths, lengths
from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.runs.drive import Drive
from fluidbench.scenario.library import define, load
from fluidbench.scenario.numerics import configure


def frames(scenario, ratio):
    """Snapshots of a run of MPM at every output."""
    config = configure(get_method("mpm"), scenario).model_copy(update={"grid_ratio": ratio})
    sim, found = Simulation(scenario, "mpm", Target(), config), []
    outcome = Drive(sim, scenario, lambda session, vital: found.append(session.frame())).run()
    assert outcome.verdict == "completed", outcome.reason
    return found


@pytest.mark.parametrize("ratio", [1.0, 1.25, 1.5, 2.0, 2.5])
@pytest.mark.parametrize(
    "more", [{}, {"sound_speed": 40.0}, {"sound_speed": 10.0, "youngs_modulus": 3.5e4, "yield_stress": 196.2}]
)
def test_a_ball_in_free_flight_keeps_shape_and_density(ratio, more):
    flight = define(
        "flight",
        domain={"lower": [0, 0, 0], "upper": [0.8, 0.6, 0.8]},
        material={"density": 1000.0, **more},
        gravity=[0.0, 0.0, -9.81],
        bodies=[{"kind": "sphere", "center": [0.3] * 3, "radius": 0.05, "velocity": [1.0, 0.0, 2.0]}],
        duration=0.3,
        output_interval=0.3,
        spacing=0.05 / 6,
    )
    first, last = frames(flight, ratio)
    before, after = (f["position"].astype(float) - f["position"].astype(float).mean(axis=0) for f in (first, last))
    assert np.abs(after - before).max() < 2e-3 * 0.05
    assert last["density"].mean() == pytest.approx(1000.0, rel=1e-3)


@pytest.mark.parametrize(("stress", "answer"), [(0.2, 0.325), (0.3, 0.122)])
def test_a_slumped_column_rests(stress, answer):
    """Between its time and four times it nothing moves by more than 1.5 % of H."""
    column = load(
        "column_slump",
        {"spacing": 0.1 / 24, "material.yield_stress": stress * 981.0, "duration": 6.0, "output_interval": 1.5},
    )
    slump = np.array([lengths(frame, column)["slump"] for frame in frames(column, 1.5)])
    assert slump[1] == pytest.approx(answer, abs=0.05)
    assert abs(slump[4] - slump[1]) < 0.015
    assert abs(slump[4] - slump[3]) / 1.5 < 1e-3  # less than 0.1 mm/s


@pytest.mark.parametrize("ratio", [1.5, 2.0])
def test_a_bead_keeps_its_section_at_any_grid_ratio(ratio):
    bead = load("line_bead", {"spacing": 2e-3})
    area = final_lengths(frames(bead, ratio)[-1], bead)["bead_area_m2"]
    assert area == pytest.approx(np.pi / 4 * 0.012**2, rel=0.04)
