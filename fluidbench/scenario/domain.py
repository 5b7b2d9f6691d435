"""The box in which everything happens, and its walls."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from .model import Model, NonNegative, Vector

FACES = ("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper")


class Friction(Model):
    friction: NonNegative = Field(description="Coulomb friction coefficient; the only wall that lets material lift off")


Wall = Literal["slip", "stick", "periodic"] | Friction


class Walls(Model):
    """One wall a face of the domain. `slip` is a mirror and so a symmetry plane too; `stick` is no-slip."""

    x_lower: Wall = "slip"
    x_upper: Wall = "slip"
    y_lower: Wall = "slip"
    y_upper: Wall = "slip"
    z_lower: Wall = "stick"
    z_upper: Wall = "slip"

    @model_validator(mode="after")
    def _periodic_in_pairs(self) -> "Walls":
        for axis in "xyz":
            pair = (getattr(self, f"{axis}_lower"), getattr(self, f"{axis}_upper"))
            if pair.count("periodic") == 1:
                raise ValueError(f"{axis}_lower and {axis}_upper must both be periodic, or neither")
        return self

    def faces(self) -> tuple[Wall, ...]:
        return tuple(getattr(self, face) for face in FACES)

    def periodic(self) -> tuple[bool, bool, bool]:
        return (self.x_lower == "periodic", self.y_lower == "periodic", self.z_lower == "periodic")


class Domain(Model):
    """The box in which everything happens; its faces are the walls."""

    judged_later: ClassVar = ("lower", "upper")
    lower: Vector = Field(description="lower corner [m]")
    upper: Vector = Field(description="upper corner [m]")
    walls: Walls = Walls()

    @model_validator(mode="after")
    def _has_volume(self) -> "Domain":
        for axis, low, high in zip("xyz", self.lower, self.upper, strict=True):
            if not high > low:
                raise ValueError(f"upper must exceed lower on the {axis} axis, got {low} and {high}")
        return self

    @property
    def rubs(self) -> bool:
        """Whether a wall has friction."""
        return any(isinstance(wall, Friction) for wall in self.walls.faces())

    def contains(self, points, margin: float = 1e-9) -> np.ndarray:
        points = np.asarray(points, dtype=float)
        inside = (points >= np.array(self.lower) - margin) & (points <= np.array(self.upper) + margin)
        return np.asarray(inside.all(axis=-1))
