"""What scenarios may ask of a method."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..scenario import Scenario


class Feature(Enum):
    """What a method can honour; a scenario that needs more is refused, in these words."""

    VISCOSITY = "Newtonian viscosity"
    ELASTICITY = "elastic shear stress"
    YIELD = "yield stress"
    HARDENING = "yield stress that hardens"
    RELAXATION = "stress that relaxes"
    FRICTION = "Coulomb friction at walls"
    PERIODIC = "periodic axes"
    CURE = "material parameters that change with age"
    EXPANSION = "rest volumes that grow"
    EMISSION = "material that comes from a nozzle"
    TIP = "bodies that matter is pressed through"
    COLLIDER = "rigid bodies that are carried along"
    CLAMP = "bodies that keep their velocity"
    LATER = "bodies that appear later"
    FIELD = "forces that change over space"


def needed(scenario: Scenario) -> frozenset[Feature]:
    """What a scenario asks for beyond a liquid in a box with gravity, now or once it has cured."""
    m, walls, levels = scenario.material, scenario.domain.walls, scenario.material.levels()
    asked = {
        Feature.VISCOSITY: any(level.viscosity > 0 for level in levels),
        Feature.ELASTICITY: any(level.youngs_modulus is not None for level in levels),
        Feature.YIELD: any(bool(level.yield_stress) for level in levels),
        Feature.HARDENING: m.hardening is not None,
        Feature.RELAXATION: m.relaxation_time is not None,
        Feature.FRICTION: scenario.domain.rubs,
        Feature.PERIODIC: any(walls.periodic()),
        Feature.CURE: m.cure is not None,
        Feature.EXPANSION: m.expansion is not None,
        Feature.EMISSION: scenario.nozzle is not None,
        Feature.TIP: scenario.outline is not None,
        Feature.COLLIDER: scenario.collider is not None,
        Feature.CLAMP: any(body.clamped for body in scenario.bodies),
        Feature.LATER: any(body.start > 0 for body in scenario.bodies),
        Feature.FIELD: scenario.body_force_gradient is not None,
    }
    return frozenset(feature for feature, wanted in asked.items() if wanted)
