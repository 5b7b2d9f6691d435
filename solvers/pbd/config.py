"""The numerical settings of PBD, and which of them a material takes."""

from typing import Annotated

from pydantic import Field

from fluidbench.method.contract import Config
from fluidbench.scenario.material import Material

from ..viscosity import Tolerance


class ConfigPBD(Config):
    support_ratio: Annotated[float, Field(ge=2.0, le=3.5)] = Field(2.4, description="kernel radius H over spacing")
    iterations: Annotated[int, Field(ge=1, le=200)] | None = Field(
        None, description="density iterations per substep; else 2 to 5, more the stiffer matter is over one"
    )
    advance: Annotated[float, Field(gt=0, le=1)] = Field(0.125, description="accuracy: spacings moved per substep")
    relaxation: Annotated[float, Field(gt=0)] = Field(0.2, description="constraint force mixing epsilon")
    over_relaxation: Annotated[float, Field(gt=0, le=2)] = Field(1.0, description="factor on each Jacobi correction")
    viscous_tolerance: Tolerance = 1e-3
    hourglass: Annotated[float, Field(ge=0, le=1)] = Field(
        1.0, description="zeta: stiffness, over G, of motion that no velocity gradient shows; 0 in what expands"
    )
    skin: Annotated[float, Field(gt=0, le=1)] = Field(0.3, description="how far lists may reach beyond H, over spacing")

    def zeta(self, material: Material) -> float:
        """Of the hourglass control. It remembers where neighbours were: in what expands, children have others."""
        return self.hourglass if material.expansion is None else 0.0
