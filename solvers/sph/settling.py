"""What SPH's particles integrate settles towards the density that they have, which their neighbours tell.

Density comes of strain; when particles change places without any, it calls full what is porous, and porous what is
crowded. Every tick, where matter flows,

    rho += min(shifting |2 dev D| dt, 1) heard `drift` rho0

with the rate of shear of the tick's last substep (a liquid's no more than nu / h^2: see particle.py). What cavitates is
also shifted out of crowds then, by how it shears at that moment: a substep needs to know neither. A sum over V0 that
is exact in a lattice, lattice / 3 sum_j V0_j r.grad W, tells by what share phi each place is filled, and h sum_j V0_j
grad W how far it leans, l: to a free surface. Both are averaged over neighbours, by V0 W: a place alone is off by 2 or
3 % in disorder. Averaged so, a surface lacks `SURFACE` to `MOST` times the mean of |l|, at any depth.

Tried: a place's own phi and l. Noise in |l| was rectified: matter swelled by 3 to 10 % where a gap within the tolerance
of either sign was taken off, and skins were drawn together by 2 to 5 % where only what leans little was heard. The mean
of phi - rho / rho0: what flows among what does not made up for its neighbours' gaps, down to 0.63 rho0.
"""

from math import sqrt

DISORDERED = 0.083  # h = 1.8 d; 0.128 at 1.5, 0.174 at 1.3
SURFACE = 0.56  # flat surfaces 0.53 to 0.565 at any depth, sheets of 3 h and more the same
MOST = 0.62  # sheets of 2 h 0.60 to 0.64, cylinders of 3.3 and 2.2 h 0.56 to 0.63
LENGTHENED = 0.31  # mean of sqrt(max(r^2 - 1, 0)), r a length with Maxwell's distribution and a mean square of 1
AVERAGED = 0.37  # of what disorder makes places lean by, what is left in the mean over neighbours


def disorder(ratio: float) -> float:
    """|l| of particles in no order, inside [-], `ratio` being h over spacing: root mean square in lattices whose places
    were moved by 0.2 d, at random, and then apart to 0.9 d."""
    return DISORDERED * (1.8 / ratio) ** 2.3


def leaning(square: float, noise: float):
    """|l| from its square, without what noise of that root mean square adds: of noise alone nothing, on average, and up
    to `LENGTHENED` times it less than nothing."""
    return sqrt(max(square - noise * noise, 0.0)) - LENGTHENED * noise


def drift(gap: float, lean: float, bent: float, tolerance: float):
    """By how much density is too low [rho0]; `gap` is the mean of phi, less rho / rho0, `lean` the length of the mean
    of l, `bent` the mean of its length: more than `lean` where surfaces bend or are on either side. Both without noise.

    Within the tolerance, and between what the least and the most of a surface would lack, nothing is known.
    """
    return max(gap + SURFACE * lean - tolerance, 0.0) + min(gap + MOST * max(lean, bent) + tolerance, 0.0)


def heard(filled: float):
    """How much of that counts, by the mean of phi, which is 0.7 on a flat surface: nothing below 0.6. Sheets thinner
    than 2 h and drops of a few particles lack more than they lean; drawn together, they would lose their volume."""
    return min(max(10.0 * filled - 6.0, 0.0), 1.0)
