"""Bodies from functions of Python: what no shape and no expression describes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from ..errors import UserError, quoted
from .body import Body
from .extent import ADDRESSABLE, too_many
from .mistakes import mistakes
from .model import check_number
from .units import amount

Field = Callable[[np.ndarray], Any]


def fill(
    lower: Sequence[float | str],
    upper: Sequence[float | str],
    spacing: float | str,
    inside: Field | None = None,
    velocity: Field | None = None,
    **more: Any,
) -> Body:
    """A body of particles on a lattice of about `spacing` [m] between two corners `lower` and `upper` [m], kept where
    `inside(points)` holds, with the velocities `velocity(points)` [m/s]; both get points of shape (n, 3) and return
    (n,) and (n, 3). Lengths are numbers, or texts such as "5 mm".
    `more` are keys of the body, such as `clamped`.

    Raises UserError for what are no corners, no spacing or no key, for more than 2^26 points between the corners, for
    functions that fail or return another shape, and where nothing is inside.
    """
    low, high, d = _corner(lower, "lower"), _corner(upper, "upper"), _length(spacing, "spacing")
    if d <= 0:
        raise UserError(f"fill: spacing: a positive length is wanted (got {quoted(spacing)})")
    for axis, a, b in zip("xyz", low, high, strict=True):
        if b <= a:
            raise UserError(f"fill: upper is to lie above lower; along {axis} they are {b:g} and {a:g} m")
    edges = np.asarray(high) - np.asarray(low)
    if (count := math.prod(max(1, round(min(float(edge) / d, 1e18))) for edge in edges)) > ADDRESSABLE:
        raise UserError(f"fill: spacing = {d:g} m: between the corners are {too_many(count)}; use a larger spacing")
    cells = np.maximum(1, np.rint(edges / d).astype(int))
    axes = [start + (np.arange(n) + 0.5) * edge / n for start, n, edge in zip(low, cells, edges, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if inside is not None:
        points = points[_values(inside, "inside", points, (len(points),), bool)]
    if not len(points):
        raise UserError("fill: no point of the lattice is inside")
    moving = None if velocity is None else _values(velocity, "velocity", points, points.shape, float)
    volumes = np.full(len(points), float((edges / cells).prod()))
    table = {"kind": "points", "positions": points, "velocities": moving, "volumes": volumes} | more
    try:
        return Body.model_validate(table)
    except ValidationError as error:
        raise mistakes(error, "fill", Body) from None


def _corner(given: Any, what: str) -> list[float]:
    """Three lengths [m]; raises UserError for what are none."""
    if not isinstance(given, list | tuple | np.ndarray) or np.ndim(given) != 1 or len(given) != 3:
        raise UserError(f"fill: {what}: three lengths are wanted, such as [0, 0, '5 mm'] (got {quoted(given)})")
    return [_length(value, what) for value in given]


def _length(given: Any, what: str) -> float:
    """A length [m]; raises UserError for what is none."""
    try:
        if isinstance(given, bool | np.bool_):
            raise ValueError("true and false are no lengths")
        value = amount(given, "m")
        check_number(value)
    except ValueError as error:
        raise UserError(f"fill: {what}: {error}") from None
    return value


def _values(function: Field, what: str, points: np.ndarray, shape: tuple[int, ...], kind: type) -> np.ndarray:
    """What a user's function returns for points, in this shape; raises UserError where it fails or returns another."""
    if not callable(function):
        raise UserError(f"fill: {what}: a function of points, shape (n, 3), is wanted (got {quoted(function)})")
    try:
        given = function(points)
    except Exception as error:
        raise UserError(f"fill: {what} failed for points of shape (n, 3): {type(error).__name__}: {error}") from error
    try:
        return np.broadcast_to(np.asarray(given, kind), shape)
    except (TypeError, ValueError):
        got = f"shape {np.shape(given)}" if isinstance(given, np.ndarray) else quoted(given)
        wanted = "(n,)" if kind is bool else "(n, 3)"
        raise UserError(f"fill: {what}: values of shape {wanted}, n = {len(points)}, are wanted (got {got})") from None
