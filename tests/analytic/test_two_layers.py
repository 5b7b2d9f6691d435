"""What strand_two_layers reads, of two strands whose outline is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from fluidbench.method.frame import FREE
from scenarios.analytic import strand_two_layers as case

SPACING = 0.00125
LOWER, NECK, UPPER = 0.030, 0.020, 0.028  # widths [m]


def laid(name, parts=((LOWER, 0.0, 0.75), (NECK, 0.75, 1.25), (UPPER, 1.25, 2.0)), past=0.0):
    """A run that ended with bars on top of one another: their widths [m], from and to over the gap; what is above the
    gap begins `past` [m]."""
    scenario = case.strands(name, SPACING)
    d, gap = scenario.nozzle.diameter, scenario.nozzle.standoff
    sizes = (case.LENGTH * d, 2.0 * max(wide for wide, _, _ in parts), parts[-1][2] * gap)
    axes = [np.arange(SPACING / 2, size, SPACING) for size in sizes]
    x = np.stack(np.meshgrid(*axes), -1).reshape(-1, 3) - [0.0, sizes[1] / 2, 0.0]
    part = np.searchsorted([high * gap for _, _, high in parts], x[:, 2])
    x = x[np.abs(x[:, 1]) < np.array([wide / 2 for wide, _, _ in parts])[part]]
    x = x[(x[:, 2] < gap) | (x[:, 0] > past)]
    frame = {
        "time": np.array(scenario.duration),
        "position": x,
        "volume": np.full(len(x), SPACING**3),
        "held": np.full(len(x), FREE),
    }
    return SimpleNamespace(scenario=scenario, frames=[frame])


@pytest.mark.parametrize("name", case.PUBLISHED)
def test_the_notch_is_where_the_strands_meet(name):
    run = laid(name)
    gap, found = run.scenario.nozzle.standoff, case.measured(run)
    assert found["height"] == pytest.approx(gap, abs=0.25 * SPACING)
    assert found["width"] == pytest.approx(LOWER, abs=0.5 * SPACING)
    assert found["contact"] == pytest.approx(NECK, abs=0.5 * SPACING)
    assert found["area"] == pytest.approx(gap * (0.75 * LOWER + 0.5 * NECK + 0.75 * UPPER), rel=0.02)


def published(name):
    """Bars with the lower strand's width and notch as published, and the area of both strands."""
    row, gap = case.PUBLISHED[name], case.PUBLISHED[name]["gap_mm"]
    neck = row["h1_mm"] / gap
    low, high = neck - 0.1, neck + 0.1
    rest = row["mass_balance_area_mm2"] / gap - low * row["w1_mm"] - (high - low) * 0.8 * row["w1_mm"]
    top = 1.9
    upper = rest / (top - high)
    parts = ((row["w1_mm"], 0.0, low), (min(0.8 * row["w1_mm"], 0.8 * upper), low, high), (upper, high, top))
    return tuple((wide / 1e3, a, b) for wide, a, b in parts)


def test_what_is_as_published_passes_and_a_strand_that_is_too_wide_or_missing_does_not():
    runs = {name: laid(name, published(name)) for name in case.PUBLISHED}
    assert case.evaluate(runs).error < case.TOLERANCE / 2
    wide = tuple((1.25 * w, a, b) for w, a, b in published("ID5"))
    assert case.evaluate(runs | {"ID5": laid("ID5", wide)}).error > case.TOLERANCE
    alone = published("ID5")[:1]
    assert case.evaluate(runs | {"ID5": laid("ID5", alone)}).error > case.TOLERANCE
    film = tuple((w, 0.1 * a, 0.1 * b) for w, a, b in published("ID5"))
    assert case.evaluate(runs | {"ID5": laid("ID5", film)}).error > case.TOLERANCE
    torn = laid("ID5", published("ID5"), past=0.075)
    assert case.evaluate(runs | {"ID5": torn}).error > case.TOLERANCE
