"""A rigid body that is carried along the toolpath, such as the drone that holds the nozzle."""

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Positive, Vector

USERS = {"size": ("box",), "radius": ("sphere",)}
"""Keys that only some primitives use."""


class Part(Model):
    """A primitive, placed relative to the nozzle's exit."""

    kind: Literal["box", "sphere"]
    center: Vector = Field(description="centre relative to the nozzle exit, before the clearance [m]")
    size: Vector | None = Field(default=None, description="box: edge lengths [m]")
    radius: Positive | None = Field(default=None, description="sphere: radius [m]")

    @model_validator(mode="after")
    def _complete(self) -> "Part":
        if self.kind == "box" and (self.size is None or min(self.size) <= 0):
            raise ValueError("a box needs size, three positive edge lengths [m]")
        if self.kind == "sphere" and self.radius is None:
            raise ValueError("a sphere needs radius [m]")
        self.refuse_idle(self.kind, USERS)
        return self

    @property
    def half(self) -> np.ndarray:
        """Half edge lengths, shape (3,) [m]; of a sphere, its radius three times."""
        return np.full(3, self.radius) if self.size is None else 0.5 * np.asarray(self.size)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance of points (n, 3) relative to the exit [m], negative inside."""
        arm = points - np.asarray(self.center)
        if self.kind == "sphere":
            return np.linalg.norm(arm, axis=1) - self.half[0]
        gap = np.abs(arm) - self.half
        return np.linalg.norm(np.maximum(gap, 0.0), axis=1) + np.minimum(gap.max(axis=1), 0.0)


class Collider(Model):
    """Parts that move with the nozzle, whatever they touch; material slides along them with Coulomb friction."""

    parts: tuple[Part, ...] = Field(min_length=1, description="its primitives")
    clearance: NonNegative = Field(default=0.0, description="how far all parts are raised above the nozzle exit [m]")
    friction: NonNegative = Field(default=0.3, description="Coulomb friction coefficient [-]")

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance of points (n, 3), relative to the exit, from the nearest part [m]."""
        lowered = points - [0.0, 0.0, self.clearance]
        return np.min([part.distance(lowered) for part in self.parts], axis=0)
