"""Weakly compressible SPH: allocation and the order of passes."""

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .. import aging
from ..backends import backend_of
from ..conjugate import carried_by, effort_of, footprint_of
from ..constitutive import STRETCHED
from ..crowding import crowding, farthest, nearest
from ..flow import plastic_strains
from ..lattice import lattice_moment, opposing, sloping
from ..neighbours import neighbours_of, side_by_side
from ..readout import pressures, shear_stress
from ..smoothing import wendland_slope
from ..tool import table_of, tool_of
from ..tool_map import Weights
from ..viscosity import ImplicitViscosity, beside
from . import kernels_warp as kernels
from .force_warp import Forcing, width_of
from .particle import CLOSE, Smoothing
from .settling import disorder
from .settling_warp import Settling, told_of
from .strain_warp import MATTER, Straining
from .traits import TraitsSPH

STRAINS = ("elastic_normal", "elastic_shear", "off_linear")
BROKEN = 0.6  # distance below which what does not flow is moved apart, too: no elastic strain brings it there


def weights(h: float) -> Weights:
    """Of what the passes sum over partners: grad W, and viscous drag; h [m]."""
    return Weights(lambda r: wendland_slope(r / h, h), **beside(2.0 * h))


class SolverSPH(TraitsSPH):
    """WCSPH with Wendland C2 kernel, delta-SPH density diffusion, mirror-image walls, symplectic Euler."""

    passes = ("lists", "pack", "strain", "force", "drag", "move")
    OWN: ClassVar = ("matter", "new_density", "state", "shift", "acceleration", "told")

    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        self.scene, self.pool, self.config = scene, pool, config
        self.backend = backend_of(backend, scene, threads)
        self.implicit = scene.viscous and config.viscosity == "implicit"
        viscous = scene.viscous and not self.implicit
        self.variant = scene.elastic, scene.tensile, viscous, scene.changes
        self.width = width_of(*self.variant)
        self.settles = scene.flows and config.shifting > 0.0
        self.arranges = int(self.settles)
        self.kernels = self.kernels_of(backend)
        self.num = Smoothing()
        ratio = config.smoothing(scene.scenario.material)
        self.num.h = ratio * scene.spacing
        self.num.near = nearest(CLOSE * scene.spacing, self.num.h)
        self.num.broken = crowding(BROKEN * scene.spacing, scene.spacing, CLOSE * scene.spacing, self.num.h)
        self.num.lattice = 1.0 / lattice_moment(ratio)
        self.num.density_diffusion = config.density_diffusion
        self.num.artificial_viscosity = config.alpha(scene.scenario.material)
        self.num.compact = (scene.spacing / opposing(ratio)) ** 2
        self.num.hourglass = config.hourglass
        self.num.shifting = config.shifting
        self.num.spacing = scene.spacing
        self.num.farthest = farthest(scene.spacing, CLOSE * scene.spacing, self.num.h)
        self.num.evened = scene.spacing**2 / float(sloping(ratio)[1].sum())
        self.num.density_feedback = config.density_feedback
        self.num.density_tolerance, self.num.disorder = config.density_tolerance, disorder(ratio)
        self.num.settling = config.shifting * scene.clock.tick
        pool.add_field("density", float, scene.scenario.material.density)
        pool.add_field("carried_gradient", wp.vec3)
        pool.add_field("flowing", float)
        self._rest_densities()
        if scene.elastic:
            pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0), within=(1.0 / STRETCHED, STRETCHED))
            pool.add_field("elastic_shear", wp.vec3)
            pool.add_field("off_linear", wp.vec3)
        with wp.ScopedDevice(scene.device):
            self.unused = wp.zeros(1, dtype=wp.vec3)
            self.growth = pool.growth if scene.grows else wp.zeros(pool.size if scene.changes else 1, dtype=float)
            self.matter = wp.zeros(pool.size * MATTER // 4, dtype=wp.vec4)
            self.state = wp.zeros(pool.size * self.width // 4, dtype=wp.vec4)
            self.new_density = wp.zeros(pool.size, dtype=float)
            self.shift = wp.zeros(pool.size if scene.tensile else 1, dtype=wp.vec3)
            self.acceleration = wp.zeros(pool.size, dtype=wp.vec3)
            self.told = wp.zeros(pool.size * told_of(scene.tensile) // 4 if self.settles else 1, dtype=wp.vec4)
        self.neighbours = neighbours_of(scene, pool, self.backend, 2.0 * self.num.h, config.skin * self.num.h)
        self.tool = None if scene.outline is None else tool_of(scene, 2.0 * self.num.h, weights(self.num.h))
        self._bring_together()
        self.order = side_by_side(scene, pool)
        self.sort_bits = self.order.bits
        self.viscosity = None
        if self.implicit:
            support, tolerance = 2.0 * self.num.h, config.viscous_tolerance
            self.viscosity = ImplicitViscosity(
                scene, pool, self.backend, self.neighbours, support, tolerance, tool=self.tool
            )

    def kernels_of(self, backend: str) -> SimpleNamespace:
        """The passes in a backend's language, compiled for this scene."""
        scene, variant = self.scene, (*self.variant, self.settles)
        if backend == "taichi":
            from . import kernels_taichi

            return kernels_taichi.passes(*variant)
        return kernels.passes(*variant, scene.outline is not None, scene.device.is_cpu)

    def _bring_together(self) -> None:
        """What the passes over pairs read and write, as they take it."""
        pool, scene = self.pool, self.scene
        self.straining, self.forcing, self.telling = Straining(), Forcing(), Settling()
        for data in (self.straining, self.forcing):
            data.dt, data.new_density = scene.dt, self.new_density
        self.straining.shift = self.shift
        for data in (self.straining, self.forcing, self.telling):
            data.phases, data.phase_of = scene.phases, pool.phase
            if self.tool is not None:
                data.tool = self.tool
        self.straining.held, self.straining.fault, self.straining.state = pool.held, pool.fault, self.state
        self.straining.carried_gradient = pool.carried_gradient
        self.straining.flowing = pool.flowing
        self.straining.growth = self.growth
        self.straining.plastic = plastic_strains(scene, pool)
        for name, array in zip(STRAINS, self._strains(), strict=True):
            setattr(self.straining, name, array)
        self.telling.held, self.telling.mass, self.telling.density = pool.held, pool.mass, pool.density
        self.telling.told, self.telling.flowing = self.told, pool.flowing
        self.telling.position = pool.position
        self.forcing.forces, self.forcing.acceleration = scene.force, self.acceleration

    def _strains(self) -> list[wp.array]:
        """Fields of what has strength; stand-ins where nothing has."""
        return [self.pool.fields[name] if self.scene.elastic else self.unused for name in STRAINS]

    def _rest_densities(self) -> None:
        """Every slot starts at its world's rest density."""
        rest = np.repeat([s.material.density for s in self.scene.scenarios], self.pool.capacity)
        self.pool.density.assign(rest.astype(np.float32))

    def refresh(self) -> None:
        self.neighbours.refresh()

    def substep(self) -> None:
        if self.scene.grows:
            self.swell()
        for name in self.passes:
            getattr(self, name)()

    def swell(self) -> None:
        pool = self.pool
        self.scene.crew.launch(
            aging.swell,
            pool.size,
            [pool.capacity, pool.count, self.scene.dt, pool.growth],
            [pool.volume],
        )

    def harden(self, due: wp.array) -> None:
        pool, elastic = self.pool, self.scene.elastic
        self.scene.crew.launch(
            aging.harden_at_density,
            pool.size,
            [int(elastic), pool.capacity, pool.count, self.scene.phases, due, pool.mass, pool.density],
            [pool.phase, pool.volume, *self._strains()],
        )

    def lists(self) -> None:
        self.neighbours.update()

    def pack(self) -> None:
        pool = self.pool
        self.backend.launch(
            self.kernels.pack,
            pool.size,
            [
                pool.capacity,
                pool.count,
                pool.position,
                pool.velocity,
                pool.mass,
                pool.volume,
                pool.density,
                pool.carried_gradient,
            ],
            [self.matter],
        )

    def _over_pairs(self, kernel: Any, rows: wp.array, data: Any) -> None:
        lists = self.neighbours
        common = [self.num, self.scene.box, lists.lists, self.pool.capacity, self.pool.count]
        self.backend.launch(kernel, lists.work, [*common, rows, data])

    def strain(self) -> None:
        self._over_pairs(self.kernels.strain, self.matter, self.straining)

    def arrange(self, turn: int) -> None:
        self.lists()
        self.pack()
        self._over_pairs(self.kernels.tell, self.matter, self.telling)
        self._over_pairs(self.kernels.settle, self.told, self.telling)
        self._keep_out()

    def force(self) -> None:
        self._over_pairs(self.kernels.force, self.state, self.forcing)

    def drag(self) -> None:
        if self.viscosity is not None:
            self.viscosity.solve(self.acceleration, self.acceleration, impulse=False)

    def move(self) -> None:
        pool, scene = self.pool, self.scene
        self.backend.launch(
            self.kernels.move,
            pool.size,
            [
                scene.box,
                scene.spacing,
                pool.capacity,
                pool.count,
                scene.dt,
                scene.phases,
                pool.phase,
                scene.force,
                pool.held,
                pool.mass,
                pool.volume,
                self.acceleration,
                int(scene.tensile),
                self.new_density,
                self.shift,
            ],
            [pool.position, pool.velocity, pool.density, pool.carried_gradient, pool.fault],
        )
        self._keep_out()

    def _keep_out(self) -> None:
        """Of the rigid body."""
        pool = self.pool
        if self.tool is not None:
            inputs = [self.tool, pool.capacity, pool.count, pool.held]
            self.backend.launch(self.kernels.keep_out, pool.size, inputs, [pool.position])

    def prepare(self) -> None:
        if self.scene.changes:
            self.scene.crew.load(aging)
        self.neighbours.prepare()
        self.order.prepare()
        self.backend.prepare(self)

    def carried(self) -> dict[str, Any]:
        return self.neighbours.carried() | carried_by(self.viscosity)

    def sort_keys(self) -> Any:
        return self.order.keys()

    def solves(self) -> dict[str, float]:
        return effort_of(self.viscosity)

    def densities(self) -> np.ndarray:
        return self.pool.density.numpy()

    def pressures(self) -> np.ndarray:
        return pressures(self.scene, self.pool, self.densities())

    def shear_stresses(self) -> np.ndarray | None:
        return shear_stress(self.scene, self.pool)

    def traffic(self) -> dict[str, float]:
        return self.neighbours.traffic([MATTER, self.width])

    def footprint(self) -> dict[str, int]:
        own = {name: getattr(self, name).capacity for name in self.OWN}
        return own | self.neighbours.footprint() | footprint_of(self.viscosity) | table_of(self.tool)
