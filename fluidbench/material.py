"""What a material is made of: validated input in SI units and the moduli derived from it."""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Material(BaseModel):
    """An elasto-viscoplastic material; its limits are a Newtonian liquid, a Maxwell liquid, a Bingham or
    Herschel-Bulkley paste and an elastic solid (see docs/physics.md).

    Without `youngs_modulus` the material has no shear stiffness: a liquid whose only shear stress is `viscosity`.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    density: Positive = Field(description="rest density [kg/m^3]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus E [Pa]; none for a liquid")
    poisson_ratio: Annotated[float, Field(gt=-1.0, lt=0.5)] = Field(0.3, description="Poisson ratio [-]")
    viscosity: NonNegative = Field(0.0, description="Newtonian dynamic viscosity, explicit in time [Pa s]")
    yield_stress: NonNegative | None = Field(None, description="von Mises yield stress in pure shear [Pa]")
    plastic_viscosity: NonNegative = Field(0.0, description="Herschel-Bulkley consistency [Pa s^n]")
    flow_index: Positive = Field(1.0, description="Herschel-Bulkley exponent n [-]")
    relaxation_time: Positive | None = Field(None, description="of an Oldroyd-B liquid, instead of a yield stress [s]")
    sound_speed: Positive | None = Field(None, description="sqrt(K/rho) [m/s]; overrides K from E and nu")
    bulk_modulus: Positive | None = Field(None, description="bulk modulus K [Pa]; overrides K from E and nu")
    equation_of_state: Literal["linear", "tait"] = Field("linear", description="pressure law; Tait has gamma = 7")

    @model_validator(mode="after")
    def _consistent(self) -> "Material":
        if self.sound_speed is not None and self.bulk_modulus is not None:
            raise ValueError("give sound_speed or bulk_modulus, not both")
        if self.youngs_modulus is None and (self.yield_stress is not None or self.relaxation_time is not None):
            raise ValueError("yield_stress and relaxation_time need youngs_modulus (100 x yield_stress is usual)")
        if self.relaxation_time is not None and (self.yield_stress is not None or self.plastic_viscosity > 0):
            raise ValueError("relaxation_time makes an Oldroyd-B liquid: leave out yield_stress and plastic_viscosity")
        if self.plastic_viscosity > 0 and self.yield_stress is None:
            raise ValueError("plastic_viscosity needs yield_stress (0 for a Maxwell liquid, or use viscosity)")
        return self

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]; 0 for a liquid."""
        return 0.0 if self.youngs_modulus is None else self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    def bulk(self, liquid_sound_speed: float) -> float:
        """Bulk modulus K [Pa]: as given, else E / (3 (1 - 2 nu)), else rho c^2 with the scenario's artificial c."""
        if self.bulk_modulus is not None:
            return self.bulk_modulus
        if self.sound_speed is not None:
            return self.density * self.sound_speed**2
        if self.youngs_modulus is not None:
            return self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poisson_ratio))
        return self.density * liquid_sound_speed**2

    def wave_speed(self, liquid_sound_speed: float) -> float:
        """Longitudinal wave speed c = sqrt((K + 4 G / 3) / rho) [m/s]."""
        return math.sqrt((self.bulk(liquid_sound_speed) + 4.0 * self.shear_modulus / 3.0) / self.density)

    @property
    def is_solid(self) -> bool:
        """Whether it never flows: elastic, without relaxation, yielding not before a shear of 100 % if at all."""
        elastic = self.youngs_modulus is not None and self.relaxation_time is None
        return elastic and self.flow_threshold >= self.shear_modulus

    @property
    def flow_threshold(self) -> float:
        """Shear stress at which it flows plastically [Pa]: infinite for elastic matter, 0 for a liquid."""
        if self.youngs_modulus is None:
            return 0.0
        return math.inf if self.yield_stress is None else self.yield_stress
