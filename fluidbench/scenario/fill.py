"""Bodies from functions of Python: what no shape and no expression describes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .body import Body

Field = Callable[[np.ndarray], Any]


def fill(
    lower: Sequence[float],
    upper: Sequence[float],
    spacing: float,
    inside: Field | None = None,
    velocity: Field | None = None,
    **more: Any,
) -> Body:
    """A body of particles on a lattice of about `spacing` [m] between two corners `lower` and `upper` [m], kept where
    `inside(points)` holds, with the velocities `velocity(points)` [m/s]; both get points of shape (n, 3) and return
    (n,) and (n, 3).
    `more` are keys of the body, such as `clamped`.

    Raises ValueError where nothing is inside.
    """
    if not 0 < spacing < np.inf:
        raise ValueError(f"spacing must be positive, got {spacing}")
    edges = np.asarray(upper, float) - np.asarray(lower, float)
    cells = np.maximum(1, np.rint(edges / spacing).astype(int))
    axes = [low + (np.arange(n) + 0.5) * edge / n for low, n, edge in zip(lower, cells, edges, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if inside is not None:
        points = points[np.broadcast_to(np.asarray(inside(points), bool), (len(points),))]
    if not len(points):
        raise ValueError("no point of the lattice is inside")
    moving = None if velocity is None else np.broadcast_to(np.asarray(velocity(points), float), points.shape)
    volumes = np.full(len(points), float((edges / cells).prod()))
    return Body.model_validate({"kind": "points", "positions": points, "velocities": moving, "volumes": volumes} | more)
