"""The bounds on a step of PBD: what it moves in one, and what constraints can push; stability itself sets none. And how
often constraints are gone through in one."""

import math

from fluidbench.method.timestep import Bound
from fluidbench.scenario import Scenario

from ..viscosity import accuracy
from .config import ConfigPBD

# What constraints push in a substep goes as rho (d / dt)^2 an iteration, and must match what stress and viscosity pull:
PRESSED = 20.0  # viscous stress over that: what held at 8 was jammed at 83
SHAKEN = 0.02  # yield stress over that: what held there gained energy at 0.12
FEWEST, MOST = 2, 5  # iterations in a substep
# How much stiffer than matter constraints should be, as K = 3 E is with a Poisson's ratio of 4/9. (`bingham_channel` in
# disorder is 0.075, 0.050, 0.047, 0.043, 0.033 off at 1.3, 2, 2.7, 3.3, 6.7: means of four seeds.)
STIFFER = 3.0
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
    m, n = scenario.material, min(config.iterations or MOST, MOST)  # what more of them would allow was not measured
    if m.viscosity > 0:
        limits.append(accuracy(scenario))
        if (drag := m.viscosity * scenario.reference_speed / (FEATURE * d)) > 0:
            dt = d * math.sqrt(n * PRESSED * m.density / drag)
            formula = f"d sqrt({n * PRESSED:g} rho {FEATURE:g} d / (mu U))"
            limits.append(Bound("viscous push", dt, formula, "measured"))
    if m.is_solid:
        dt = WAVE * scenario.narrowest / scenario.wave_speed
        limits.append(Bound("elastic accuracy", dt, f"{WAVE:g} L / c", "backward Euler damps waves"))
    elif m.youngs_modulus is not None and m.relaxation_time is None and m.strength > 0:
        dt = d * math.sqrt(n * SHAKEN * m.density / m.strength)
        limits.append(Bound("yield push", dt, f"d sqrt({n * SHAKEN:g} rho / tau_y)", "measured"))
    return limits


def iterations_of(scenario: Scenario, config: ConfigPBD) -> int:
    """n density iterations convey a stiffness of about n rho (d / dt)^2 (references.md, I), which should be thrice that
    of matter over a substep, E + mu / dt, at whatever age of it: then it keeps its volume rather than its shape."""
    ratio = 0.0
    for m in scenario.aged[1]:
        made = scenario.made_of(m)
        dt = min(scenario.schedule[0], *(bound.dt for bound in bounds_of(made, config, made.reference_speed)))
        stiffness = (m.youngs_modulus or 0.0) + m.viscosity / dt
        ratio = max(ratio, stiffness * dt * dt / (m.density * scenario.spacing**2))
    return int(min(max(math.ceil(STIFFER * ratio), FEWEST), MOST))
