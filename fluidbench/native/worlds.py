"""Which scenarios can share the launches of one session, as worlds that differ in their material or their forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..scenario import Scenario

VARY = {"material", "gravity", "body_force", "body_force_gradient", "name", "title", "seed", "measured"}
SHARED = ("cure", "expansion")  # sections of a material that worlds have in common


def apart(scenarios: Sequence[Scenario]) -> str | None:
    """Why these scenarios cannot be worlds of one session; None where they can."""
    first = scenarios[0]
    common = first.model_dump(exclude=VARY)
    for i, other in enumerate(scenarios[1:], 1):
        changed = [key for key, value in other.model_dump(exclude=VARY).items() if value != common[key]]
        if changed:
            rule = "worlds may differ in material, gravity, body_force and seed only"
            return f"{rule}; world {i} differs in {', '.join(changed)}"
        for section in SHARED:
            if getattr(other.material, section) != getattr(first.material, section):
                return f"worlds must share material.{section}; world {i} differs"
    return None
