"""In what order matter ended: how near particles came, how dense it is, and whether it rests."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

LAST = 0.2  # share of the time over which creep is taken
DEPARTED = 0.05  # of mean density from rest, beyond which a run says so
CELL = 2.0  # edge of the cells in which particles are counted, in spacings


def order(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Least distance of two particles over their spacing at rest; least, mean and largest density over that at rest;
    most particles in a cell of two spacings over the eight of a lattice. Nothing of a single particle."""
    from scipy.spatial import cKDTree

    free = frame["held"] != CARRIED
    if free.sum() < 2:
        return {}
    place, volume = frame["position"][free].astype(float), frame["volume"][free].astype(float)
    edge = np.cbrt(volume)
    distance, index = cKDTree(place).query(place, k=2)
    partner = edge[index[:, 1]]
    density = frame["density"][free] * volume / frame["mass"][free]
    cells = np.floor((place - place.min(axis=0)) / (CELL * scenario.spacing)).astype(np.int64)
    width = cells.max(axis=0) + 1
    _, filled = np.unique((cells[:, 0] * width[1] + cells[:, 1]) * width[2] + cells[:, 2], return_counts=True)
    return {
        "least_distance": float((2.0 * distance[:, 1] / (edge + partner)).min()),
        "least_density": float(density.min()),
        "mean_density": float(density.mean()),
        "largest_density": float(density.max()),
        "most_in_cell": float(filled.max()) / CELL**3,
    }


def creep(series: pd.DataFrame) -> dict[str, float]:
    """Largest change of any length per second over the last fifth of a run [m/s]; nothing without lengths."""
    lengths = [name for name in series if name.endswith("_m") and not name.startswith(("resolution", "center"))]
    if not lengths or len(series) < 2:
        return {}
    time = series["time_s"].to_numpy()
    begins = min(int(np.searchsorted(time, (1.0 - LAST) * time[-1] * (1.0 + 1e-9), side="right")) - 1, len(time) - 2)
    span = time[-1] - time[begins]
    change = series[lengths].iloc[-1] - series[lengths].iloc[begins]
    return {"creep_m_per_s": float(change.abs().max() / span)} if span > 0 else {}


def departures(measures: dict[str, float]) -> list[str]:
    """What is to be said of matter that has lost or gained volume."""
    mean = measures.get("mean_density", 1.0)
    if abs(mean - 1.0) <= DEPARTED:
        return []
    return [f"its mean density is {mean:.3g} of that at rest: its volume is not to be trusted"]
