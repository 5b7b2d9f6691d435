"""In what order matter ended: how near particles came, and how dense it is."""

from __future__ import annotations

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario

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


def departures(measures: dict[str, float]) -> list[str]:
    """What is to be said of matter that has lost or gained volume."""
    mean = measures.get("mean_density", 1.0)
    if abs(mean - 1.0) <= DEPARTED:
        return []
    return [f"its mean density is {mean:.3g} of that at rest: its volume is not to be trusted"]
