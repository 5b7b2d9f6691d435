"""How a wall of layers comes down: when, under how many layers, and whether it leant over or its foot gave way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

LEANT = 0.5  # of the foot's width, by which a layer has moved sideways when the wall has lost its balance
SUNK = 0.25  # of the height laid so far, by which a wall has come down that did not lean


class Mode(StrEnum):
    """What gave way."""

    BUCKLING = "buckling"
    YIELDING = "yielding of the foot"


@dataclass(frozen=True)
class Collapse:
    """When a wall came down [s], how many layers lay whole by then, and how it did."""

    time: float
    layers: int
    mode: Mode


def posture(across: np.ndarray, up: np.ndarray, mass: np.ndarray, layer: np.ndarray) -> dict[str, float]:
    """How a wall stands, from distances across its path (n,) [m], heights (n,) [m], masses and layers (0, 1, ..; less
    than 0 is not laid): how far the centre of any layer lies off the path, how wide the lowest layer is, and how high
    the upper face of the wall, both from the spread of a uniform layer, sqrt(12) its standard deviation [m]."""
    lean, foot, top = 0.0, 0.0, 0.0
    for k in np.unique(layer[layer >= 0]):
        own = layer == k
        x, z, m = across[own], up[own], mass[own]
        center, middle = np.average(x, weights=m), np.average(z, weights=m)
        lean = max(lean, abs(float(center)))
        top = max(top, float(middle + np.sqrt(3.0 * np.average((z - middle) ** 2, weights=m))))
        if k == 0:
            foot = float(np.sqrt(12.0 * np.average((x - center) ** 2, weights=m)))
    return {"wall_lean_m": lean, "foot_width_m": foot, "wall_top_m": top}


def collapse_of(
    times: Sequence[float],
    layers: Sequence[int],
    height: float,
    lean: Sequence[float],
    foot: Sequence[float],
    top: Sequence[float],
) -> Collapse | None:
    """The first time at which a wall of layers of this height [m] has come down, from how many lie whole and its
    posture at these times; None if it stands.

    It has where a layer lies LEANT of the foot's first width off the path, or where the wall lacks SUNK of the height
    laid. It buckled if it leant farther than its foot had spread to either side. A foot of no width says nothing yet.
    """
    laid = [k for k, n in enumerate(layers) if n > 0 and foot[k] > 0.0]
    for k in laid:
        width = foot[laid[0]]
        leant, low = lean[k] >= LEANT * width, top[k] <= (1.0 - SUNK) * height * layers[k]
        if leant or low:
            spread = 0.5 * (foot[k] - width)
            return Collapse(times[k], layers[k], Mode.BUCKLING if lean[k] > spread else Mode.YIELDING)
    return None
