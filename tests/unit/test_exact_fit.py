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
    ("d", "t"), [((1.0, 2.0, 4.0), 6.3138), ((1.0, 1.5, 2.0, 3.0), 2.9200), ((1, 1.5, 2, 3, 4), 2.3534)]
)
@pytest.mark.parametrize("order", [1, 2])
def test_a_slope_is_known_to_students_t_times_its_standard_error(d, t, order):
    """By numpy's own covariance of a weighted fit; t is that of 5 % either side."""
    d = np.array(d, float)
    q = 3.0 + 0.2 * d**order + 0.01 * d * np.cos(7.0 * d)
    (slope, limit), covariance = np.polyfit(d**order, q, 1, w=1 / d, cov=True)
    residual = dict(zip(d, np.abs(q - limit - slope * d**order), strict=True))
    doubt = Fit(limit, slope, residual, order).doubt
    assert doubt == pytest.approx(t * covariance[0, 0] ** 0.5, rel=1e-4)
    for share, rises in ((1.01, True), (-1.01, True), (0.99, False)):
        assert Fit(limit, share * doubt, residual, order).rises is rises
    assert not Fit(limit, 0.0, residual, 0).rises and Fit(limit, 1.0, dict.fromkeys(d, 0.0), order).rises
    assert not Fit(0.0, 1.0, {1.0: 0.0, 2.0: 0.0}).rises  # any two lie on a line


@pytest.mark.parametrize(
    ("limit", "off", "settled"),
    [
        (10.0, (0.1, 0.0, 0.1, 5.0), True),  # a hundredth of the length at the three finest spacings
        (-10.0, (0.1, 0.0, 0.1, 5.0), True),
        (10.0, (0.0, 0.0, 0.101, 0.0), False),
        (0.0, (0.0, 0.0, 0.0, 0.0), False),
    ],
)
def test_what_has_settled_is_within_a_percent_at_the_finest_spacings(limit, off, settled):
    fit = Fit(limit, 0.0, dict(zip((1.0, 1.5, 2.0, 3.0), off, strict=True)), 0)
    assert fit.settled is settled and fit.explains is settled


def test_one_coarse_spacing_does_not_unsettle_what_has_settled():
    """Heights of honey by PBD on an H200, over their limit: within 0.5 % from 2.25 mm on."""
    heights = {0.75: 0.997, 1.125: 0.996, 1.5: 1.0, 2.25: 0.996, 3.0: 1.081}
    fit = extrapolate([height(a, b) for a, b in heights.items()], "height_m")
    assert fit.settled and fit.explains and not fit.rises


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_noise_is_seldom_taken_for_a_slope_and_a_slope_seldom_for_noise(count):
    """A scatter of 5 % of a length, falling with the spacing, beside no slope; and of 0.5 % beside one of 10 %."""
    chance, d = np.random.default_rng(1), np.array([2.0, 1.5, 1.0, 0.75, 0.5, 0.4])[:count]

    def taken(slope, scatter):
        values = (1.0 + slope * d + scatter * d * chance.standard_normal(count) for _ in range(200))
        fits = (extrapolate([height(a, b) for a, b in zip(d, q, strict=True)], "height_m") for q in values)
        return sum(fit.rises for fit in fits) / 200

    assert taken(0.0, 0.05) < 0.2 and taken(0.1, 0.005) > 0.85
