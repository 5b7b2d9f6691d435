"""What to simulate: pure data, validated, in SI units with z up."""

from .body import Body, Wave
from .collider import Collider, Part
from .cure import Cure
from .domain import Domain, Friction, Walls
from .expansion import Expansion
from .material import Material
from .nozzle import Nozzle
from .scenario import Scenario
from .toolpath import Toolpath
from .track import Track

__all__ = [
    "Body",
    "Collider",
    "Cure",
    "Domain",
    "Expansion",
    "Friction",
    "Material",
    "Nozzle",
    "Part",
    "Scenario",
    "Toolpath",
    "Track",
    "Walls",
    "Wave",
]
