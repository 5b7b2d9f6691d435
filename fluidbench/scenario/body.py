"""Material that does not come from a nozzle: shapes and initial velocities, validated, in SI units."""

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from .expression import Expression, evaluate
from .model import Matrix, Model, NonNegative, Positive, Vector
from .packed import Packed

USERS = {
    "size": ("box",),
    "radius": ("cylinder", "sphere"),
    "height": ("cylinder",),
    "positions": ("points",),
    "velocities": ("points",),
    "volumes": ("points",),
}
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
    """Material that is there from `start` on: a shape filled with particles, or particles given one by one (`points`).

    Its velocity is the sum of `velocity`, of the gradient and the rotation about the centre, of `wave`, of
    `velocity_field`, and of `velocities`. What lies outside the domain is cut off: a quarter of a cylinder stands at a
    corner of two slip walls. SI units; raises ValueError for keys that do not belong together.
    """

    kind: Literal["box", "cylinder", "sphere", "points"]
    center: Vector = Field(description="centre of the body [m]")
    size: Vector | None = Field(None, description="box: edge lengths [m]")
    radius: Positive | None = Field(None, description="cylinder (axis z), sphere: radius [m]")
    height: Positive | None = Field(None, description="cylinder: height [m]")
    velocity: Vector = Field((0.0, 0.0, 0.0), description="velocity of the centre [m/s]")
    velocity_gradient: Matrix | None = Field(None, description="dv_i/dx_j about the centre [1/s]")
    angular_velocity: Vector = Field((0.0, 0.0, 0.0), description="rotation about the centre [rad/s]")
    wave: Wave | None = Field(None, description="a sine wave of velocity: amplitude, number, phase")
    where: Expression | None = Field(None, description="of x, y, z [m]: only where this holds there is material")
    velocity_field: tuple[Expression, Expression, Expression] | None = Field(
        None, description="velocity [m/s] as expressions of x, y, z [m]"
    )
    positions: Packed | None = Field(None, description="points: positions, shape (n, 3) [m]")
    velocities: Packed | None = Field(None, description="points: velocities, shape (n, 3) [m/s]")
    volumes: Packed | None = Field(None, description="points: volumes, shape (n,); default spacing^3 [m^3]")
    start: NonNegative = Field(0.0, description="when it appears: later for a layer laid on what is there [s]")
    clamped: bool = Field(False, description="keeps its velocity whatever happens: a clamp or a moving grip")

    @model_validator(mode="after")
    def _complete(self) -> "Body":
        needs = {"box": ("size",), "cylinder": ("radius", "height"), "sphere": ("radius",), "points": ("positions",)}
        needs = needs[self.kind]
        missing = [key for key in needs if getattr(self, key) is None]
        if missing:
            raise ValueError(f"a {self.kind} needs {' and '.join(missing)}")
        self.refuse_idle(self.kind, USERS)
        self._check_points()
        own = (self.velocity_gradient, self.wave, self.velocity_field, self.velocities)
        if self.start > 0 and (any(field is not None for field in own) or any(self.angular_velocity)):
            raise ValueError("a body that appears later moves as a whole: give it a velocity alone")
        if self.size is not None and min(self.size) <= 0:
            raise ValueError(f"size must be positive, got {self.size}")
        return self

    def _check_points(self) -> None:
        if self.positions is None:
            return
        shape = self.positions.array.shape
        if len(shape) != 2 or shape[1] != 3 or not shape[0]:
            raise ValueError(f"positions have the shape (n, 3), got {shape}")
        for name, wanted in (("velocities", shape), ("volumes", shape[:1])):
            given = getattr(self, name)
            if given is not None and given.array.shape != wanted:
                raise ValueError(f"{name} have the shape {wanted}, as positions have it, got {given.array.shape}")
        if self.volumes is not None and not (self.volumes.array > 0).all():
            raise ValueError("volumes must be positive")

    @model_validator(mode="before")
    @classmethod
    def _centred(cls, table: Any) -> Any:
        """Points have a centre of their own: that of their bounding box."""
        if isinstance(table, dict) and table.get("kind") == "points" and "center" not in table and "positions" in table:
            try:
                found = Packed(table["positions"]).array
            except (ValueError, TypeError, KeyError):
                return table  # refused by its own key
            if found.ndim == 2 and found.shape[0] and found.shape[1] == 3 and np.isfinite(found).all():
                table = table | {"center": tuple(0.5 * (found.min(axis=0) + found.max(axis=0)))}
        return table

    @property
    def extent(self) -> np.ndarray:
        """Half edge lengths of the bounding box, shape (3,) [m]."""
        if self.positions is not None:
            return np.abs(self.positions.array - np.asarray(self.center)).max(axis=0)
        if self.kind == "box":
            return np.asarray(self.size) / 2.0
        assert self.radius is not None
        return np.array([self.radius, self.radius, self.radius if self.kind == "sphere" else (self.height or 0) / 2.0])

    @property
    def volume(self) -> float:
        """Exact volume of the shape, before the domain or `where` cuts it [m^3]."""
        a, b, c = 2.0 * self.extent
        return {"box": a * b * c, "cylinder": math.pi / 4 * a * b * c, "sphere": math.pi / 6 * a * b * c}[self.kind]

    def velocity_at(self, points: np.ndarray) -> np.ndarray:
        """Initial velocity at points of shape (n, 3) [m/s]."""
        arm = points - np.asarray(self.center)
        velocity = np.asarray(self.velocity) + np.cross(self.angular_velocity, arm)
        if self.velocity_gradient is not None:
            velocity = velocity + arm @ np.asarray(self.velocity_gradient).T
        if self.velocity_field is not None:
            velocity = velocity + np.stack([evaluate(text, points) for text in self.velocity_field], axis=1)
        return velocity if self.wave is None else velocity + self.wave.at(arm)

    @property
    def top_speed(self) -> float:
        """The fastest initial speed of a shape without a `velocity_field`: at the corners of its bounding box, on the
        crest of its wave [m/s]."""
        corners = np.asarray(self.center) + CORNERS * self.extent
        still = self.model_copy(update={"wave": None}).velocity_at(corners)
        crest = 0.0 if self.wave is None else float(np.linalg.norm(self.wave.amplitude))
        return float(np.linalg.norm(still, axis=1).max()) + crest
