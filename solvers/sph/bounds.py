"""The bounds on a step of SPH."""

import math

import numpy as np

from fluidbench.method.timestep import Bound
from fluidbench.scenario import Scenario

from ..lattice import hourglass_limit, stiffest_drag
from ..viscosity import accuracy
from .config import ConfigSPH
from .particle import THINNEST

HOURGLASS_SAFETY = 0.8  # for the stress and the pressure act on the same waves
SHOCK_RATE = 18.0  # rate at which artificial viscosity, by Monaghan & Gingold's operator, damps a wave [nu / h^2]


def damping(scenario: Scenario, ratio: float) -> float:
    """The fastest rate [nu / h^2] at which explicit viscosity damps, where matter is thinnest. What grows and does not
    split lies ever further apart within the same kernel."""
    growth = scenario.material.expansion
    most = growth.ratio if growth is not None and growth.kind == "growth" and not growth.split else 1.0
    apart = [float(volume) ** (1 / 3) for volume in np.geomspace(1.0, most, 9 if most > 1.0 else 1)]
    return ratio * ratio * max(stiffest_drag(2.0 * ratio / d, THINNEST) / (d * d) for d in apart)


def bounds_of(scenario: Scenario, config: ConfigSPH, speed: float) -> list[Bound]:
    """Each [s], for matter that moves at `speed` [m/s] at most."""
    c, m = scenario.wave_speed, scenario.material
    ratio = config.smoothing(m)
    h = ratio * scenario.spacing
    # Monaghan's artificial viscosity acts as nu = alpha h c / (2 (d + 2)) (Monaghan 2005, section 7.1). That of the
    # material counts by how much faster it may damp.
    explicit = 0.0 if config.viscosity == "implicit" else m.viscosity
    stiffer = damping(scenario, ratio) / SHOCK_RATE if explicit > 0.0 else 0.0
    nu = stiffer * explicit / m.density + config.alpha(m) * h * c / 10.0
    g = scenario.peak_acceleration
    a = config
    shear_speed = math.sqrt(m.shear_modulus / m.density)
    hourglass = hourglass_limit(ratio, a.hourglass, shear_speed, a.alpha(m) * c) if m.elastic else math.inf
    return [
        Bound("acoustic", a.cfl * h / (c + speed), f"{a.cfl:g} h / (c + v)", "Monaghan 2005; references.md, H: < 1.73"),
        Bound(
            "viscous",
            a.viscous_number * h * h / nu if nu > 0 else math.inf,
            f"{a.viscous_number:g} h^2 / nu, artificial viscosity and the stiffness of thin matter included",
            "references.md, H: 0.111 h^2 / nu for the Monaghan-Gingold operator; eigenvalues of thin lattices",
        ),
        Bound(
            "hourglass",
            HOURGLASS_SAFETY * scenario.spacing * hourglass,
            f"{HOURGLASS_SAFETY:g} of the limit of waves that no gradient shows, zeta = {a.hourglass:g}",
            "symplectic Euler on the shortest waves of a lattice",
        ),
        Bound(
            "force",
            a.force_number * math.sqrt(h / g) if g > 0 else math.inf,
            f"{a.force_number:g} sqrt(h / g)",
            "Monaghan 1992",
        ),
        *([accuracy(scenario)] if m.viscosity > explicit else []),
    ]
