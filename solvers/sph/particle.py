"""What keeps SPH's particles in order beside the common hourglass control (../hourglass.py) and shifting out of crowds
(../crowding.py): the damping of the one, who feels the other, and the customary artificial viscosity of stragglers.

SPH's weight of pairs is W'/r, and the traction g = l^2 (zeta G z + rho nu q) is damped, too.
"""

import warp as wp

from fluidbench.native.scene import Phase

from ..aging import DISORDER
from ..bind import warp_func
from ..corrected import EDGE, SOUND
from ..smoothing import wendland_slope

wp.set_module_options({"enable_backward": False, "fast_math": True})

# The rate at which the density of what carries tension levels, at most, over shear and growth. From 16 to 64 little
# changes; at 4 sections of strands were 2 % too large; without a limit pastes crept on for as long as anyone looked.
LEVELLED = wp.constant(32.0)
# By how much more what cavitates is shifted, which keeps of it what neighbours do not share. Pairs of a lattice that is
# pressed together come to 0.54 d by 4 times as much, to 0.66 by 8, to 0.72 by 12 and 0.73 by 16, in every substep; all
# else stays. Between ticks most of it is beyond what a pair can be moved by at once (`farthest`), and it is 0.62.
PARTED = wp.constant(12.0)
CLOSE = 0.9  # r0 of crowding.py: distance below which particles are moved apart, in spacings
# Of h^2 crowd, at a time, for what carries tension: `farthest` at h = 1.5 d; pastes' 1.3 d ask for 0.06 (not tried).
FARTHEST = wp.constant(0.2)
# An edge's fullness (viscosity.py): with less around them few pairs stand for much, and explicit steps, which hold for
# threads, would be 1.4 to 1.8 times shorter. Implicit ones take half of this.
THINNEST = wp.constant(0.25)

slope = warp_func(wendland_slope)


@wp.struct
class Smoothing:
    """Numbers of the discretisation."""

    h: float  # smoothing length [m]
    near: float  # kernel at the distance below which partners crowd each other [1/m^3]
    broken: float  # crowding by a single partner at which a lattice is broken [1/m]
    compact: float  # l^2: makes the shortest wave as stiff as between neighbours in a lattice [m^2]
    lattice: float  # makes the second moment of a lattice exactly its density [-]
    density_diffusion: float  # delta [-]
    artificial_viscosity: float  # alpha [-]
    hourglass: float  # zeta [-]
    shifting: float  # shift over strain and h^2 crowding [-]
    evened: float  # d^2 over what a lattice sums to of -V W'/r: makes means of sums of it [m^2]
    density_feedback: float  # rate at which integrated density follows a crowd's, in c / h [-]
    density_tolerance: float  # gap between the two that is left alone where they settle, over `disorder` [-]
    spacing: float  # [m]
    farthest: float  # of h^2 crowding that what cavitates is shifted by at a time [-]
    settling: float  # `shifting` times the time from tick to tick [s]
    disorder: float  # by how much particles in no order lean, see settling.py [-]


@wp.func
def pulled_back(phase: Phase, stiffness: float, damping: float, z: wp.vec3, q: wp.vec3):
    """g [Pa m]; `stiffness` is zeta l^2 [m^2], `damping` rho nu l^2 [Pa s m^2]."""
    return stiffness * phase.shear_modulus * z + damping * q


@wp.func
def straggling(least: float):
    """How much of the customary artificial viscosity a particle of what has strength needs [-], by the least
    eigenvalue of its moment: none within a lattice and on its edges.

    Few particles see little of each other's motion, so that no stress resists the rest of it, and the images in no-slip
    walls, which do not pull back by what they showed, feed it: where foam cured on a floor particles swung more and
    more, and were thrown off at 3 m/s. Along the line of centres this slows nothing that rests, flies or turns.
    """
    return wp.clamp((EDGE - least) / (EDGE - SOUND), 0.0, 1.0)


@wp.func
def broken(crowd: wp.vec3, limit: float):
    """What crowds a particle of matter that does not flow [1/m]: the excess over what one partner does at 0.6 d, nearer
    than any elastic strain brings them. A lattice that is pressed together keeps its order by itself."""
    return wp.max(1.0 - limit / wp.max(wp.length(crowd), 1.0e-12), 0.0) * crowd


@wp.func
def crowded(num: Smoothing, rho: float, second: float):
    """By how much the density that particles really have, by the second moment, exceeds the one that they integrate,
    rho [kg/m^3]; what disorder may feign is left alone. Lesser gaps are settled, see settling.py."""
    return wp.max(second * num.lattice / 3.0 - (1.0 + DISORDER) * rho, 0.0)


@wp.func
def damped(num: Smoothing, phase: Phase, rho: float, sheared: float):
    """The rate [1/s] at which what is sheared so settles: of a liquid at most nu / h^2. Where viscosity does not smooth
    flow over h sooner than it shears, what settles costs energy: of `elliptic_drop`'s 4 % instead of 3."""
    rate = sheared
    if phase.shear_modulus <= 0.0:
        rate = wp.min(sheared, phase.viscosity / (rho * num.h * num.h))
    return rate
