"""The one field from which all lengths come: the volume fraction of material on a regular grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..scenario import Domain

HALF = 0.5  # the surface of the deposit is where half of the space is filled
FINE = 4  # sections are sampled this many times finer than the field
BLOCK = 1024  # particles spread at once: what they need stays in a processor's cache
PLANES = 5  # over which a section is averaged


@dataclass(frozen=True)
class Deposit:
    """Volume fraction `fill` (nx, ny, nz) in cells of edge `spacing` [m]; cell (0, 0, 0) is centred at `origin` [m].

    Smooth surfaces are known to about a quarter of `spacing`, extents to one `spacing`; the spline's blur draws a
    surface of curvature radius R inwards by spacing^2 / (8 R).
    """

    origin: np.ndarray
    spacing: float
    fill: np.ndarray

    @classmethod
    def of(cls, position: np.ndarray, volume: np.ndarray, domain: Domain, spacing: float) -> "Deposit":
        """Spread particles (n, 3) [m] of rest volume (n,) [m^3] over cells by quadratic splines, mirrored in walls."""
        lower, upper = np.asarray(domain.lower), np.asarray(domain.upper)
        cells = np.ceil((upper - lower) / spacing - 1e-6).astype(int)
        if len(position) == 0:
            return cls(lower + spacing / 2, spacing, np.zeros((3, 3, 3)))
        place = (np.asarray(position).T.astype(float, order="C") - lower[:, None]) / spacing - 0.5
        low, high = (np.floor(end + 0.5).astype(int) for end in (place.min(axis=1), place.max(axis=1)))
        start, stop = low - 3, high + 4
        share = np.asarray(volume, float) / spacing**3
        fill, start = _folded(_spread(place, share, start, tuple(stop - start)), start, cells)
        return cls(lower + (start + 0.5) * spacing, spacing, fill)

    def volume(self) -> float:
        """Total volume [m^3]."""
        return float(self.fill.sum() * self.spacing**3)

    @cached_property
    def _spline(self) -> np.ndarray:
        from scipy.ndimage import spline_filter

        return spline_filter(self.fill, order=3, mode="reflect")

    def plane(self, points: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Fill (n, m) by a cubic spline through the cells, mirrored in the field's faces, at n places (x, y) [m], each
        the mean of k points (n, k, 2), and at m heights `up` (m,) [m]; nothing beyond them."""
        from scipy.sparse import csr_array

        n, k, _ = points.shape
        if not self.fill.size:
            return np.zeros((n, len(up)))
        height = self.fill.shape[2]
        x, y = np.moveaxis((points - self.origin[:2]) / self.spacing, -1, 0)
        (i, wi), (j, wj), (z, wz) = map(_taps, (x, y, (up - self.origin[2]) / self.spacing), self.fill.shape)
        columns = (i[..., :, None] * self.fill.shape[1] + j[..., None, :]).ravel()
        weights = (wi[..., :, None] * wj[..., None, :]).ravel() / k
        rows = np.arange(n + 1) * (16 * k)
        flat = self._spline.reshape(-1, height)
        layers = csr_array((weights, columns, rows), shape=(n, len(flat))) @ flat
        levels = csr_array((wz.ravel(), z.ravel(), np.arange(len(up) + 1) * 4), shape=(len(up), height))
        return (levels @ layers.T).T

    def place(self, point: np.ndarray) -> np.ndarray:
        """Indices (i, j) of the column of cells that a point (x, y) [m] lies in; they may be beyond the field."""
        return np.rint((point - self.origin[:2]) / self.spacing).astype(int)

    def column_heights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(x (nx,), y (ny,), height (nx, ny)) [m]: the material in each vertical column, as if it were solid."""
        x = self.origin[0] + self.spacing * np.arange(self.fill.shape[0])
        y = self.origin[1] + self.spacing * np.arange(self.fill.shape[1])
        return x, y, self.fill.sum(axis=2) * self.spacing

    def top(self, x: float | None = None, y: float | None = None, within: float = 0.0) -> float:
        """Highest point of the surface [m], over the whole deposit or within a radius of a vertical axis; 0 if none."""
        fill = self.fill
        if x is not None and y is not None:
            gx = self.origin[0] + self.spacing * np.arange(fill.shape[0])[:, None] - x
            gy = self.origin[1] + self.spacing * np.arange(fill.shape[1])[None, :] - y
            fill = np.where((np.hypot(gx, gy) <= within)[..., None], fill, 0.0)
        return self.level(fill.max(axis=(0, 1)), 0.0)

    def level(self, profile: np.ndarray, empty: float = -np.inf) -> float:
        """Height at which a profile over the field's layers is half full for the last time [m]; or `empty`."""
        filled = np.flatnonzero(profile >= HALF)
        if len(filled) == 0:
            return empty
        k = filled[-1]
        above = profile[k + 1] if k + 1 < len(profile) else 0.0
        step = (profile[k] - HALF) / max(profile[k] - above, 1e-12)
        return float(self.origin[2] + (k + min(step, 1.0)) * self.spacing)


