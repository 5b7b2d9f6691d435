"""The orifice that extrudes: an opening in the air, or a body with a bore and a face that presses."""

import math
from functools import cached_property
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, Positive
from .outline import Outline

USERS = ("outer_diameter", "bore", "walls")  # keys that only a tip uses
COLUMN = 4  # discs held above where matter is let go: more than any method's support radius
TALL = 4.0  # diameters by which a tip goes on above what is seen of its bore


class Nozzle(Model):
    """A circular orifice that extrudes downwards; give `exit_speed` or `flow_rate`."""

    diameter: Positive = Field(description="inner diameter D [m]")
    exit_speed: Positive | None = Field(None, description="mean exit speed U [m/s]")
    flow_rate: Positive | None = Field(None, description="volume flow rate Q = pi D^2 U / 4 [m^3/s]")
    standoff: Positive = Field(description="gap between the exit and the surface printed on [m]")
    tip: Literal["none", "flat"] = Field("none", description="flat: a body with a bore and a flat face, which presses")
    outer_diameter: Positive | None = Field(None, description="of the tip's face; default 2 D [m]")
    bore: Positive | None = Field(None, description="length of the bore in which matter flows freely; default D [m]")
    profile: Literal["plug", "developed"] | None = Field(
        None, description="of speeds at which matter is fed; default developed in a tip whose walls it sticks to"
    )
    walls: Literal["stick", "slip"] = Field("stick", description="what matter does at the tip's surfaces")

    @model_validator(mode="after")
    def _one_rate(self) -> "Nozzle":
        if (self.exit_speed is None) == (self.flow_rate is None):
            raise ValueError("give exactly one of exit_speed and flow_rate")
        return self

    @model_validator(mode="after")
    def _body(self) -> "Nozzle":
        for key in USERS:
            if self.tip == "none" and getattr(self, key) != type(self).model_fields[key].default:
                raise ValueError(f'{key} has no effect without a tip; set tip = "flat"')
        if self.outer_diameter is not None and self.outer_diameter <= self.diameter:
            raise ValueError(f"outer_diameter must exceed diameter = {self.diameter} (got {self.outer_diameter})")
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

    @property
    def develops(self) -> bool:
        """Whether matter is fed as it flows in a long bore, not as a plug."""
        if self.profile is None:
            return self.tip != "none" and self.walls == "stick"
        return self.profile == "developed"

    @property
    def rise(self) -> float:
        """Height above the exit at which matter is let go [m]: the bore's length, 0 without a body."""
        return 0.0 if self.tip == "none" else self.bore or self.diameter

    @property
    def face(self) -> float:
        """Outer radius of the tip's face [m]; of an opening, its own."""
        if self.tip == "none":
            return self.diameter / 2.0
        return (self.outer_diameter or 2.0 * self.diameter) / 2.0

    @property
    def resistance(self) -> float:
        """Pressure that feeds a viscous liquid, over eta U / D [-]: 1 for an opening. Of a body that of its bore,
        32 L / D (Hagen and Poiseuille), and of the gap g under its face, 6 eta Q ln(Ro / R) / (pi g^3); a body that
        matter slips along has a quarter of the latter alone."""
        if self.tip == "none":
            return 1.0
        gap = 1.5 * (self.diameter / self.standoff) ** 3 * math.log(2.0 * self.face / self.diameter)
        return max(gap / 4.0, 1.0) if self.walls == "slip" else 32.0 * self.rise / self.diameter + gap

    @cached_property
    def outline(self) -> Outline | None:
        """The body's section, seen from where matter is let go; None without one."""
        if self.tip == "none":
            return None
        r, top = self.diameter / 2.0, TALL * self.diameter
        corners = [[r, -self.rise], [r, top], [self.face, top], [self.face, -self.rise]]
        return Outline(np.array(corners), slips=self.walls == "slip")
