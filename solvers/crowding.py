"""What moves particles apart that have come together, without a push: the shifting of Lind et al. (2012), by the
tensile control of Monaghan (2000) alone. Of SPH and MPM.

    crowd_i = sum_j V_j grad W (W^4 / W(r0)^4 - 1)   over partners nearer than r0  [1/m]
    shift_i = -(strain x constant) h^2 crowd_i                                             [m]

Partners push each other alike where both shear alike; a lattice and its free surface feel nothing; what rests, flies or
turns does not shear. Where there is no such surface the gradient of the concentration, sum_j V_j grad W, may be added,
which evens out what lies unevenly.
"""

import numpy as np
import warp as wp

from .bind import warp_func
from .smoothing import wendland, wendland_slope

wp.set_module_options({"enable_backward": False, "fast_math": True})

kernel = warp_func(wendland)


def nearest(r0: float, h: float) -> float:
    """W(r0) [1/m^3] of particles that are moved apart below r0 [m], with smoothing length h [m]."""
    return wendland(r0 / h, h)


def crowding(r: float, d: float, r0: float, h: float) -> float:
    """How much one partner at a distance r [m] crowds a particle [1/m], where they are d [m] apart at rest."""
    return d**3 * -wendland_slope(r / h, h) * r * ((wendland(r / h, h) / nearest(r0, h)) ** 4 - 1.0)


def farthest(d: float, r0: float, h: float) -> float:
    """Of h^2 crowd [-], at a time: beyond it a pair would change places. Each of both is pushed away by what falls with
    their distance by S at most, so that 1 / 2 S parts them without: with r0 = 0.9 d 0.20 at h = 1.5 d, 0.67 at 1.8 d,
    with r0 = d 0.12 at 1.5 d."""
    r = np.linspace(0.0, r0, 1001)
    push = [h * h * crowding(x, d, r0, h) for x in r]
    return float(0.5 / np.max(-np.gradient(push, r)))


@wp.func
def excess(r: float, h: float, near: float):
    """W^4 / W(r0)^4 - 1 of a partner at a distance r [m], 0 beyond r0; `near` is W(r0)."""
    ratio = kernel(r / h, h) / near
    ratio *= ratio
    return wp.max(ratio * ratio - 1.0, 0.0)


@wp.func
def out_of_crowd(crowd: wp.vec3, h: float, strain: float, farthest: float):
    """How far a particle is shifted [m] while matter shears by `strain` times the constant: -strain h^2 crowd."""
    return -(wp.min(strain, farthest) * h * h) * crowd
