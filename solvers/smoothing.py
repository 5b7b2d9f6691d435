"""Interpolation kernels and splines, as plain laws of floats (see bind.py)."""

from math import pi, sqrt


def wendland(q: float, h: float):
    """Wendland C2 kernel W(r) [1/m^3] in three dimensions at q = r / h, support 2 h. Wendland 1995."""
    t = max(1.0 - 0.5 * q, 0.0)
    return 21.0 / (16.0 * pi * h * h * h) * t * t * t * t * (1.0 + 2.0 * q)


def wendland_slope(q: float, h: float):
    """(dW/dr) / r of the Wendland C2 kernel [1/m^5]: grad W = slope * (x_i - x_j), finite at r = 0."""
    t = max(1.0 - 0.5 * q, 0.0)
    return -105.0 / (16.0 * pi * h * h * h * h * h) * t * t * t


def drag_tail(q: float, support: float):
    """drag_weight over q^2 [1/m^5]."""
    t = max(1.0 - q, 0.0)
    s = support * support * support * support * support
    return 339.204 / s * t * t * t * sqrt(t)


def drag_weight(q: float, support: float):
    """Weight w(r) [1/m^5] of viscous drag between two at r = q support: sum_j V_j w r_a r_b r_c r_d / r^2 is that of an
    isotropic tensor, 1/5 for xxzz, in the continuum and to 3.2 % in a cubic lattice, whatever the support from 2.4 to
    3.6 spacings. (A kernel's own -W' / r weighs the nearest too much: 17 % too little in shear along the axes at 2.4
    spacings, 22 % too much across.) q^2 (1 - q)^(7/2) comes nearest to it of all q^m (1 - q)^n with half-integer
    exponents; its factor is 3 / (4 pi B(7, 9/2)), with Euler's beta function.
    """
    return drag_tail(q, support) * q * q  # in this order 0 for what lies ever so far


def shared_viscosity(one: float, other: float):
    """Of two that differ: the harmonic mean [Pa s]."""
    return 2.0 * one * other / max(one + other, 1.0e-30)


def pair_drag(viscosity: float, r2: float, support: float, volume: float):
    """What a particle of `volume` [m^3] within matter drags one by, 5 mu V w(r) / r^2 [Pa s/m^4], at a distance whose
    square is r2 [m^2]: see viscosity.py."""
    near = volume * drag_tail(sqrt(r2) / support, support)  # first: without V thick matter in small is no float32
    return 5.0 * viscosity / (support * support) * near


def cusp(r: float, support: float):
    """Quadratic kernel [1/m^3], support H: a peak that keeps particles from clumping, as a density's weight. Clavet et
    al. 2005."""
    t = max(1.0 - r / support, 0.0)
    return 15.0 / (2.0 * pi * support * support * support) * t * t


def cusp_slope(r: float, support: float):
    """(dW/dr) [1/m^4] of the quadratic kernel, support H."""
    t = max(1.0 - r / support, 0.0)
    return -15.0 / (pi * support * support * support * support) * t


def poly6(r: float, support: float):
    """Kernel with a flat top [1/m^3], support H: what two are apart when they are near does not show. Mueller et al.
    2003."""
    q = r / support
    t = max(1.0 - q * q, 0.0)
    return 315.0 / (64.0 * pi * support * support * support) * t * t * t


def spiky(r: float, support: float):
    """Spiky kernel [1/m^3], support H: its peak keeps particles from clumping. Desbrun & Gascuel 1996."""
    d = max(support - r, 0.0)
    h3 = support * support * support
    return 15.0 / (pi * h3 * h3) * d * d * d


def spiky_slope(r: float, support: float):
    """(dW/dr) [1/m^4] of the spiky kernel, support H. Mueller et al. 2003."""
    d = max(support - r, 0.0)
    h3 = support * support * support
    return -45.0 / (pi * h3 * h3) * d * d


def quadratic_spline(x: float):
    """Weights of the three nearest nodes for a point x in [0.5, 1.5] past the first of them. Steffen et al. 2008."""
    return 0.5 * (1.5 - x) * (1.5 - x), 0.75 - (x - 1.0) * (x - 1.0), 0.5 * (x - 0.5) * (x - 0.5)
