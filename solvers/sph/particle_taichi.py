"""What SPH's passes in Taichi share: particle.py, written anew."""

from ..aging import DISORDER
from ..smoothing import wendland, wendland_slope
from ..taichi_bridge import struct_of, taichi_func, ti
from .particle import Smoothing

slope, kernel = taichi_func(wendland_slope), taichi_func(wendland)
SmoothingT = struct_of(Smoothing)


@ti.func
def excess(num, r):
    """By what a partner at r crowds: see ../crowding.py."""
    return ti.max((kernel(r.norm() / num.h, num.h) / num.near) ** 4 - 1.0, 0.0)


@ti.func
def crowded(num, rho, second):
    """What is summed beyond what is integrated and disorder may feign: see particle.py."""
    return ti.max(second * num.lattice / 3.0 - (1.0 + DISORDER) * rho, 0.0)


@ti.func
def damped(num, phase, rho, sheared):
    """The rate at which what is sheared so settles: see particle.py."""
    rate = sheared
    if phase.shear_modulus <= 0.0:
        rate = ti.min(sheared, phase.viscosity / (rho * num.h * num.h))
    return rate
