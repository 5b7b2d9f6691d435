"""SPlisHSPlasH (https://github.com/InteractiveComputerGraphics/SPlisHSPlasH): its weakly compressible and its
divergence-free SPH, for liquids. What they are is said here; how they run, in splishsplash_session.py.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ..errors import UserError
from ..method.contract import Config, Session
from ..method.features import Feature
from ..method.suitability import check_backend, refusal
from ..method.target import Target
from ..scenario import Scenario
from ..scenario.layout import lay_out
from .guest import Guest

BEHIND = 0.6  # spacings from a domain's face to the wall's particles: there a lattice has its rest density at the wall
ALIKE = 1e-3  # relative difference of particle volumes up to which all can have the mean one
LONGEST = 5e-3  # the engine's own default for its longest step [s]
VISCOSITIES = {"standard": (1, "Standard viscosity"), "weiler2018": (6, "Weiler et al. 2018")}  # ids of version 2.19

Positive = Annotated[float, Field(gt=0)]


class ConfigSPlisHSPlasH(Config):
    viscosity: Literal["standard", "weiler2018"] = Field(
        "standard", description="Newtonian viscosity: explicit (Monaghan 2005), or implicit (Weiler et al. 2018)"
    )
    artificial_viscosity: Annotated[float, Field(ge=0)] = Field(0.0, description="alpha, as nu = alpha d c / 10")
    cfl: Positive = Field(0.5, description="the engine's cflFactor: dt = 0.4 cfl d / v")
    viscous_number: Positive = Field(0.1, description="standard viscosity: longest step nu / d^2; 0.15 blows up")
    viscous_error: Positive = Field(0.01, description="weiler2018: relative residual at which its solver stops")


class ConfigWCSPH(ConfigSPlisHSPlasH):
    artificial_viscosity: Annotated[float, Field(ge=0)] = Field(0.1, description="alpha, as nu = alpha d c / 10")
    acoustic_number: Positive = Field(0.4, description="longest step, c / d")


class ConfigDFSPH(ConfigSPlisHSPlasH):
    density_error: Positive = Field(0.05, description="at which the pressure solver stops [%]")
    divergence_error: Positive = Field(0.1, description="at which the divergence solver stops [%]")
    force_number: Positive = Field(0.1, description="longest step over sqrt(d / |g|); from rest 0.3 blows up")


class SPlisHSPlasH(Guest):
    """What its methods share."""

    engine = "splishsplash"
    features = frozenset({Feature.VISCOSITY})
    number: ClassVar[int]  # the engine's own, of the method

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        volumes = np.concatenate([lay_out(body, scenario).volume for body in scenario.bodies])
        least, most = float(volumes.min()), float(volumes.max())
        if most > (1.0 + ALIKE) * least:
            return f"its particles are all alike, and the bodies ask for {least:.4g} to {most:.4g} m^3"
        if scenario.material.viscosity > 0 and sticks(scenario) and (face := _slippery(scenario)):
            return (
                f"its walls slip or stick together, and here a body lies at {face}, which slips beside walls that stick"
            )
        return None

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        walls = (
            f"walls are particles of its own (Akinci et al. 2012), {BEHIND:g} spacings behind the domain's faces: "
            "there the lattice has its rest density at a wall to 1 %, and nothing settles before the start"
        )
        found = [walls]
        if sticks(scenario):
            mixed = "slip" in scenario.domain.walls.faces()
            found.append("walls that stick hold by their viscosity alone" + ", those that slip, too" * mixed)
        if (nu := cls.artificial(scenario, config)) > 0:
            found.append(f"an artificial viscosity of {nu:.3g} m^2/s is added against noise")
        return found

    @classmethod
    def artificial(cls, scenario: Scenario, config: Any) -> float:
        """Artificial viscosity alpha h c / (2 (3 + 2)) (Monaghan 2005, section 7.1), h = d for its kernel [m^2/s]."""
        return config.artificial_viscosity * scenario.spacing * scenario.wave_speed / 10.0

    @classmethod
    def caps(cls, scenario: Scenario, config: Any) -> dict[str, float]:
        """The longest steps that it is allowed [s], by what limits them; below them its own condition counts."""
        nu = scenario.material.viscosity / scenario.material.density + cls.artificial(scenario, config)
        explicit = config.viscosity == "standard" and nu > 0
        viscous = {"viscous cap": config.viscous_number * scenario.spacing**2 / nu} if explicit else {}
        return {"the engine's longest step": LONGEST, **viscous}

    @classmethod
    def pressure(cls, scenario: Scenario, config: Any) -> dict[str, Any]:
        """Its section on pressure."""
        raise NotImplementedError

    @classmethod
    def start(cls, scenario: Scenario, config: Any, target: Target) -> Session:
        check_backend(cls, target)
        if reason := refusal(cls, scenario, config):
            raise UserError(f"{cls.name} cannot run {scenario.name}: {reason}")
        from .splishsplash_session import Course

        return Course(cls, scenario, config, target.threads)


class WCSPH(SPlisHSPlasH):
    """SPlisHSPlasH's weakly compressible SPH (Becker & Teschner 2007)."""

    name = "splishsplash-wcsph"
    paradigm = "Lagrangian particles, kernel sums over neighbours, pressure from an equation of state; SPlisHSPlasH's"
    Config: ClassVar = ConfigWCSPH
    number = 0

    @classmethod
    def caps(cls, scenario: Scenario, config: Any) -> dict[str, float]:
        acoustic = config.acoustic_number * scenario.spacing / scenario.wave_speed
        return super().caps(scenario, config) | {"acoustic cap": acoustic}

    @classmethod
    def pressure(cls, scenario: Scenario, config: Any) -> dict[str, Any]:
        """p = B ((rho / rho0)^n - 1) with B = K / n, so that c^2 = dp / drho = K / rho0."""
        exponent = 7 if scenario.material.equation_of_state == "tait" else 1
        bulk = scenario.material.bulk(scenario.liquid_sound_speed)
        return {"WCSPH": {"stiffness": bulk / exponent, "exponent": exponent}}


