"""A length as it goes with the spacing, and its limit at none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..runs.record import Run
from .lengths import lengths_of

ORDERS = (0, 1, 2)  # in the spacing, that a length may have
NOISE = 0.01  # share of a length that its scatter may have without casting doubt on a fit
SURE = 0.9  # probability with which a slope must be told from none
FINEST = 3  # spacings by which it is judged whether a length has settled


@dataclass(frozen=True)
class Fit:
    """A length as limit + slope d^order: its limit at zero spacing, and its distance from the fit at each spacing; no
    slope at order 0."""

    limit: float
    slope: float
    residual: dict[float, float]
    order: int = 1

    @property
    def explains(self) -> bool:
        """Whether the length goes with the spacing by more than chance, or has settled."""
        return self.rises or self.settled

    @property
    def rises(self) -> bool:
        """Whether its slope is told from none at SURE, two-sided, by the scatter about the fit: of three spacings one
        is left to tell the scatter by, so that they must lie on the fit all but exactly. No slope is none."""
        return self.order > 0 and abs(self.slope) > self.doubt

    @property
    def doubt(self) -> float:
        """Half the width of the slope's interval at SURE: Student's t times its standard error, by least squares of
        weights 1 / d. In the slope's unit."""
        from scipy.special import stdtrit

        d, free = np.array(list(self.residual)), len(self.residual) - 2
        if free < 1:
            return math.inf
        x, w = d**self.order, d**-2.0
        spread = float(w @ (x - np.average(x, weights=w)) ** 2)
        scatter = float(w @ np.array(list(self.residual.values())) ** 2) / free
        return float(stdtrit(free, 0.5 + 0.5 * SURE)) * math.sqrt(scatter / spread)

    @property
    def settled(self) -> bool:
        """Whether it has no more `unrest` than a length can be told to."""
        return self.unrest <= NOISE

    @property
    def unrest(self) -> float:
        """The largest distance from the fit at the FINEST spacings, over the limit. What it was off by when it was
        coarser does not count: it is not expected to have been as near."""
        furthest = max(self.residual[d] for d in sorted(self.residual)[:FINEST])
        return furthest / abs(self.limit) if self.limit else math.inf

    def scatter(self, spacing: float) -> float:
        """The largest distance from the fit at this spacing and finer ones."""
        return max(r for d, r in self.residual.items() if d <= spacing * (1 + 1e-9))


def extrapolate(runs: Sequence[Run], key: str) -> Fit:
    """At the one of ORDERS that foretells each spacing best from the others. Weighted by the inverse spacing, since
    what a length scatters by falls with it."""
    d = np.array([r.record.spacing_m for r in runs])
    q = np.array([lengths_of(r.record)[key] for r in runs])
    order = min(ORDERS, key=lambda order: _missed(d, q, order))
    slope, limit = _line(d, q, order)
    residual = np.abs(q - (slope * d**order + limit))
    return Fit(limit, slope, dict(zip(d.tolist(), residual.tolist(), strict=True)), order)


def _line(d: np.ndarray, q: np.ndarray, order: int) -> tuple[float, float]:
    """(slope, value at d = 0) of a line in d^order through q; of the level, where that is 0."""
    if order == 0:
        return 0.0, float(np.average(q, weights=d**-2.0))
    slope, limit = np.polyfit(d**order, q, 1, w=1.0 / d)
    return float(slope), float(limit)


def _missed(d: np.ndarray, q: np.ndarray, order: int) -> float:
    """By how much a line through the others misses each point, over its spacing: the sum of squares."""
    total = 0.0
    for i in range(len(d)):
        slope, limit = _line(np.delete(d, i), np.delete(q, i), order)
        total += float((q[i] - (slope * d[i] ** order + limit)) / d[i]) ** 2
    return total
