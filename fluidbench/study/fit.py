"""A length as it goes with the spacing, and its limit at none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..runs.record import Run
from .lengths import lengths_of

ORDERS = (0, 1, 2)  # in the spacing, that a length may have
NOISE = 0.01  # share of a length that its scatter may have without casting doubt on a fit


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
        """Whether the fit says more of the length than chance: its distances from it are small beside what it rises
        over the spacings, or beside the length itself."""
        rise = abs(self.slope) * (max(self.residual) ** self.order - min(self.residual) ** self.order)
        return max(self.residual.values()) <= max(0.5 * rise, NOISE * abs(self.limit))

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
