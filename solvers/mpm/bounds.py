"""The bounds on a step of MPM."""

import math

from fluidbench.method.timestep import Bound, damped_limit
from fluidbench.scenario import Scenario

from ..viscosity import accuracy
from .config import ConfigMPM
from .grid import cells_of

ISOLATED_ACOUSTIC = 1.0 / math.sqrt(3.0)
ISOLATED_VISCOUS = 0.25


def kept(scenario: Scenario, config: ConfigMPM) -> int:
    """For how many substeps nodes keep their momenta (keeping.py): not where velocities of nodes are solved for, nor
    where a clamp or a rigid body has part in what nodes weigh, or a collider acts after every substep."""
    clamped = any(body.clamped for body in scenario.bodies)
    rigid = scenario.outline is not None or scenario.collider is not None
    keeps = scenario.emits and not (clamped or rigid or config.viscosity == "implicit")
    return config.kept if keeps else 1


def bounds_of(scenario: Scenario, config: ConfigMPM, speed: float) -> list[Bound]:
    """Each [s], for matter that moves at `speed` [m/s] at most."""
    dx = float(cells_of(scenario.domain, config.grid_ratio * scenario.spacing)[1].min())
    acoustic = ISOLATED_ACOUSTIC * dx / (scenario.wave_speed + speed)
    implicit = config.viscosity == "implicit"
    nu = 0.0 if implicit else scenario.material.viscosity / scenario.material.density
    viscous = ISOLATED_VISCOUS * dx * dx / nu if nu > 0 else math.inf
    a, together = config.safety, kept(scenario, config)
    moved = f"{config.advection:g}" if together == 1 else f"{config.advection:g} / {together}"
    limits = [
        Bound("acoustic", a * acoustic, f"{a:g} dx / (sqrt(3) (c + v))", "references.md, H: isolated particle, exact"),
        Bound("advective", config.advection * dx / (together * max(speed, 1e-12)), f"{moved} dx / v", "one cell"),
    ]
    if implicit and scenario.material.viscosity > 0:
        limits.append(accuracy(scenario))
    if nu > 0:
        limits += [
            Bound("viscous", a * viscous, f"{a:g} dx^2 / (4 nu)", "references.md, H: isolated particle, exact"),
            Bound(
                "acoustic-viscous",
                a * damped_limit(acoustic, viscous),
                "(dt/dt_acoustic)^2 + dt/dt_viscous < 1",
                "symplectic Euler of a damped oscillator",
            ),
        ]
    return limits
