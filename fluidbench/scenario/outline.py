"""A solid of revolution about a vertical axis, by the polygon that is its section."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Outline:
    """`corners` (n, 2): radius and height [m] of the closed polygon's corners, in order; `slips` is whether matter
    slips along it, or sticks to it."""

    corners: np.ndarray
    slips: bool = False

    @property
    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """First and last ends of the sides, each of shape (n, 2) [m]."""
        return self.corners, np.roll(self.corners, -1, axis=0)

    def distance(self, r: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Signed distance from the surface of points at radius r and height z, of one shape [m]; negative inside."""
        nearest, inside = np.full(np.shape(r), np.inf), np.zeros(np.shape(r), bool)
        for (r0, z0), (r1, z1) in zip(*self.sides, strict=True):
            along = np.clip(((r - r0) * (r1 - r0) + (z - z0) * (z1 - z0)) / ((r1 - r0) ** 2 + (z1 - z0) ** 2), 0, 1)
            nearest = np.minimum(nearest, np.hypot(r - r0 - along * (r1 - r0), z - z0 - along * (z1 - z0)))
            if z0 != z1:
                inside ^= ((z0 > z) != (z1 > z)) & (r < r0 + (z - z0) * (r1 - r0) / (z1 - z0))
        return np.where(inside, -nearest, nearest)

    def normal(self, r: np.ndarray, z: np.ndarray, step: float) -> np.ndarray:
        """Gradient of the distance, shape (..., 2): radial and upward parts, over a `step` [m]; of length 1 but where
        two surfaces are equally near."""
        radial = self.distance(r + step, z) - self.distance(r - step, z)
        upward = self.distance(r, z + step) - self.distance(r, z - step)
        return np.stack([radial, upward], axis=-1) / (2.0 * step)
