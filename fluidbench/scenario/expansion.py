"""How a material expands: a volume ratio over age, by continuous growth or by spawning children."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Positive

USERS = {
    "time": ("growth",),
    "split": ("growth",),
    "passes": ("spawn",),
    "interval": ("spawn",),
    "radius": ("spawn",),
    "impulse": ("spawn",),
    "noise": ("spawn",),
    "margin": ("spawn",),
}
"""Keys that only one kind uses."""
LARGEST = 1.5  # volume of a particle, over spacing^3, beyond which growth splits it in two


class Expansion(Model):
    """Mass stays, rest volume grows `ratio`-fold.

    growth: R(t) = 1 + (ratio - 1)(1 - exp(-t / time)) from the age `delay`; fresh foam pushes its neighbours, and a
    particle that has become too large for the discretisation splits in two.
    spawn: at the age `delay` a particle becomes ratio^(1 / passes) children, the fraction by chance, in a ball around
    it, and again for every further pass.
    """

    kind: Literal["growth", "spawn"] = Field(
        default="growth", description="continuous growth, or parents that become children"
    )
    ratio: float = Field(description="final volume over fresh volume [-]")
    delay: NonNegative = Field(default=0.0, description="age at which it begins, counted from the nozzle [s]")
    jitter: NonNegative = Field(default=0.0, description="each particle begins up to this much earlier or later [s]")
    time: Positive = Field(default=1.0, description="growth: time constant of the approach to the ratio [s]")
    split: bool = Field(True, description="growth: split particles that have outgrown the spacing")
    passes: Annotated[int, Field(ge=1, le=16)] = Field(default=1, description="spawn: number of passes")
    interval: Positive = Field(default=0.1, description="spawn: time between passes [s]")
    radius: Positive = Field(
        default=1.0, description="spawn: radius of the ball over the edge of the expanded volume [-]"
    )
    impulse: NonNegative = Field(
        default=0.0, description="spawn: outward speed of a child at the rim of the ball [m/s]"
    )
    noise: NonNegative = Field(default=0.0, description="spawn: random speed added to each child [m/s]")
    margin: NonNegative = Field(
        default=0.5, description="spawn: least height of a child above the floor, in spacings [-]"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "Expansion":
        self.refuse_idle(self.kind, USERS)
        if self.ratio < 1.0:
            raise ValueError(f"ratio = {self.ratio} would shrink it; the ratio is final over fresh volume, at least 1")
        if self.jitter > self.delay:
            raise ValueError(
                f"jitter = {self.jitter} exceeds delay = {self.delay}: some would expand before they exist"
            )
        return self

    @property
    def last_event(self) -> float:
        """Age by which growth has begun everywhere, or the last children are there [s]."""
        passes = self.passes - 1 if self.kind == "spawn" else 0
        return self.delay + self.jitter + passes * self.interval

    @property
    def per_pass(self) -> float:
        """Volume ratio of one pass of spawning."""
        return self.ratio ** (1.0 / self.passes)

    def volume_ratio(self, age: float) -> float:
        """R [-] at an age [s], without jitter."""
        t = age - self.delay
        if t < 0:
            return 1.0
        if self.kind == "growth":
            return 1.0 - (self.ratio - 1.0) * math.expm1(-t / self.time)
        return self.per_pass ** min(1 + math.floor(t / self.interval + 1e-9), self.passes)

    def speed(self, size: float) -> float:
        """The fastest that matter of this fresh half width [m] is pushed outwards [m/s]: R' / (3 R) R^(1/3) size; for
        spawning, what makes room for the last pass within one interval."""
        if self.kind == "spawn":
            last = self.ratio ** (1.0 / 3.0) * (1.0 - self.per_pass ** (-1.0 / 3.0))
            return self.impulse + self.noise + size * last / self.interval
        left = np.linspace(1.0, 0.0, 201)  # exp(-t / time)
        grown = 1.0 + (self.ratio - 1.0) * (1.0 - left)
        return float((size * (self.ratio - 1.0) / self.time * left / 3.0 * grown ** (-2.0 / 3.0)).max())

    @property
    def least_volume(self) -> float:
        """Of a particle at rest, over spacing^3: that of a half just born."""
        return 0.5 * LARGEST if self.kind == "growth" and self.split else 1.0

    def generations(self, fill: float) -> int:
        """growth: how often a particle of `fill` times spacing^3 will have split in the end."""
        return max(0, math.ceil(math.log2(self.ratio * fill / LARGEST) - 1e-9)) if self.split else 0
