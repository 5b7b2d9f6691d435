"""The orifice that extrudes."""

import math

from pydantic import Field, model_validator

from .model import Model, Positive


class Nozzle(Model):
    """A circular orifice that extrudes downwards; give `exit_speed` or `flow_rate`."""

    diameter: Positive = Field(description="inner diameter D [m]")
    exit_speed: Positive | None = Field(None, description="mean exit speed U [m/s]")
    flow_rate: Positive | None = Field(None, description="volume flow rate Q = pi D^2 U / 4 [m^3/s]")
    standoff: Positive = Field(description="gap between the exit and the surface printed on [m]")

    @model_validator(mode="after")
    def _one_rate(self) -> "Nozzle":
        if (self.exit_speed is None) == (self.flow_rate is None):
            raise ValueError("give exactly one of exit_speed and flow_rate")
        return self

    @property
    def area(self) -> float:
        return math.pi * self.diameter**2 / 4.0

    @property
    def speed(self) -> float:
        """Mean exit speed U [m/s]."""
        if self.exit_speed is not None:
            return self.exit_speed
        assert self.flow_rate is not None
        return self.flow_rate / self.area

    @property
    def rate(self) -> float:
        """Volume flow rate Q [m^3/s]."""
        return self.area * self.speed
