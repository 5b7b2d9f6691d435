"""A scenario laid out on a device: phase table, walls, gravity and dt, for one world or several.

Worlds are copies of one scenario that differ in material, gravity or body force and advance in the same launches.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
import warp as wp

from ..errors import UserError
from ..method.vitals import top_speed
from ..scenario import Friction, Scenario
from ..scenario.material import Material
from .carriage import Carriage
from .clock import Clock
from .crew import Crew
from .device import quiet_warp
from .worlds import apart

quiet_warp()
SLIP, STICK, PERIODIC, FRICTION = 0, 1, 2, 3
NEVER_YIELDS = wp.constant(1.0e30)
REACH = 8.0  # spacings beyond a wall; at the speeds above, steps within their bounds lead 2 to 6 beyond it


@wp.struct
class Phase:
    """Parameters of the material law; see solvers/constitutive.py for their meaning. SI units."""

    density: float
    bulk_modulus: float
    shear_modulus: float
    viscosity: float
    yield_stress: float
    saturated_yield_stress: float
    hardening: float
    plastic_viscosity: float
    flow_index: float
    relaxation_rate: float
    tait: float
    tension_limit: float
    wave_speed: float


@wp.struct
class Box:
    """The domain's walls: kind and friction coefficient of the lower and upper face of each axis."""

    lower: wp.vec3
    upper: wp.vec3
    lower_kind: wp.vec3i
    upper_kind: wp.vec3i
    lower_friction: wp.vec3
    upper_friction: wp.vec3
    reach: wp.vec3  # farther than this beyond a face no step of sound motion leads [m]
    top_speed: float  # faster than this nothing moves that comes from the scenario [m/s]


@wp.struct
class Force:
    """Force per unit mass at x: uniform + gradient x."""

    uniform: wp.vec3
    gradient: wp.mat33


@wp.func
def force_at(force: Force, x: wp.vec3):
    """Force per unit mass [m/s^2] at a point."""
    return force.uniform + force.gradient * x


@wp.func
def force_potential(force: Force, x: wp.vec3):
    """Minus the potential energy per unit mass [J/kg] at a point."""
    return wp.dot(force.uniform + 0.5 * (force.gradient * x), x)


@wp.func
def too_fast(v: wp.vec3, top_speed: float):
    """Whether a velocity cannot come from the scenario, or is not finite: to be asked before walls act on the motion. A
    step at any other speed, from a place in the domain, leads nowhere that a wall could hide."""
    return not (wp.length_sq(v) <= top_speed * top_speed)


@wp.func
def is_solid(phase: Phase):
    """Whether the material never flows (see Material.is_solid): nothing may relax its shape or volume."""
    return phase.shear_modulus > 0.0 and phase.yield_stress >= phase.shear_modulus and phase.relaxation_rate == 0.0


