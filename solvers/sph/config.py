"""The numerical settings of SPH, and which of them a material takes."""

from typing import Annotated

from pydantic import Field

from fluidbench.method.contract import Config
from fluidbench.scenario.material import Material

from ..viscosity import Scheme, Tolerance

NonNegative = Annotated[float, Field(ge=0)]
Ratio = Annotated[float, Field(ge=1.0, le=3.0)]


class ConfigSPH(Config):
    smoothing_ratio: Ratio = Field(1.8, description="smoothing length h over spacing, for liquids")
    smoothing_ratio_solid: Ratio = Field(1.3, description="the same for materials with shear stiffness")
    smoothing_ratio_foam: Ratio = Field(
        1.5, description="the same for those that expand, whose particles lie in no order"
    )
    cfl: Annotated[float, Field(gt=0, le=1.5)] = Field(0.4, description="acoustic number dt (c + v) / h")
    viscous_number: Annotated[float, Field(gt=0, le=0.1)] = Field(
        0.09, description="dt nu / h^2; stable below 0.111, in order"
    )
    viscosity: Scheme = Field(
        "auto", description="Newtonian viscosity, explicit or implicit in time; auto takes the cheaper by the bounds"
    )
    viscous_tolerance: Tolerance = 1e-4
    force_number: Annotated[float, Field(gt=0, le=1)] = Field(0.25, description="dt / sqrt(h / |g|)")
    density_diffusion: NonNegative = Field(0.1, description="delta of delta-SPH")
    artificial_viscosity: NonNegative = Field(0.01, description="alpha for liquids")
    artificial_viscosity_solid: NonNegative = Field(1.0, description="alpha for solids and pastes")
    artificial_viscosity_viscoelastic: NonNegative = Field(0.3, description="alpha for liquids that relax")
    hourglass: NonNegative = Field(
        2.0, description="zeta: stiffness, over G, of motion that no velocity gradient shows"
    )
    shifting: NonNegative = Field(
        4.0,
        description="rate of settling over shear; shift over strain and h^2 crowding, of what cavitates 12 times that",
    )
    density_feedback: NonNegative = Field(
        0.05,
        description="rate, in c / h, at which integrated density follows the summed one where it is crowded",
    )
    density_tolerance: NonNegative = Field(
        0.06, description="gap between the two that is left alone where they settle, over what disorder feigns"
    )
    skin: Annotated[float, Field(gt=0, le=1)] = Field(0.25, description="how far lists may reach beyond 2 h, over h")

    def alpha(self, material: Material) -> float:
        if material.relaxation_time is not None:
            return self.artificial_viscosity_viscoelastic
        return self.artificial_viscosity_solid if material.elastic else self.artificial_viscosity

    def smoothing_key(self, material: Material) -> str:
        if not material.elastic:
            return "smoothing_ratio"
        return "smoothing_ratio_solid" if material.expansion is None else "smoothing_ratio_foam"

    def smoothing(self, material: Material) -> float:
        """Smoothing length over spacing."""
        return float(getattr(self, self.smoothing_key(material)))
