"""The bounds on a step of PBD: what it moves in one, and what constraints can push; stability itself sets none."""

import math

from fluidbench.method.timestep import Bound
from fluidbench.scenario import Scenario

from ..viscosity import accuracy
from .config import ConfigPBD

# What constraints push in a substep goes as rho (d / dt)^2, and must match what stress and viscosity pull:
PRESSED = 100.0  # viscous stress over that: what held at 42 was jammed at 416
SHAKEN = 0.1  # yield stress over that: what held there gained energy at 0.6
FEATURE = 8.0  # spacings across which matter shears
WAVE = 0.1  # of the time that a wave takes across the narrowest of a solid, that a step may take


def bounds_of(scenario: Scenario, config: ConfigPBD, speed: float) -> list[Bound]:
    """Each [s], for matter that moves at `speed` [m/s] at most."""
    d, g = scenario.spacing, scenario.peak_acceleration
    a = config.advance
    if scenario.material.expansion is not None:  # what grows moves at once, before anyone has seen it move
        speed = max(speed, scenario.reference_speed)
    limits = [Bound("accuracy", a * d / max(speed, 1e-12), f"{a:g} d / v", "references.md, H: no stability bound")]
    if g > 0:
        limits.append(Bound("free fall", (a * d / g) ** 0.5, f"sqrt({a:g} d / |g|)", "same, from rest"))
    m = scenario.material
    if m.viscosity > 0:
        limits.append(accuracy(scenario))
        if (drag := m.viscosity * scenario.reference_speed / (FEATURE * d)) > 0:
            dt = d * math.sqrt(PRESSED * m.density / drag)
            limits.append(Bound("viscous push", dt, f"d sqrt({PRESSED:g} rho {FEATURE:g} d / (mu U))", "measured"))
    if m.is_solid:
        dt = WAVE * scenario.narrowest / scenario.wave_speed
        limits.append(Bound("elastic accuracy", dt, f"{WAVE:g} L / c", "backward Euler damps waves"))
    elif m.youngs_modulus is not None and m.relaxation_time is None and m.strength > 0:
        dt = d * math.sqrt(SHAKEN * m.density / m.strength)
        limits.append(Bound("yield push", dt, f"d sqrt({SHAKEN:g} rho / tau_y)", "measured"))
    return limits