def _spread(place: np.ndarray, volume: np.ndarray, start: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Volumes (n,) [cells] of particles at `place` (3, n) [cells], spread over a field of this shape (nx, ny, nz) from
    cell `start` on."""
    flat = np.zeros(int(np.prod(shape)))
    three = np.arange(3)
    beside = ((three[:, None, None] * shape[1] + three[:, None]) * shape[2] + three)[..., None]
    for i in range(0, len(volume), BLOCK):
        part = place[:, i : i + BLOCK]
        nearest = np.floor(part + 0.5)
        offset = part - nearest
        x, y, z = np.stack([0.5 * (0.5 - offset) ** 2, 0.75 - offset**2, 0.5 * (0.5 + offset) ** 2], axis=1)
        corner = np.ravel_multi_index(tuple(nearest.astype(int) - 1 - start[:, None]), shape)
        shares = ((x * volume[i : i + BLOCK])[:, None] * y)[:, :, None] * z
        np.add.at(flat, (beside + corner).ravel(), shares.ravel())
    return flat.reshape(shape)


def _taps(place: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """The four cells whose cubic B-splines reach a place [cells], and their weights, 0 beyond the faces: two arrays
    with one axis more."""
    first = np.floor(place)
    t = place - first
    weight = np.stack([(1 - t) ** 3, 4 - 6 * t**2 + 3 * t**3, 1 + 3 * (t + t**2 - t**3), t**3], axis=-1) / 6
    cell = first.astype(int)[..., None] + np.arange(-1, 3)
    cell %= 2 * cells
    weight[(place < -0.5) | (place > cells - 0.5)] = 0.0
    return np.minimum(cell, 2 * cells - 1 - cell), weight


def _folded(fill: np.ndarray, start: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells beyond the domain's faces folded back onto their mirror images, then cut off."""
    start = start.copy()
    for axis in range(3):
        fill = np.moveaxis(fill, axis, 0)
        behind = -start[axis]
        if behind > 0:
            ghost, fill = fill[:behind][::-1], fill[behind:].copy()
            n = min(len(ghost), len(fill))
            fill[:n] += ghost[:n]
            start[axis] = 0
        beyond = start[axis] + len(fill) - cells[axis]
        if beyond > 0:
            ghost, fill = fill[-beyond:][::-1], fill[:-beyond].copy()
            n = min(len(ghost), len(fill))
            fill[len(fill) - n :] += ghost[len(ghost) - n :]
        fill = np.moveaxis(fill, 0, axis)
    return fill, start


@dataclass(frozen=True)
class Section:
    """A vertical cut: fill (across, up) on a fine grid; `across` and `up` are coordinates [m], up from the floor."""

    across: np.ndarray
    up: np.ndarray
    fill: np.ndarray

    @cached_property
    def solid(self) -> np.ndarray:
        """What the outer contour encloses; holes finer than the field's resolution are noise."""
        from scipy.ndimage import label

        empty = np.pad(~(self.fill >= HALF), 1, constant_values=True)  # what is no number fills nothing
        parts = np.zeros(empty.shape, np.int32)
        label(empty, output=parts)
        return parts[1:-1, 1:-1] != parts[0, 0]

    @property
    def _cell(self) -> float:
        """Area of a cell of the fine grid [m^2]."""
        return float((self.across[1] - self.across[0]) * (self.up[1] - self.up[0]))

    @property
    def area(self) -> float:
        """Area within the outer contour [m^2], and what the field's blur cuts off its rounding: spacing^2 / (8 R) along
        an outline adds up to spacing^2 / 8 times the angle that it turns through, whatever its shape: 2 pi, or pi if it
        stands on the floor, which mirrors it."""
        from scipy.ndimage import label

        parts: Any = np.zeros(self.solid.shape, np.int32)
        label(self.solid, output=parts)
        standing = len(np.unique(parts[:, 0][self.solid[:, 0]]))
        turn = np.pi * (2 * int(parts.max()) - standing)
        return self._cell * (float(self.solid.sum()) + turn * FINE**2 / 8)

    @property
    def matter(self) -> float:
        """Volume of matter per length [m^2], wherever in the cut it lies: what `area` is of evenly packed matter."""
        return self._cell * float(self.fill.sum())

    @property
    def width(self) -> float:
        """Largest horizontal extent [m]."""
        columns = np.flatnonzero(self.solid.any(axis=1))
        return float((columns[-1] - columns[0] + 1) * (self.across[1] - self.across[0])) if len(columns) else 0.0

    @property
    def contact(self) -> float:
        """Width of what lies on the floor, from end to end [m]: of what fills space within half a spacing of it, where
        the particles of matter lie that touches it."""
        on = np.flatnonzero(self.solid[:, : FINE // 2].any(axis=1))
        return float((on[-1] - on[0] + 1) * (self.across[1] - self.across[0])) if len(on) else 0.0

    @property
    def height(self) -> float:
        """Highest point above the floor [m]."""
        rows = np.flatnonzero(self.solid.any(axis=0))
        return float((rows[-1] + 1) * (self.up[1] - self.up[0])) if len(rows) else 0.0


def cut(
    deposit: Deposit, point: np.ndarray, direction: np.ndarray, reach: float, height: float, floor: float
) -> Section:
    """The section through `point` (x, y) square to `direction`, averaged over three cells along the path."""
    step = deposit.spacing / FINE
    normal = np.array([-direction[1], direction[0]])
    across = np.arange(-reach, reach, step) + step / 2
    up = np.arange(0.0, height, step) + step / 2
    along = deposit.spacing * np.linspace(-1.5, 1.5, PLANES)
    points = point + across[:, None, None] * normal + along[:, None] * direction
    return Section(across, up, deposit.plane(points, floor + up))
