"""What the passes of position-based fluids share, in both languages."""

import numpy as np
import warp as wp

from ..smoothing import spiky, spiky_slope


@wp.struct
class Numbers:
    """Numbers of the discretisation."""

    support: float  # kernel radius H [m]
    spacing: float  # [m]
    weight: float  # makes the density sum exactly 1 on a lattice at rest [-]
    relaxation: float  # constraint force mixing epsilon [-]
    over_relaxation: float  # share of the Jacobi correction that is applied [-]
    face: float  # density at the face of a lattice, over that at rest [-]
    face_slope: float  # sum of the gradients there, over 1 / spacing [-]
    iterations: float  # of the density constraints in a substep


# Floats in the rows that neighbours are asked for. Of density: position, volume. Of its constraints: the same |
# multiplier. Of velocities: the same | velocity. Of stress: the same | stress (9).
PLACE, PUSH, MOVING, PULLING = 4, 8, 8, 16


def lattice_sum(support_ratio: float) -> float:
    """Kernel sum of unit volumes on a cubic lattice of unit spacing."""
    n = int(support_ratio) + 1
    axis = np.arange(-n, n + 1)
    r2 = sum(np.square(g) for g in np.meshgrid(axis, axis, axis))
    return float(sum(spiky(float(value), support_ratio) for value in np.sqrt(np.ravel(r2))))


def face_sums(support_ratio: float) -> tuple[float, float]:
    """(W, |grad W|) summed at the face of a cubic half lattice of unit spacing, over the sum of W within it."""
    n = int(support_ratio) + 1
    axis = np.arange(-n, n + 1)
    x, y, z = (np.ravel(g).astype(float) for g in np.meshgrid(axis, axis, axis))
    half, r = z <= 0, np.sqrt(x * x + y * y + z * z)
    whole = lattice_sum(support_ratio)
    slopes = [spiky_slope(float(s), support_ratio) * u / s for s, u in zip(r[z < 0], z[z < 0], strict=True)]
    return sum(spiky(float(s), support_ratio) for s in r[half]) / whole, abs(sum(slopes)) / whole
