"""How a length goes with the spacing: the order that foretells best, its limit and its scatter."""

import numpy as np
import pytest

from fluidbench.study.fit import Fit, extrapolate

from .made import finished


def height(spacing, value):
    return finished(measures={"height_m": value}, spacing=spacing)


def test_extrapolation_weighs_by_the_inverse_spacing():
    """Minimising sum ((q - a - b d) / d)^2 over d = 1, 2, 4 and q = 1, 2, 0."""
    d, q = np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 0.0])
    slope, limit = np.linalg.lstsq(np.stack([np.ones(3), 1 / d], axis=1), q / d, rcond=None)[0]
    fit = extrapolate([height(a, b) for a, b in zip(d, q, strict=True)], "height_m")
    assert fit.limit == pytest.approx(limit) and fit.slope == pytest.approx(slope)
    assert fit.residual == pytest.approx({a: abs(b - limit - slope * a) for a, b in zip(d, q, strict=True)})


def test_a_slope_that_foretells_nothing_is_noise():
    """About a level the limit is the level, about a line it is the line's."""
    d = (1.0, 1.5, 2.0, 3.0)
    level = extrapolate([height(a, b) for a, b in zip(d, (1.0, 1.1, 0.9, 1.0), strict=True)], "height_m")
    w = np.array(d) ** -2.0
    assert level.slope == 0.0 and level.limit == pytest.approx(w @ [1.0, 1.1, 0.9, 1.0] / w.sum())
    noisy = [1.0 + 0.2 * a + e for a, e in zip(d, (0.01, -0.01, 0.01, -0.01), strict=True)]
    rising = extrapolate([height(a, b) for a, b in zip(d, noisy, strict=True)], "height_m")
    assert rising.slope == pytest.approx(0.2, abs=0.02) and rising.limit == pytest.approx(1.0, abs=0.03)
    assert (level.order, rising.order) == (0, 1)
    curved = extrapolate([height(a, 1.0 + 0.2 * a * a) for a in d], "height_m")
    assert curved.order == 2 and (curved.limit, curved.slope) == (pytest.approx(1.0), pytest.approx(0.2))
    assert curved.explains and max(curved.residual.values()) < 1e-9


def test_one_spacing_that_is_far_too_wide_does_not_turn_the_limit_over():
    """Widths of a foam 2 to 3 particles across: a line through them ends below nothing."""
    widths = {16.5: 0.299, 13.8: 0.136, 11.0: 0.123}
    found = extrapolate([height(a, b) for a, b in widths.items()], "height_m")
    assert found.slope == 0.0 and 0.123 < found.limit < 0.2 and not found.explains


def test_scatter_is_the_largest_from_a_spacing_down():
    fit = Fit(1.0, 0.0, {1.0: 0.3, 2.0: 0.1, 4.0: 0.5})
    assert [fit.scatter(d) for d in (1.0, 2.0, 4.0)] == [0.3, 0.3, 0.5]
    assert Fit(1.0, 0.0, {0.3: 0.2, 0.1 * 3: 0.1}).scatter(0.3 * (1 - 1e-12)) == 0.2  # rounding leaves none out


@pytest.mark.parametrize(
    ("limit", "slope", "largest", "explains"),
    [
        (0.0, 1.0, 1.5, True),  # half of a rise of 3 over the spacings
        (0.0, -1.0, 1.5, True),
        (0.0, 1.0, 1.51, False),
        (10.0, 0.0, 0.1, True),  # a hundredth of the length
        (-10.0, 0.0, 0.1, True),
        (10.0, 0.0, 0.101, False),
    ],
)
def test_a_line_explains_what_rises_twice_its_scatter_or_scatters_by_a_percent(limit, slope, largest, explains):
    assert Fit(limit, slope, {1.0: 0.0, 2.0: -largest if largest < 0 else largest, 4.0: 0.0}).explains is explains
