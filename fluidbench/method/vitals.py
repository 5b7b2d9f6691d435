"""Is a run still sound? One set of rules for every method, judged from what was read of its particles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..scenario import Scenario
    from .frame import Frame

ENERGY_FACTOR = 2.0  # kinetic energy beyond this many times what was ever supplied comes from the method
SPEED_FACTOR = 3.0  # matter faster than this many times (wave speed + reference or falling speed) is no solution
PRESSED = 0.05  # energy of spawned children that lie over each other, over mass and wave speed squared


@dataclass(frozen=True)
class Vital:
    """One reading: largest speed [m/s], energies [J], what is wrong, what there was no room for, and what the method
    itself found broken, if anything; the time [s] that it is of, where that is not the present, and a native method's
    fault bits."""

    speed: float
    kinetic: float
    potential: float
    complaint: str | None
    shortage: str | None = None
    broken: str | None = None
    time: float | None = None
    bits: int = 0


def top_speed(scenario: Scenario, wave_speed: float) -> float:
    """Faster than this nothing moves that comes from the scenario [m/s]."""
    return SPEED_FACTOR * (wave_speed + max(scenario.reference_speed, scenario.falling_speed()))


def mass_energy(scenario: Scenario, wave_speed: float) -> float:
    """Most energy per unit mass that a scenario can turn into motion [J/kg]."""
    size = np.abs(np.asarray(scenario.domain.upper) - np.asarray(scenario.domain.lower))
    reach = size @ np.abs(scenario.acceleration) + size @ np.abs(scenario.gradient) @ size
    expansion = scenario.material.expansion
    pressed = PRESSED * wave_speed**2 if expansion is not None and expansion.kind == "spawn" else 0.0
    return 0.5 * scenario.reference_speed**2 + float(reach) + pressed


def complaint(bad: int, speed: float, limit: float, kinetic: float, supply: float, broken: str | None) -> str | None:
    """What is wrong with a state, if anything: particles that are no numbers, speed [m/s] beyond the limit, what the
    method itself found `broken`, or kinetic energy [J] that nothing supplied."""
    if bad:
        return f"{bad} particles have a non-finite position or velocity"
    if not math.isfinite(speed) or speed > limit:
        return f"a particle moves at {speed:.3g} m/s; more than {limit:.3g} m/s cannot come from the scenario"
    if broken:
        return broken
    if kinetic > ENERGY_FACTOR * supply:
        return f"kinetic energy of {kinetic:.3g} J exceeds what the scenario can supply ({supply:.3g} J)"
    return None


def vital_of(frame: Frame, scenario: Scenario) -> Vital:
    """The vital signs of a frame, for engines whose particles are not on our pool. What left the domain by more than
    its size is astray."""
    x, v = (np.asarray(frame[name], float) for name in ("position", "velocity"))
    sound = np.isfinite(x).all(axis=1) & np.isfinite(v).all(axis=1)
    mass = np.asarray(frame["mass"], float)[sound]
    speeds = np.linalg.norm(v[sound], axis=1)
    speed, kinetic = float(speeds.max(initial=0.0)), 0.5 * float(mass @ speeds**2)
    potential = -float(mass @ scenario.potential_at(x[sound]))
    low, high = np.asarray(scenario.domain.lower), np.asarray(scenario.domain.upper)
    lost = int(((x[sound] < 2 * low - high) | (x[sound] > 2 * high - low)).any(axis=1).sum())
    broken = f"{lost} particles left the domain by more than its size" if lost else None
    wave = scenario.top_wave_speed
    supply = 2.0 * float(mass.sum()) * mass_energy(scenario, wave)
    found = complaint(int((~sound).sum()), speed, top_speed(scenario, wave), kinetic, supply, broken)
    return Vital(speed, kinetic, potential, found, broken=broken)
