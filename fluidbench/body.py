"""Material that does not come from a nozzle: shapes and initial velocities, validated, in SI units."""

import math
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Matrix, Model, NonNegative, Positive, Vector

USERS = {"size": ("box",), "radius": ("cylinder", "sphere"), "height": ("cylinder",)}
"""Keys that only some shapes use."""
CORNERS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])


class Wave(Model):
    """A velocity field amplitude sin(number . (x - center) + phase)."""

    amplitude: Vector = Field(description="amplitude [m/s]")
    number: Vector = Field(description="wave vector, 2 pi over the wave length [rad/m]")
    phase: float = Field(0.0, description="phase at the body's centre [rad]")

    def at(self, arm: np.ndarray) -> np.ndarray:
        return np.sin(arm @ np.asarray(self.number) + self.phase)[:, None] * np.asarray(self.amplitude)


class Body(Model):
    """Material that is there from `start` on. Its velocity is the sum of `velocity`, of the gradient and the rotation
    about the centre, and of `wave`.

    What lies outside the domain is cut off: a quarter of a cylinder stands at a corner of two slip walls.
    """

    kind: Literal["box", "cylinder", "sphere"]
    center: Vector = Field(description="centre of the body [m]")
    size: Vector | None = Field(None, description="box: edge lengths [m]")
    radius: Positive | None = Field(None, description="cylinder (axis z), sphere: radius [m]")
    height: Positive | None = Field(None, description="cylinder: height [m]")
    velocity: Vector = Field((0.0, 0.0, 0.0), description="velocity of the centre [m/s]")
    velocity_gradient: Matrix | None = Field(None, description="dv_i/dx_j about the centre [1/s]")
    angular_velocity: Vector = Field((0.0, 0.0, 0.0), description="rotation about the centre [rad/s]")
    wave: Wave | None = Field(None, description="a sine wave of velocity: amplitude, number, phase")
    start: NonNegative = Field(0.0, description="when it appears: later for a layer laid on what is there [s]")
    clamped: bool = Field(False, description="keeps its velocity whatever happens: a clamp or a moving grip")

    @model_validator(mode="after")
    def _complete(self) -> "Body":
        needs = {"box": ("size",), "cylinder": ("radius", "height"), "sphere": ("radius",)}[self.kind]
        missing = [key for key in needs if getattr(self, key) is None]
        if missing:
            raise ValueError(f"a {self.kind} needs {' and '.join(missing)}")
        self.refuse_idle(self.kind, USERS)
        if self.start > 0 and (self.velocity_gradient or self.wave or any(self.angular_velocity)):
            raise ValueError("a body that appears later moves as a whole: give it a velocity alone")
        if self.size is not None and min(self.size) <= 0:
            raise ValueError(f"size must be positive, got {self.size}")
        return self

    @property
    def extent(self) -> np.ndarray:
        """Half edge lengths of the bounding box, shape (3,) [m]."""
        if self.kind == "box":
            return np.asarray(self.size) / 2.0
        assert self.radius is not None
        return np.array([self.radius, self.radius, self.radius if self.kind == "sphere" else (self.height or 0) / 2.0])

    @property
    def volume(self) -> float:
        """Exact volume, before the domain cuts it [m^3]."""
        a, b, c = 2.0 * self.extent
        return {"box": a * b * c, "cylinder": math.pi / 4 * a * b * c, "sphere": math.pi / 6 * a * b * c}[self.kind]

    def velocity_at(self, points: np.ndarray) -> np.ndarray:
        """Initial velocity at points of shape (n, 3) [m/s]."""
        arm = points - np.asarray(self.center)
        velocity = np.asarray(self.velocity) + np.cross(self.angular_velocity, arm)
        if self.velocity_gradient is not None:
            velocity = velocity + arm @ np.asarray(self.velocity_gradient).T
        return velocity if self.wave is None else velocity + self.wave.at(arm)

    @property
    def top_speed(self) -> float:
        """The fastest initial speed, at the corners of the bounding box [m/s]."""
        corners = np.asarray(self.center) + CORNERS * self.extent
        still = self.model_copy(update={"wave": None}).velocity_at(corners)
        crest = 0.0 if self.wave is None else float(np.linalg.norm(self.wave.amplitude))
        return float(np.linalg.norm(still, axis=1).max()) + crest