class Scene:
    """What a solver sees of the scenarios. `dt`, `force` and `phases` are device arrays, so that a captured graph
    survives a change of their values."""

    def __init__(self, scenarios: Scenario | Sequence[Scenario], device: str = "cpu", threads: int = 1) -> None:
        self.scenarios = [scenarios] if isinstance(scenarios, Scenario) else list(scenarios)
        self.scenario = self.scenarios[0]
        self.device = wp.get_device(device)
        self.crew = Crew(self.device, threads)
        self.clock = Clock(self.scenario, self.crew)
        self.worlds = len(self.scenarios)
        if reason := apart(self.scenarios):
            raise UserError(reason)
        self.spacing = self.scenario.spacing
        self.periodic = self.scenario.domain.walls.periodic()
        self.sound_speed = max(s.liquid_sound_speed for s in self.scenarios)
        self.wave_speed = max(s.wave_speed for s in self.scenarios)
        self.top_wave_speed = max(s.top_wave_speed for s in self.scenarios)
        self.top_speed = top_speed(self.scenario, self.top_wave_speed)
        self.box = box_of(self.scenario)
        self.box.top_speed = self.top_speed
        self._dt = math.nan
        with wp.ScopedDevice(self.device):
            self.dt = wp.zeros(self.worlds, dtype=float)
            self.force = wp.array([_force(s) for s in self.scenarios], dtype=Force)
            rows = [(s, m) for s in self.scenarios for m in s.material.levels()]
            self.materials = [m for _, m in rows]
            self.levels = len(rows) // self.worlds  # rows of the phase table: levels of cure, the fresh material first
            table = [self._phase(*row) for row in rows]
            self.phases = wp.array(table, dtype=Phase).reshape((self.worlds, self.levels))
        self.outline = self.scenario.outline
        carries = self.scenario.collider is not None or self.outline is not None
        self.carriage = Carriage(self.crew, self.clock.hours, self.dt) if carries else None

    def _phase(self, scenario: Scenario, material: Material) -> Phase:
        phase = Phase()
        phase.wave_speed = material.wave_speed(self.sound_speed)
        phase.density = material.density
        phase.bulk_modulus = material.bulk(self.sound_speed)
        phase.shear_modulus = material.shear_modulus
        phase.viscosity = material.viscosity
        phase.yield_stress = min(material.flow_threshold, NEVER_YIELDS)
        phase.saturated_yield_stress = material.saturated_yield_stress or 0.0
        phase.hardening = material.hardening or 0.0
        phase.plastic_viscosity = material.plastic_viscosity
        phase.relaxation_rate = 0.0 if material.relaxation_time is None else 1.0 / material.relaxation_time
        phase.flow_index = material.flow_index
        phase.tait = 1.0 if material.equation_of_state == "tait" else 0.0
        phase.tension_limit = min(scenario.tension(material), NEVER_YIELDS)
        return phase

    def _any(self, holds: Callable[[Material], bool]) -> bool:
        """Whether this holds for the material of any world at any level of cure."""
        return any(map(holds, self.materials))

    @property
    def elastic(self) -> bool:
        """Whether anything has shear stiffness, now or later."""
        return self._any(lambda m: m.youngs_modulus is not None)

    @property
    def flows(self) -> bool:
        """Whether anything may flow, now or later."""
        return self._any(lambda m: not m.is_solid)

    @property
    def viscous(self) -> bool:
        """Whether anything has Newtonian viscosity, now or later."""
        return self._any(lambda m: m.viscosity > 0)

    @property
    def hardens(self) -> bool:
        """Whether anything hardens with plastic strain."""
        return any(s.material.hardening for s in self.scenarios)

    @property
    def cures(self) -> bool:
        return self.levels > 1

    @property
    def grows(self) -> bool:
        """Whether rest volumes grow continuously."""
        return any((e := s.material.expansion) is not None and e.kind == "growth" for s in self.scenarios)

    @property
    def expands(self) -> bool:
        """Whether rest densities come to differ, by growth or by spawning."""
        return any(s.material.expansion is not None for s in self.scenarios)

    @property
    def changes(self) -> bool:
        """Whether parameters or rest densities differ between particles of a world."""
        return any(s.material.changes for s in self.scenarios)

    @property
    def lanes(self) -> int:
        """Threads of a kernel that strides over all its work: one on the CPU, a full device on CUDA."""
        return 1 if self.device.is_cpu else 256 * 1024

    @property
    def tensile(self) -> bool:
        """Whether matter of any world carries tension."""
        return any(s.is_tensile for s in self.scenarios)

    def set_dt(self, dt: float) -> None:
        if not math.isfinite(dt) or dt <= 0:
            raise ValueError(f"dt must be positive, got {dt}")
        if dt != self._dt:
            self.dt.fill_(dt)
            self._dt = dt


def _force(scenario: Scenario) -> Force:
    """The scenario's force field as a device structure."""
    force = Force()
    offset = scenario.gradient @ np.asarray(scenario.body_force_center)
    force.uniform = wp.vec3(*(scenario.acceleration - offset))
    force.gradient = wp.mat33(*scenario.gradient.ravel())
    return force


def box_of(scenario: Scenario) -> Box:
    """The domain's walls as a device structure."""
    kinds, friction = [], []
    for wall in scenario.domain.walls.faces():
        named = {"slip": SLIP, "stick": STICK, "periodic": PERIODIC}
        kinds.append(FRICTION if isinstance(wall, Friction) else named[wall])
        friction.append(wall.friction if isinstance(wall, Friction) else 0.0)
    box = Box()
    box.lower, box.upper = wp.vec3(*scenario.domain.lower), wp.vec3(*scenario.domain.upper)
    box.lower_kind, box.upper_kind = wp.vec3i(*kinds[0::2]), wp.vec3i(*kinds[1::2])
    box.lower_friction, box.upper_friction = wp.vec3(*friction[0::2]), wp.vec3(*friction[1::2])
    size = np.asarray(scenario.domain.upper) - np.asarray(scenario.domain.lower)
    box.reach = wp.vec3(*np.minimum(REACH * scenario.spacing, size))
    return box
