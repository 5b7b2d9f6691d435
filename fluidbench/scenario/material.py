"""What a material is made of: validated input in SI units and the moduli derived from it."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .cure import Cure
from .expansion import Expansion
from .model import Model, NonNegative, Positive


class Material(Model):
    """An elasto-viscoplastic material; its limits are a Newtonian liquid, a Maxwell liquid, a Bingham or
    Herschel-Bulkley paste and an elastic solid (see docs/physics.md).

    Without `youngs_modulus` the material has no shear stiffness: a liquid whose only shear stress is `viscosity`.
    """

    density: Positive = Field(description="rest density [kg/m^3]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus E [Pa]; none for a liquid")
    poisson_ratio: Annotated[float, Field(gt=-1.0, lt=0.5)] = Field(0.3, description="Poisson ratio [-]")
    viscosity: NonNegative = Field(0.0, description="Newtonian dynamic viscosity [Pa s]")
    yield_stress: NonNegative | None = Field(None, description="von Mises yield stress in pure shear [Pa]")
    saturated_yield_stress: Positive | None = Field(
        None, description="yield stress after much plastic strain, where it hardens [Pa]"
    )
    hardening: Positive | None = Field(
        None, description="rate at which it does: (saturated - present) falls as exp(-rate x plastic strain) [-]"
    )
    flow_index: Positive = Field(1.0, description="Herschel-Bulkley exponent n [-]")
    plastic_viscosity: NonNegative = Field(0.0, description="Herschel-Bulkley consistency [Pa s^n]")
    relaxation_time: Positive | None = Field(None, description="of an Oldroyd-B liquid, instead of a yield stress [s]")
    sound_speed: Positive | None = Field(None, description="sqrt(K/rho) [m/s]; overrides K from E and nu")
    bulk_modulus: Positive | None = Field(None, description="bulk modulus K [Pa]; overrides K from E and nu")
    tension_limit: NonNegative | None = Field(
        None,
        description="tension at which it cavitates [Pa]; else a liquid does at what its own viscosity pulls with, "
        "what has strength never",
    )
    equation_of_state: Literal["linear", "tait"] = Field("linear", description="pressure law; Tait has gamma = 7")
    cure: Cure | None = Field(None, description="how it cures after it left the nozzle")
    expansion: Expansion | None = Field(None, description="how it expands after it left the nozzle")

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
        self._check_hardening()
        if self.cure is not None:
            self._check_cure(self.cure)
        return self

    def _check_hardening(self) -> None:
        if (self.hardening is None) != (self.saturated_yield_stress is None):
            raise ValueError("hardening and saturated_yield_stress belong together: give both or neither")
        if self.cure is not None and self.cure.saturated_yield_stress is not None and self.hardening is None:
            raise ValueError("cure.saturated_yield_stress needs hardening and saturated_yield_stress")
        if self.hardening is None:
            return
        if not self.yield_stress:
            raise ValueError("hardening needs a yield_stress above 0 to begin from")
        for degree, when in ((0.0, "fresh"), (1.0, "cured")):
            aged = self.at(degree)
            first, last = aged.yield_stress or 0.0, aged.saturated_yield_stress or 0.0
            if last < first:
                raise ValueError(
                    f"{when}, saturated_yield_stress = {last:g} lies below yield_stress = {first:g}: what "
                    "softens breaks along a plane as thin as a spacing, whatever that is"
                )

    def _check_cure(self, cure: Cure) -> None:
        if self.relaxation_time is not None:
            raise ValueError("cure: an Oldroyd-B liquid (relaxation_time) cannot cure; use yield_stress instead")
        if self.expansion is not None and cure.delay < self.expansion.delay:
            raise ValueError(
                f"cure.delay = {cure.delay} comes before expansion.delay = {self.expansion.delay}: cured foam cannot "
                "expand; let it expand first"
            )
        if self.youngs_modulus is None and cure.youngs_modulus is None and cure.yield_stress is not None:
            raise ValueError("cure.yield_stress needs a youngs_modulus, fresh or cured")
        volumetric = self.bulk_modulus is not None or self.sound_speed is not None
        if self.youngs_modulus is None and cure.youngs_modulus is not None and not volumetric:
            raise ValueError("a liquid that cures to a solid needs bulk_modulus or sound_speed, the same for both")

    @property
    def elastic(self) -> bool:
        """Whether it has shear stiffness at any age."""
        return self.youngs_modulus is not None or (self.cure is not None and self.cure.youngs_modulus is not None)

    @property
    def changes(self) -> bool:
        """Whether it cures or expands."""
        return self.cure is not None or self.expansion is not None

    def at(self, degree: float = 0.0, volume_ratio: float = 1.0) -> "Material":
        """The material at a degree of cure and a volume ratio."""
        update: dict[str, float] = {"density": self.density / volume_ratio}
        if self.cure is not None and degree > 0:
            update |= self.cure.parameters(self.model_dump(), degree)
        return self.model_copy(update=update)

    def levels(self) -> list["Material"]:
        """The material at every level of cure, the fresh one first: the rows of the phase table."""
        count = self.cure.levels if self.cure is not None else 0
        return [self.at(k / count if k else 0.0) for k in range(count + 1)]

    def by_age(self, ages: Sequence[float]) -> list["Material"]:
        """The material at these ages [s], jitter taken as early."""
        found = []
        for age in ages:
            degree = self.cure.degree(age + self.cure.jitter) if self.cure is not None else 0.0
            ratio = self.expansion.volume_ratio(age + self.expansion.jitter) if self.expansion is not None else 1.0
            found.append(self.at(degree, ratio))
        return found

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
    def steady_viscosity(self) -> float:
        """What resists a steady flow at a shear rate of 1/s, beside the yield stress [Pa s]."""
        return self.viscosity + self.plastic_viscosity + self.shear_modulus * (self.relaxation_time or 0.0)

    @property
    def is_solid(self) -> bool:
        """Whether it never flows: elastic, without relaxation, yielding not before a shear of 100 % if at all."""
        elastic = self.youngs_modulus is not None and self.relaxation_time is None
        return elastic and self.flow_threshold >= self.shear_modulus

    @property
    def strength(self) -> float:
        """Largest shear stress that it withstands without flow, however often it has yielded [Pa]."""
        return max(self.flow_threshold, self.saturated_yield_stress or 0.0)

    @property
    def flow_threshold(self) -> float:
        """Shear stress at which it flows plastically [Pa]: infinite for elastic matter, 0 for a liquid."""
        if self.youngs_modulus is None:
            return 0.0
        return math.inf if self.yield_stress is None else self.yield_stress
