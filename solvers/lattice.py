"""What sums over partners come to in a cubic lattice: constants that make them exact there, and its shortest waves."""

import math
from functools import cache

import numpy as np

from fluidbench.method.timestep import damped_limit

from .smoothing import wendland_slope


def lattice(support: float) -> np.ndarray:
    """Places (n, 3) of a unit lattice about one of them that may be within its support, itself included."""
    axis = np.arange(-int(support) - 1, int(support) + 2)
    return np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3).astype(float)


def opposed(places: np.ndarray, weights: np.ndarray, axes: int = 1) -> float:
    """Sum of weights over those places that move against the middle in the shortest wave along one axis, or along the
    diagonal of several."""
    return float(weights[places[:, :axes].sum(axis=1) % 2 == 1].sum())


def sloping(ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Places of a unit lattice and SPH's -W'/r there (n,), with h = ratio."""
    places = lattice(2 * ratio)
    slopes = [-wendland_slope(float(np.linalg.norm(place)) / ratio, ratio) for place in places]
    return places, np.array(slopes)


@cache
def lattice_moments(ratio: float) -> tuple[float, float]:
    """Sums over a unit lattice with h = ratio, each 1 in the continuum: the second moment -sum V r^2 W' / (3 r), which
    scales summed density, and the fourth -5 sum V x^2 z^2 W' / r^3, which scales viscosity in shear."""
    places, slopes = sloping(ratio)
    r2 = (places**2).sum(axis=1)
    fourth = slopes * places[:, 0] ** 2 * places[:, 2] ** 2 / np.maximum(r2, 1.0)
    return float((slopes * r2).sum() / 3.0), float(5.0 * fourth.sum())


def viscous_scale(ratio: float) -> float:
    """What viscosity is multiplied by: the geometric mean of what shear along the axes of a lattice needs, and of 1."""
    return lattice_moments(ratio)[1] ** -0.5


@cache
def opposing(ratio: float, axes: int = 1) -> float:
    """Sum of SPH's -V W' / r over the partners in a unit lattice that move against a particle: see `opposed`.

    A velocity v in that wave has q = 2 v opposing; with l = 1 / opposing (in spacings) g does the work that the stress
    between neighbours would do, G (2 v / d)^2 / 2 a volume, at zeta = 1, and at zeta = pi^2 / 4 the shortest wave is as
    fast as all others.
    """
    return opposed(*sloping(ratio), axes)


def hourglass_limit(ratio: float, zeta: float, shear_speed: float, alpha_c: float) -> float:
    """Largest stable dt over the spacing [s/m] of waves that no gradient shows, along axes and diagonals.

    They have omega = 2 sqrt(zeta) c_s f / d and are damped at 4 f^2 nu / d^2, with nu = alpha h c / 10 and f being
    `opposing` over that along an axis.
    """
    f = max(opposing(ratio, axes) for axes in (1, 2, 3)) / opposing(ratio)
    wave = math.sqrt(zeta) * shear_speed * f
    damping = 4.0 * f * f * alpha_c * ratio / 10.0
    viscous = 2.0 / damping if damping > 0 else math.inf
    return damped_limit(1.0 / wave, viscous) if wave > 0 else viscous
