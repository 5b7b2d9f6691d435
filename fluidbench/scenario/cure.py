"""How a material cures: a degree of cure over age, and what the fully cured material is."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Positive

LEVELS = 100  # a continuous degree of cure moves in steps of one hundredth
USERS = {
    "time": ("stages", "linear"),
    "stages": ("stages",),
    "rate": ("first_order", "kamal_sourour", "avrami"),
    "rate_autocatalytic": ("kamal_sourour",),
    "exponent": ("avrami",),
}
"""Keys that only some laws use."""
TARGETS = ("youngs_modulus", "viscosity", "yield_stress", "saturated_yield_stress", "plastic_viscosity")
"""Parameters of the material that may change."""


class Cure(Model):
    """A schedule from the fresh to the cured material; what is not given stays as it is when fresh.

    Degree of cure alpha at time t after the onset (age `delay`, give or take `jitter`):
    jump: 1; stages: n equal steps in `time`; linear: t / time; first_order: 1 - exp(-k t);
    kamal_sourour (m = n = 1): d alpha/dt = (k + k2 alpha)(1 - alpha); avrami: 1 - exp(-(k t)^n).
    """

    kind: Literal["jump", "stages", "linear", "first_order", "kamal_sourour", "avrami"] = Field(
        "jump", description="law of the degree of cure"
    )
    delay: NonNegative = Field(default=0.0, description="age at which it begins, counted from the nozzle [s]")
    jitter: NonNegative = Field(default=0.0, description="each particle begins up to this much earlier or later [s]")
    time: Positive | None = Field(default=None, description="stages, linear: from the onset to the cured material [s]")
    stages: Annotated[int, Field(ge=2, le=100)] = Field(default=4, description="stages: number of equal steps")
    rate: Positive | None = Field(default=None, description="first_order, kamal_sourour, avrami: k [1/s]")
    rate_autocatalytic: NonNegative = Field(default=0.0, description="kamal_sourour: k2 [1/s]")
    exponent: Positive = Field(default=2.0, description="avrami: n [-]")
    interpolation: Literal["linear", "geometric"] = Field(default="linear", description="of the parameters over alpha")
    youngs_modulus: Positive | None = Field(default=None, description="Young's modulus when cured [Pa]")
    viscosity: NonNegative | None = Field(default=None, description="Newtonian viscosity when cured [Pa s]")
    yield_stress: NonNegative | None = Field(default=None, description="yield stress when cured [Pa]")
    saturated_yield_stress: Positive | None = Field(
        default=None, description="yield stress after much plastic strain when cured [Pa]"
    )
    plastic_viscosity: NonNegative | None = Field(
        default=None, description="Herschel-Bulkley consistency when cured [Pa s^n]"
    )

    @model_validator(mode="after")
    def _complete(self) -> "Cure":
        self.refuse_idle(self.kind, USERS)
        if self.kind in ("stages", "linear") and self.time is None:
            raise ValueError(f"{self.kind} needs time, from the onset to the cured material [s]")
        if self.kind in ("first_order", "kamal_sourour", "avrami") and self.rate is None:
            raise ValueError(f"{self.kind} needs rate [1/s]")
        if self.jitter > self.delay:
            raise ValueError(f"jitter = {self.jitter} exceeds delay = {self.delay}: some would cure before they exist")
        if not self.targets:
            raise ValueError(f"nothing to cure: give one of {', '.join(TARGETS)}")
        return self

    @property
    def targets(self) -> dict[str, float]:
        """Parameters of the fully cured material that differ from the fresh one's."""
        return {name: value for name in TARGETS if (value := getattr(self, name)) is not None}

    @property
    def levels(self) -> int:
        """Rows of the phase table beyond the fresh one."""
        return {"jump": 1, "stages": self.stages}.get(self.kind, LEVELS)

    def degree(self, age: float) -> float:
        """Degree of cure alpha [-] at an age [s], without jitter."""
        t = age - self.delay
        if t < 0:
            return 0.0
        if self.kind == "jump":
            return 1.0
        if self.kind in ("stages", "linear"):
            assert self.time is not None
            share = min(t / self.time, 1.0)
            return share if self.kind == "linear" else math.floor(self.stages * share + 1e-9) / self.stages
        assert self.rate is not None
        if self.kind == "first_order":
            return -math.expm1(-self.rate * t)
        if self.kind == "avrami":
            return -math.expm1(-((self.rate * t) ** self.exponent))
        fall = math.exp(-(self.rate + self.rate_autocatalytic) * t)  # closed form, divided by its growing exponential
        return (1.0 - fall) / (1.0 + self.rate_autocatalytic / self.rate * fall)

    def age_at(self, degree: float) -> float:
        """The age [s] at which a degree of cure is reached: the inverse of `degree`; infinite for 1 where it is a
        limit."""
        if degree <= 0.0:
            return 0.0
        if self.kind == "jump":
            return self.delay
        if self.kind in ("stages", "linear"):
            assert self.time is not None
            share = degree if self.kind == "linear" else math.ceil(degree * self.stages - 1e-9) / self.stages
            return self.delay + share * self.time
        assert self.rate is not None
        if degree >= 1.0:
            return math.inf
        if self.kind == "first_order":
            return self.delay - math.log1p(-degree) / self.rate
        if self.kind == "avrami":
            return self.delay + (-math.log1p(-degree)) ** (1.0 / self.exponent) / self.rate
        ratio = self.rate_autocatalytic / self.rate
        growth = (1.0 + degree * ratio) / (1.0 - degree)
        return self.delay + math.log(growth) / (self.rate + self.rate_autocatalytic)

    def level_ages(self) -> np.ndarray:
        """Age at which each level k / levels, k = 1 .., becomes the nearest one, shape (levels,) [s]."""
        nearest = 0.0 if self.kind in ("jump", "stages") else 0.5
        return np.array([self.age_at((k - nearest) / self.levels) for k in range(1, self.levels + 1)])

    def parameters(self, fresh: dict[str, float], degree: float) -> dict[str, float]:
        """The targets at a degree of cure, from their fresh values."""
        found = {}
        for name, cured in self.targets.items():
            start = fresh.get(name) or 0.0
            if self.interpolation == "geometric" and start > 0 and cured > 0:
                found[name] = start * (cured / start) ** degree
            else:
                found[name] = start + (cured - start) * degree
        return found
