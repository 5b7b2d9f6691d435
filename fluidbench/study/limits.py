"""Largest stable time steps by bisection: blocks of material at rest, and a lump thrown at the floor.

The block follows references.md, H: at rest but for small random velocities, it is stable while its kinetic energy grows
less than a hundredfold in 500 steps. The lump meets free surfaces, contact and flow; it is stable while the health
check finds nothing wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import UserError
from ..method.contract import Method
from ..method.target import Target
from ..method.timestep import SPEED_MARGIN
from ..scenario import Scenario
from ..scenario.body import Body
from ..scenario.model import LARGEST

GROWTH, STEPS, LOOKS = (
    100.0,
    500,
    4,
)  # energy ratio; steps of a trial; steps between looks: what blows up must not escape
CELLS = 8  # particles along an edge of a block
LUMP = 6  # particles along an edge of a lump
LUMP_STEPS = 400  # default steps of a trial
AMPLITUDE = 1e-4  # random velocity over the wave speed


@dataclass(frozen=True)
class Limit:
    """The largest stable and the smallest unstable dt found [s]; `unstable` is infinite where none was reached."""

    stable: float
    unstable: float

    @property
    def dt(self) -> float:
        """Best estimate of the limit [s]."""
        return self.stable if math.isinf(self.unstable) else math.sqrt(self.stable * self.unstable)


def bisect(survives: Callable[[float], bool], guess: float, precision: float, reach: float) -> Limit:
    """Bracket the limit from `guess` by factors of 1.5, then bisect to a relative precision; look no further than
    `reach` times the guess up or down."""
    stable, unstable = 0.0, math.inf
    dt = guess
    while guess / reach <= dt <= guess * reach:
        if survives(dt):
            stable = dt
            if math.isfinite(unstable):
                break
            dt *= 1.5
        else:
            unstable = dt
            if stable > 0:
                break
            dt /= 1.5
    while stable > 0 and math.isfinite(unstable) and unstable / stable > 1.0 + precision:
        middle = math.sqrt(stable * unstable)
        if survives(middle):
            stable = middle
        else:
            unstable = middle
    return Limit(stable, unstable)


def block(material: dict[str, Any], spacing: float) -> Scenario:
    """A periodic block at rest without gravity, that does not cavitate, for theory does not."""
    edge = CELLS * spacing
    walls = {f"{axis}_{end}": "periodic" for axis in "xyz" for end in ("lower", "upper")}
    return Scenario.model_validate(
        {
            "name": "block",
            "domain": {"lower": (0, 0, 0), "upper": (edge,) * 3, "walls": walls},
            "material": {**material, "tension_limit": LARGEST},
            "gravity": (0, 0, 0),
            "bodies": [{"kind": "box", "center": (edge / 2,) * 3, "size": (edge,) * 3}],
            "duration": 1.0,
            "spacing": spacing,
        }
    )


def block_limit(
    scenario: Scenario, method: type[Method], config: Any, guess: float, precision: float, target: Target
) -> Limit:
    """The largest stable dt of a block."""

    def survives(dt: float) -> bool:
        sim = method.start(scenario, config, target)
        rng = np.random.default_rng(0)
        sim.kick(AMPLITUDE * scenario.wave_speed * rng.uniform(-1, 1, (sim.capacity, 3)))
        start = sim.look().kinetic
        for _ in range(STEPS // LOOKS):
            sim.march(dt, LOOKS)
            vital = sim.look()
            if vital.broken or not vital.kinetic < GROWTH * start:
                return False
        return True

    return bisect(survives, guess, precision, 32.0)


def lump(scenario: Scenario, dt: float) -> Scenario:
    """A cube of the scenario's material in its gravity, thrown at its floor with its speed, for some hundred steps."""
    d, floor = scenario.spacing, scenario.domain.lower[2]
    edge, room = LUMP * d, 3 * LUMP * d
    middle = (room / 2, room / 2, floor + edge / 2 + d / 4)
    return scenario.model_copy(
        update={
            "name": "lump",
            "nozzle": None,
            "toolpath": None,
            "reference": None,
            "output_interval": None,
            "domain": scenario.domain.model_copy(
                update={"lower": (0.0, 0.0, floor), "upper": (room, room, floor + room)}
            ),
            "material": scenario.material.model_copy(update=_as_fed(scenario)),
            "bodies": (_box(middle, edge, scenario.reference_speed),),
            "duration": LUMP_STEPS * dt,
            "tick": LOOKS * dt,
        }
    )


def _as_fed(scenario: Scenario) -> dict[str, Any]:
    """The lump must keep the scenario's sound speed and tension, not make its own without a nozzle."""
    m, kept = scenario.material, {}
    if m.youngs_modulus is None:
        kept["tension_limit"] = scenario.tension(m)
        if m.sound_speed is None and m.bulk_modulus is None:
            kept["sound_speed"] = scenario.liquid_sound_speed
    return kept


def _box(center: tuple[float, float, float], edge: float, speed: float) -> Body:
    return Body.model_validate(
        {"kind": "box", "center": center, "size": (edge, edge, edge), "velocity": (0.3 * speed, 0.0, -speed)}
    )


def lump_survives(scenario: Scenario, method: type[Method], config: Any, dt: float, target: Target) -> str | None:
    """None if the lump comes through at this dt [s], otherwise what went wrong."""
    thrown = Scenario.model_validate(lump(scenario, dt).model_dump())
    sim = method.start(thrown, config, target)
    for _ in range(LUMP_STEPS // LOOKS):
        sim.march(dt, LOOKS)
        vital = sim.look()
        if vital.complaint or vital.shortage:
            return vital.complaint or vital.shortage
    return None


def default_dt(scenario: Scenario, method: type[Method], config: Any) -> tuple[float, str]:
    """(dt [s], name of the bound) that the method would take for the lump."""
    bounds = method.bounds(scenario, config, SPEED_MARGIN * scenario.reference_speed)
    if not bounds:
        raise UserError(f"{method.name} picks its own step: it has no limit to look for")
    least = min(bounds, key=lambda b: b.dt)
    return least.dt, least.name
