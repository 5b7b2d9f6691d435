"""Columns and fronts: how far what stood at the start has sunk and spread."""

import numpy as np

from ..scenario import Scenario
from .deposit import Deposit


def measure_slump(deposit: Deposit, scenario: Scenario) -> dict[str, float]:
    """Slump and spread of the first body, if it is a cylinder; front and height of it, if it is a box."""
    if not scenario.bodies or any(body.start > 0 for body in scenario.bodies):
        return {}
    body, floor, start = scenario.bodies[0], scenario.domain.lower[2], height_before(scenario)
    if body.kind == "cylinder" and body.where is None:
        x, y = body.center[0], body.center[1]
        top = deposit.top(x, y, within=0.25 * float(body.extent[0])) - floor
        return {"slump": 1.0 - top / start, "spread_radius_m": spread_radius(deposit, x, y)}
    if body.kind == "box":
        return {"front_x_m": front(deposit) - scenario.domain.lower[0], "height_m": deposit.top() - floor}
    return {}


def height_before(scenario: Scenario) -> float:
    """Height to which the first body reaches at the start [m]."""
    body = scenario.bodies[0]
    return float(body.center[2] + body.extent[2]) - scenario.domain.lower[2]


def front(deposit: Deposit) -> float:
    """x at which the height averaged over y falls below one spacing [m], interpolated (references.md, conventions)."""
    x, _, heights = deposit.column_heights()
    return _falls_below(x, heights.mean(axis=1), deposit.spacing)


def spread_radius(deposit: Deposit, x0: float, y0: float) -> float:
    """Radius about an axis at which the azimuthally averaged height falls below one spacing [m]."""
    return _falls_below(*radial_heights(deposit, x0, y0), deposit.spacing)


def radial_heights(deposit: Deposit, x0: float, y0: float) -> tuple[np.ndarray, np.ndarray]:
    """(mean radius (n,), azimuthally averaged height (n,)) [m] of rings one cell wide about a vertical axis."""
    x, y, heights = deposit.column_heights()
    radius = np.hypot(x[:, None] - x0, y[None, :] - y0)
    ring = np.rint(radius / deposit.spacing).astype(int)
    cells = np.bincount(ring.ravel())
    full = cells > 0

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(ring.ravel(), values.ravel())[full] / cells[full]

    return mean(radius), mean(heights)


def _falls_below(x: np.ndarray, values: np.ndarray, level: float) -> float:
    """The last x at which `values` crosses `level` downwards, linear between samples; the first x if none does."""
    above = np.flatnonzero(values >= level)
    if len(above) == 0:
        return float(x[0])
    i = above[-1]
    if i + 1 == len(x):
        return float(x[i])
    share = (values[i] - level) / max(values[i] - values[i + 1], 1e-30)
    return float(x[i] + share * (x[i + 1] - x[i]))
