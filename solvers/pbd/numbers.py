"""What the passes of position-based fluids share, in both languages."""

from collections.abc import Callable

import numpy as np
import warp as wp

from fluidbench.scenario.material import Material

from ..lattice import lattice, opposed
from ..smoothing import cusp, cusp_slope, drag_weight, poly6, spiky, spiky_slope
from .config import ConfigPBD


@wp.struct
class Numbers:
    """Numbers of the discretisation."""

    support: float  # kernel radius H [m]
    spacing: float  # [m]
    weight: float  # makes the density sum exactly 1 on a lattice at rest [-]
    flat_weight: float  # the same of the kernel with a flat top [-]
    slope_weight: float  # the same of the kernel whose slope particles are moved along [-]
    response: float  # of the density to a move along that slope, over that of its own kernel's [-]
    slack: float  # density over that at rest that is left alone [-]
    relaxation: float  # constraint force mixing epsilon [-]
    over_relaxation: float  # share of the Jacobi correction that is applied [-]
    face: float  # density at the face of a lattice, over that at rest [-]
    face_moment: float  # least eigenvalue there of the spiky kernel's second moment, as bounded [-]
    halfway: float  # between that and what it is within [-]
    uneven: float  # 27 det / trace^3 of the moment up to which a particle lies at a surface [-]
    even: float  # and from which within [-]
    iterations: float  # of the density constraints in a substep
    hourglass: float  # zeta l^2 of the hourglass control [m^2]
    evened: float  # 1 where pushes go along the inverse of the fabric [-]
    lattice: float  # makes the second moment of the spiky kernel's slope 1 on a lattice [-]


# Floats in the rows that neighbours are asked for. Of density: position, volume. Of its constraints: the same | motion
# since the substep began, heft | multiplier; where matter is drawn together (DRAWING) that times the inverse of the
# fabric (6), lack of density, how far it is enclosed. Of velocities: position, volume | velocity, what the density is
# over-read by. Of stress: position, volume | stress (9), the traction that pulls back (3).
PLACE, PUSH, DRAWING, MOVING, PULLING = 4, 12, 16, 8, 16

SLACK = 2.0e-3  # lattices of round bodies are off by it
SETTLED = 0.95  # of it where matter settles: float32 makes noise of a hundredth of it, which would push

# Of paste that was laid and rests: 0.98 +- 0.01 within, 0.90 +- 0.04 from half a spacing to one below the surface.
EVENNESS, ANY = (0.95, 0.98), (-1.0, 0.0)


def push_row(drawn: bool) -> int:
    """Floats in a particle's row of the constraints, where matter is drawn together or is not."""
    return DRAWING if drawn else PUSH


def numbers_of(config: ConfigPBD, spacing: float, material: Material) -> Numbers:
    """At a spacing [m]. In what expands the fabric is left out: pushes are shared out by mass to partners of other
    densities, and along its inverse that has a torque; and births leave no fabric that lasts, nor one that is even
    within."""
    num, ratio = Numbers(), config.support_ratio
    num.support, num.spacing = ratio * spacing, spacing
    num.weight = 1.0 / lattice_sum(cusp, ratio)
    num.flat_weight = 1.0 / lattice_sum(poly6, ratio)
    num.slope_weight = 1.0 / lattice_sum(spiky, ratio)
    num.response = response(ratio)
    num.slack = SLACK
    num.relaxation, num.over_relaxation = config.relaxation, config.over_relaxation
    num.face, (num.face_moment, within) = face_level(ratio), moments(ratio)
    num.halfway = 0.5 * (num.face_moment + within)
    num.iterations = float(config.iterations)
    num.hourglass = config.zeta(material) * (stiffest(ratio) * spacing) ** 2
    num.evened = float(material.expansion is None)
    num.uneven, num.even = EVENNESS if material.expansion is None else ANY
    num.lattice = 1.0 / second_moment(ratio)
    return num


def distances(support_ratio: float) -> np.ndarray:
    """From a point of a cubic lattice of unit spacing to all that may be within its support, itself included."""
    return np.linalg.norm(lattice(support_ratio), axis=1)


def lattice_sum(kernel: Callable[[float, float], float], support_ratio: float) -> float:
    """Kernel sum of unit volumes on a cubic lattice of unit spacing."""
    return float(sum(kernel(float(r), support_ratio) for r in distances(support_ratio)))


def response(support_ratio: float) -> float:
    """sum w'.s' / sum s'.s' on a lattice, for density by w (`cusp`) and moves along the slope of s (`spiky`), both
    normalised there: Newton's method divides by the first."""
    r = [float(r) for r in distances(support_ratio) if 0.0 < r < support_ratio]
    moved = np.array([spiky_slope(r, support_ratio) for r in r]) / lattice_sum(spiky, support_ratio)
    felt = np.array([cusp_slope(r, support_ratio) for r in r]) / lattice_sum(cusp, support_ratio)
    return float(felt @ moved / (moved @ moved))


def second_moment(support_ratio: float) -> float:
    """-sum r w' / 3 of the spiky kernel on a lattice of unit spacing, 1 in the continuum."""
    return -sum(float(r) * spiky_slope(float(r), support_ratio) for r in distances(support_ratio)) / 3.0


def stiffest(support_ratio: float) -> float:
    """l over the spacing, which makes the shortest wave as stiff as stress between neighbours: ../hourglass.py. Pairs
    weigh as in implicit viscosity, which holds what is explicit in it up to twice its own stiffness (elastic_warp.py):
    control at zeta = 1 and stress are together 1.01 times as stiff at most at H = 2.4, 1.8 at 3.5 and 1.4 at 2."""
    weights = [drag_weight(float(r) / support_ratio, support_ratio) for r in distances(support_ratio)]
    return 1.0 / opposed(lattice(support_ratio), np.array(weights))


def face_level(support_ratio: float) -> float:
    """Density summed at the face of a cubic half lattice, over that within it."""
    half = distances(support_ratio)[lattice(support_ratio)[:, 2] <= 0]
    return sum(cusp(float(r), support_ratio) for r in half) / lattice_sum(cusp, support_ratio)


def moments(support_ratio: float) -> tuple[float, float]:
    """Least eigenvalue of the second moment -sum w' r r^T / |r| of the spiky kernel, as `least_eigenvalue` bounds it
    (../corrected.py), at the face of a cubic half lattice of unit spacing and within it."""
    places, r = lattice(support_ratio), distances(support_ratio)
    weights = np.array([-spiky_slope(float(s), support_ratio) / s if s > 0.0 else 0.0 for s in r])

    def bound(chosen: np.ndarray) -> float:
        moment = (weights[chosen, None] * places[chosen]).T @ places[chosen]
        return 4.0 * float(np.linalg.det(moment)) / float(np.trace(moment)) ** 2

    return bound(places[:, 2] <= 0), bound(r >= 0.0)
