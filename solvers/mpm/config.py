"""The numerical settings of MPM."""

from typing import Annotated

from pydantic import Field

from fluidbench.method.contract import Config

from ..viscosity import Scheme, Tolerance


class ConfigMPM(Config):
    grid_ratio: Annotated[float, Field(ge=1.0, le=4.0)] = Field(2.0, description="grid spacing over particle spacing")
    safety: Annotated[float, Field(gt=0, le=1.0)] = Field(0.8, description="share of the exact stability limit used")
    advection: Annotated[float, Field(gt=0, lt=1.0)] = Field(0.5, description="cells that matter may cross in a step")
    shifting: Annotated[float, Field(ge=0)] = Field(
        8.0,
        description="rate, over that of shear, at which particles diffuse out of crowds, in dx^2, and volume ratios "
        "settle towards the room that there is; beside a body liquids are shifted into gaps, too",
    )
    separation: Annotated[float, Field(ge=0)] = Field(
        1.0, description="shift of particles that are too near each other, over strain and crowding"
    )
    viscosity: Scheme = Field(
        "auto", description="Newtonian viscosity, explicit or implicit in time; auto takes the cheaper by the bounds"
    )
    viscous_tolerance: Tolerance = 1e-4
    kept: Annotated[int, Field(ge=1, le=64)] = Field(
        8,
        description="substeps, where matter is fed freely, for which nodes keep their momenta before particles take "
        "them back",
    )
    blocks_per_particle: Annotated[float, Field(gt=0, le=8)] = Field(0.5, description="grid blocks to preallocate")
