"""What strand_two_layers reads, of two strands whose sections are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from fluidbench.method.frame import FREE
from scenarios.analytic import strand_two_layers as case

SPACING = 0.0025


def bar(scenario, wide, low, high):
    """Particles of a bar along the path, as far as the middle is read."""
    d = scenario.nozzle.diameter
    sides = [(0.0, case.LENGTH * d), (-wide / 2, wide / 2), (low, high)]
    return np.stack(np.meshgrid(*(np.arange(a + SPACING / 2, b, SPACING) for a, b in sides)), -1).reshape(-1, 3)


def laid(name, lower, upper):
    """A run that ended with bars of these widths and heights, (m, m), one on the other."""
    scenario = case.strands(name, SPACING)
    parts = [bar(scenario, lower[0], 0.0, lower[1]), bar(scenario, upper[0], lower[1], lower[1] + upper[1])]
    x = np.concatenate(parts)
    turn = scenario.track.end / 2
    frame = {
        "time": np.array(scenario.duration),
        "position": x,
        "volume": np.full(len(x), SPACING**3),
        "held": np.full(len(x), FREE),
        "birth_time": np.repeat([0.5 * turn, 1.5 * turn], [len(part) for part in parts]),
    }
    return SimpleNamespace(scenario=scenario, frames=[frame])


@pytest.mark.parametrize("name", case.PUBLISHED)
def test_each_strand_is_read_by_itself(name):
    run = laid(name, (0.03, 0.01), (0.02, 0.015))
    found = case.measured(run)
    assert found["width"] == pytest.approx(0.03, abs=0.5 * SPACING)
    assert found["height"] == pytest.approx(0.01, abs=0.5 * SPACING)
    assert found["area"] == pytest.approx(0.03 * 0.01 + 0.02 * 0.015, rel=0.02)


def test_an_error_is_that_of_the_worse_length():
    """One strand as published, and one that is a fifth too wide."""
    runs = {}
    for name, row in case.PUBLISHED.items():
        wide = row["w1_mm"] / 1e3 * (1.2 if name == "ID5" else 1.0)
        runs[name] = laid(name, (wide, row["h1_mm"] / 1e3), (0.02, 0.01))
    assert case.evaluate(runs).error == pytest.approx(0.2, abs=0.5 * SPACING / 0.0231)


def test_only_strands_are_judged_that_hold_their_matter():
    """A width and a height that are less than a strand's section cannot both be right."""
    assert len(case.PUBLISHED) >= 2
    for row in case.PUBLISHED.values():
        assert row["w1_mm"] * row["h1_mm"] > row["mass_balance_area_mm2"] / 2