class DFSPH(SPlisHSPlasH):
    """SPlisHSPlasH's divergence-free SPH (Bender & Koschier 2015): incompressible, implicit pressure."""

    name = "splishsplash-dfsph"
    paradigm = (
        "Lagrangian particles, kernel sums over neighbours, pressure that keeps density and divergence; SPlisHSPlasH's"
    )
    rank = 201
    Config: ClassVar = ConfigDFSPH
    number = 4

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        return [*super().approximates(scenario, config), "it is incompressible: no sound, no bulk modulus"]

    @classmethod
    def caps(cls, scenario: Scenario, config: Any) -> dict[str, float]:
        g = float(np.linalg.norm(scenario.acceleration))
        force = {"force cap": config.force_number * (scenario.spacing / g) ** 0.5} if g > 0 else {}
        return super().caps(scenario, config) | force

    @classmethod
    def pressure(cls, scenario: Scenario, config: Any) -> dict[str, Any]:
        errors = {"maxError": config.density_error, "maxErrorV": config.divergence_error}
        return {"DFSPH": {**errors, "minIterations": 2, "maxIterations": 100, "maxIterationsV": 100}}


def sticks(scenario: Scenario) -> bool:
    """Whether any wall is to stick."""
    return "stick" in scenario.domain.walls.faces()


def _slippery(scenario: Scenario) -> str:
    """A face that slips and that a body touches from the start; empty where there is none."""
    domain, near = scenario.domain, 0.5 * scenario.spacing
    for body in scenario.bodies:
        low, high = np.asarray(body.center) - body.extent, np.asarray(body.center) + body.extent
        for i, axis in enumerate("xyz"):
            for end, touches in (
                ("lower", low[i] < domain.lower[i] + near),
                ("upper", high[i] > domain.upper[i] - near),
            ):
                if touches and getattr(domain.walls, f"{axis}_{end}") == "slip":
                    return f"{axis}_{end}"
    return ""
