"""What a rigid body does to particles near it, summed up beforehand: kernel moments of the space that it fills.

A body that is matter to its neighbours completes their kernels: each sum over pairs goes on into it. Its matter mirrors
that of the particle which asks: the same density and stress, and a velocity that is the body's at the surface and goes
on linearly behind it, u_j - u = -(d_j / d_i) (u_i - u) with d the distances from the surface (Morris et al. 1997, J.
Comput. Phys. 136:214). Then all that it adds to a sum is a moment of the kernel times what the particle knows itself,
and the moments depend on its place alone (volume maps: Bender et al. 2019, MIG '19; density maps: Koschier & Bender
2017, SCA '17). Of a solid of revolution they are tables over radius and height; nothing is summed in a run.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fluidbench.scenario.outline import Outline

Radial = Callable[[float], float]
FINE = 4  # points of the table, and of the sums behind it, a particle spacing
QUADS = 6  # fours of floats of an entry


@dataclass(frozen=True)
class Weights:
    """Of matter at a distance r [m] from a particle, per volume: those of the passes that go on into the body."""

    slope: Radial  # s(r): sums of s r, s r r and s
    drag: Radial  # w(r): sums of w r r
    full: Radial  # f(r): sums of f
    level: Radial | None = None  # l(r): sums of these, and of (s r)^2


@dataclass(frozen=True)
class ToolMap:
    """`table` (rows, columns, 4 QUADS) float32 over height from `low` up and radius from the axis out, at every `pitch`
    [m]; beyond the last row it is as there."""

    table: np.ndarray
    low: float
    pitch: float


def tool_map(outline: Outline, spacing: float, reach: float, weights: Weights | None) -> ToolMap:
    """The moments everywhere within reach [m] of a body; without weights the distance alone. Entry: distance, its
    gradient (r, z), sum s | sum s r (r, z), the same times depth | sum s r r (rr, tt, zz, rz) | sum w r r | the same
    times depth | sum s times depth, sum of l, of (s r)^2 spacing^3, and of f. Depth is that below the surface, t goes
    around the axis."""
    pitch = spacing / FINE
    levels = np.unique(outline.corners[:, 1])
    heights = np.arange(levels[0] - reach - pitch, levels[-2] + reach + 2 * pitch, pitch)
    radii = np.arange(0.0, outline.corners[:, 0].max() + reach + 2 * pitch, pitch)
    radius, height = np.meshgrid(radii, heights)
    table = np.zeros((*radius.shape, 4 * QUADS))
    table[..., 0] = outline.distance(radius, height)
    table[..., 1:3] = outline.normal(radius, height, 1e-3 * spacing)
    if weights is not None:
        ball = Ball.of(pitch, reach, spacing, weights)
        for at in zip(*np.nonzero(np.abs(table[..., 0]) < reach), strict=True):
            table[at][3:] = ball.within(outline, float(radius[at]), float(height[at]))
    return ToolMap(table.astype(np.float32), float(heights[0]), pitch)


@dataclass(frozen=True)
class Ball:
    """Half of all that a particle reaches, on one side of the plane through the axis, in small cells; arrays (n,)."""

    step: float  # [m]
    place: np.ndarray  # (3, n): along the radius, square to it, and up [m]
    slope: np.ndarray
    drag: np.ndarray
    level: np.ndarray
    square: np.ndarray
    full: np.ndarray

    @classmethod
    def of(cls, step: float, reach: float, spacing: float, weights: Weights) -> "Ball":
        n = int(reach / step) + 1
        axis = (np.arange(-n, n) + 0.5) * step
        place = np.stack([g.ravel() for g in np.meshgrid(axis, axis[axis > 0], axis, indexing="ij")])
        r = np.linalg.norm(place, axis=0)
        place, r = place[:, r < reach], r[r < reach]
        slope, drag, full = (
            np.array([law(float(x)) for x in r]) for law in (weights.slope, weights.drag, weights.full)
        )
        level = np.zeros(len(r)) if weights.level is None else np.array([weights.level(float(x)) for x in r])
        return cls(step, place, slope, drag, level, (slope * r) ** 2 * spacing**3, full)

    def within(self, outline: Outline, radius: float, height: float) -> np.ndarray:
        """What stands behind the distance and its gradient in an entry."""
        x, y, z = self.place
        distance = outline.distance(np.hypot(radius + x, y), height + z)
        part = 2.0 * self.step**3 * np.clip(0.5 - distance / self.step, 0.0, 1.0)  # of both halves
        depth = part * np.maximum(-distance, 0.0)
        first = self.place[[0, 2]]
        return np.array(
            [
                part @ self.slope,
                *(-first @ (part * self.slope)),  # r points from the body to the particle
                *(-first @ (depth * self.slope)),
                *self._pairs(part * self.slope),
                *self._pairs(part * self.drag),
                *self._pairs(depth * self.drag),
                depth @ self.slope,
                part @ self.level,
                part @ self.square,
                part @ self.full,
            ]
        )

    def _pairs(self, weight: np.ndarray) -> list[float]:
        """Second moments: rr, tt, zz, rz."""
        x, y, z = self.place
        return [float(weight @ (a * b)) for a, b in ((x, x), (y, y), (z, z), (x, z))]
