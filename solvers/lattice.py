"""What sums over partners come to in a cubic lattice: constants that make them exact there, and its shortest waves."""

import math
from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from fluidbench.method.timestep import damped_limit

from .smoothing import drag_weight, wendland_slope

WAVES = 16  # numbers of waves that are tried along an axis


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
def lattice_moment(ratio: float) -> float:
    """-sum V r^2 W' / (3 r) over a unit lattice with h = ratio, 1 in the continuum: scales summed density."""
    places, slopes = sloping(ratio)
    return float((slopes * (places**2).sum(axis=1)).sum() / 3.0)


@cache
def stiffest_drag(support: float, thinnest: float) -> float:
    """The fastest rate [nu / d^2] at which pairs damp a wave (viscosity.py), `support` in spacings, with no fullness
    below `thinnest`: in a lattice, or in sheets, threads and blocks cut from it, up to three spacings thick, where each
    pair stands for more."""
    sizes = combinations_with_replacement((0, 1, 2, 3), 3)
    return max(drag_rate(size, support, thinnest) for size in sizes)


@cache
def drag_rate(size: tuple[int, int, int], support: float, thinnest: float) -> float:
    """The same of a lattice that is so many spacings thick along each axis; 0 where it goes on for ever."""
    wide = np.array(size) == 0
    around = 2 * (int(support) + 1) * wide
    thick, ways = (np.array(list(np.ndindex(*n)), float) for n in (np.where(wide, 1, size), around + 1))
    away = ways - around / 2
    r = thick[:, None, None] - thick[None, :, None] - away  # (own, other, cell, 3)
    r2 = (r * r).sum(axis=-1)
    squares, which = np.unique(r2, return_inverse=True)
    weight = np.array([drag_weight(math.sqrt(q) / support, support) for q in squares])[which].reshape(r2.shape)
    full = np.sqrt(np.maximum((weight * r2).sum(axis=(1, 2)) / 3.0, thinnest))
    weight *= 10.0 / (full[:, None, None] * full[None, :, None] * np.maximum(r2, 1.0))
    pulls = np.einsum("ijc,ijca,ijcb->ijcab", weight, r, r)
    waves = np.array(list(np.ndindex(*((WAVES if wide.sum() < 3 else WAVES // 2) * wide + 1))), float)
    turns = np.exp(1j * np.pi * (waves / np.maximum(waves.max(axis=0), 1.0)) @ away.T)
    matrix = -np.einsum("ijcab,wc->wiajb", pulls, turns, optimize=True)
    n = len(thick)
    matrix[:, range(n), :, range(n), :] += pulls.sum(axis=(1, 2))[:, None]
    return float(np.linalg.eigvalsh(matrix.reshape(len(waves), 3 * n, 3 * n)).max())


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
