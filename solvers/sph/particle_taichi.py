"""What SPH's passes in Taichi share: particle.py, written anew."""

from ..aging import DISORDER
from ..smoothing import wendland_slope
from ..taichi_bridge import struct_of, taichi_func, ti
from .particle import WHOLE, Smoothing

slope = taichi_func(wendland_slope)
SmoothingT = struct_of(Smoothing)


@ti.func
def drifted(num, phase, rho, rest, grown, second, first_moment):
    """What is summed beyond what is integrated, where the neighbourhood is whole or too crowded: see particle.py."""
    drift = second * num.lattice / 3.0 - rho
    whole = 1.0
    if drift <= 0.0:
        whole = ti.max(1.0 - first_moment.norm() * num.h / (WHOLE * rho), 0.0)
    tolerance = num.density_tolerance
    if grown:
        tolerance = ti.max(tolerance, DISORDER)
    gap = ti.max(ti.abs(drift) - tolerance * rho, 0.0)
    drift = gap if drift > 0.0 else -gap
    if phase.relaxation_rate > 0.0 or grown:
        drift = ti.max(drift, ti.min(rest - rho, 0.0))
    return whole * drift
