"""Position-based dynamics: allocation and the order of passes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import FRICTION, Scene

from .. import aging
from ..backends import backend_of
from ..conjugate import carried_by, effort_of, footprint_of
from ..neighbours import neighbours_of, side_by_side
from ..readout import present_density
from ..smoothing import cusp, spiky_slope
from ..tool import table_of, tool_of
from ..tool_map import Weights
from ..viscosity import ImplicitViscosity, beside
from . import kernels_warp as kernels
from .constraints_warp import Constraining
from .elasticity import Elasticity
from .numbers import MOVING, PLACE, PULLING, SETTLED, numbers_of, push_row
from .surroundings import Surroundings
from .traits import TraitsPBD

INSTANT = 1e-6  # s/m: in so little time, over a spacing, nothing falls, flows or is drawn together
SETTLING_PLACED, SETTLING_BORN = 30, 10  # iterations; 30 after births change no volume by 1 %


def weights(support: float) -> Weights:
    """Of what the passes sum over partners: grad W, viscous drag, and the density; support [m]."""
    return Weights(lambda r: spiky_slope(r, support) / r, **beside(support), level=lambda r: cusp(r, support))


class SolverPBD(TraitsPBD):
    """Position-based fluids: density constraints, and the common law's stress and viscosity, implicit in time."""

    passes = (
        "predict",
        "lists",
        "multipliers",
        "correct",
        "apply",
        "velocities",
        "drag",
        "wall_friction",
        "follow",
        "pack",
        "surround",
        "strain",
        "pull",
    )

    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        self.scene, self.pool, self.config = scene, pool, config
        self.drawn = scene.tensile
        self.backend = backend_of(backend, scene, threads)
        self.kernels = self.kernels_of(backend)
        self.num = numbers_of(config, scene.spacing, scene.scenario.material)
        self.settling = numbers_of(config, scene.spacing, scene.scenario.material)
        self.settling.slack *= SETTLED
        self.wall_friction_acts = FRICTION in (*scene.box.lower_kind, *scene.box.upper_kind)
        with wp.ScopedDevice(scene.device):
            self.motion = wp.zeros(pool.size, dtype=wp.vec3)
            self.correction = wp.zeros(pool.size, dtype=wp.vec3)
            self.still = wp.zeros(pool.size, dtype=wp.vec3)
            self.spans = wp.zeros_like(scene.dt)
            self.fill = wp.ones(pool.size, dtype=float)
            self.places = wp.zeros(pool.size * PLACE // 4, dtype=wp.vec4)
            self.pushes = wp.zeros(pool.size * push_row(self.drawn) // 4, dtype=wp.vec4)
        skin = config.skin * scene.spacing
        self.neighbours = neighbours_of(scene, pool, self.backend, self.num.support, skin)
        self.constraining = Constraining()
        self.constraining.dt, self.constraining.phases = scene.dt, scene.phases
        self.constraining.phase_of = pool.phase
        self.constraining.held, self.constraining.mass = pool.held, pool.mass
        self.constraining.correction = self.correction
        self.constraining.motion = self.motion
        self.constraining.pushes, self.constraining.fill = self.pushes, self.fill
        self.around = Surroundings(scene, pool) if self.drawn else None
        self.elastic = None
        if self.around is None:
            nothing = wp.zeros(1, dtype=float, device=scene.device)
            self.constraining.bias = self.constraining.enclosure = self.constraining.lack = nothing
            self.constraining.fabric_normal = self.constraining.fabric_shear = self.still[:1]
        else:
            self.around.hand_to(self.constraining)
            self.constraining.lack = self.around.lack
            if scene.elastic:
                self.elastic = Elasticity(scene, pool, self.around)
        self.tool = None if scene.outline is None else tool_of(scene, self.num.support, weights(self.num.support))
        if self.tool is not None:
            self.constraining.tool = self.tool
            if self.around is not None:
                self.around.data.tool = self.tool
            if self.elastic is not None:
                self.elastic.straining.tool = self.tool
        self.order = side_by_side(scene, pool)
        self.sort_bits = self.order.bits
        self.viscosity = None
        if scene.viscous or self.elastic is not None:
            support, tolerance = self.num.support, config.viscous_tolerance
            kept = None if self.elastic is None else self.elastic.kept
            self.viscosity = ImplicitViscosity(
                scene, pool, self.backend, self.neighbours, support, tolerance, kept, self.tool
            )

    def kernels_of(self, backend: str) -> SimpleNamespace:
        """The passes in a backend's language."""
        if backend == "taichi":
            from . import kernels_taichi

            return kernels_taichi.passes(self.scene.elastic, self.drawn)
        scene = self.scene
        return kernels.passes(scene.elastic, self.drawn, scene.outline is not None, scene.device.is_cpu)

    def refresh(self) -> None:
        self.neighbours.refresh()

    def substep(self) -> None:
        if self.scene.grows:
            self.swell()
        self.predict()
        self.lists()
        self.constrain(self.num, self.config.iterations)
        self.velocities()
        if self.viscosity is not None:
            self.drag()
        if self.wall_friction_acts:
            self.wall_friction()
        if self.viscosity is not None:
            self.follow()
        if self.around is not None:
            self.pack()
            if self.elastic is None:
                self.surround()
            else:
                self.strain()
                self.pull()

    def constrain(self, num: Any, iterations: int) -> None:
        for _ in range(iterations):
            self.multipliers(num)
            self.correct()
            self.apply()

    def make_room(self, placed: bool) -> None:
        """What was born or placed where others are is moved apart in no time: pushed in a substep it would be flung
        (the pre-stabilisation of Macklin et al. 2014). All worlds of a batch are pressed, those without offspring by
        what little their density is off."""
        scene = self.scene
        self.refresh()
        scene.crew.alone(lambda: wp.copy(self.spans, scene.dt))
        scene.crew.alone(lambda: scene.dt.fill_(INSTANT * scene.spacing))
        for _ in range(SETTLING_PLACED if placed else SETTLING_BORN):
            self.predict()
            self.lists()  # what moves far in one iteration has other neighbours in the next
            self.constrain(self.settling, 1)
        scene.crew.alone(lambda: wp.copy(scene.dt, self.spans))
        self.refresh()

    def _launch(self, kernel: Any, inputs: list[Any], outputs: list[Any]) -> None:
        self.backend.launch(kernel, self.pool.size, inputs, outputs)

    def _active(self) -> list[Any]:
        return [self.pool.capacity, self.pool.count]

    def swell(self) -> None:
        pool, scene = self.pool, self.scene
        if self.elastic is None:
            inputs = [*self._active(), scene.dt, pool.growth]
            scene.crew.launch(aging.swell, pool.size, inputs, [pool.volume])
        else:
            inputs = [*self._active(), scene.dt, scene.phases, pool.phase, pool.growth]
            scene.crew.launch(aging.swell_by_phase, pool.size, inputs, [pool.volume, pool.volume_ratio])

    def harden(self, due: wp.array) -> None:
        pool, crew = self.pool, self.scene.crew
        if self.elastic is None:
            crew.launch(aging.harden, pool.size, [*self._active(), due], [pool.phase])
        else:
            inputs = [*self._active(), self.scene.phases, due]
            crew.launch(aging.relieve_off_linear, pool.size, [*inputs, pool.phase], [pool.off_linear])
            state = [pool.volume, pool.volume_ratio, pool.elastic_normal, pool.elastic_shear]
            crew.launch(aging.harden_at_ratio, pool.size, inputs, [pool.phase, *state])

    def predict(self) -> None:
        pool, scene = self.pool, self.scene
        pulled = self.still if self.elastic is None else pool.pulled
        matter = [pool.velocity, pool.volume]
        self._launch(
            self.kernels.predict,
            [self.num, scene.box, *self._active(), scene.dt, scene.force, pool.held, *matter, pulled],
            [pool.position, self.motion, self.places, pool.fault],
        )
        self.keep_out()

    def keep_out(self) -> None:
        pool = self.pool
        if self.tool is not None:
            outputs = [pool.position, self.motion, self.places]
            self._launch(self.kernels.keep_out, [self.tool, *self._active(), pool.held, pool.volume], outputs)

    def lists(self) -> None:
        self.neighbours.update()

    def _over_pairs(self, kernel: Any, rows: wp.array, data: Any, num: Any = None) -> None:
        lists = self.neighbours
        common = [num or self.num, self.scene.box, lists.lists, *self._active()]
        self.backend.launch(kernel, lists.work, [*common, rows, data])

    def multipliers(self, num: Any = None) -> None:
        self._over_pairs(self.kernels.multipliers, self.places, self.constraining, num)

    def correct(self) -> None:
        self._over_pairs(self.kernels.correct, self.pushes, self.constraining)

    def apply(self) -> None:
        pool = self.pool
        self._launch(
            self.kernels.apply,
            [self.num, self.scene.box, *self._active(), pool.held, self.correction, pool.volume],
            [pool.position, self.motion, self.places, pool.fault],
        )
        self.keep_out()

    def velocities(self) -> None:
        pool = self.pool
        self._launch(
            self.kernels.velocities,
            [*self._active(), self.scene.dt, pool.held, self.motion],
            [pool.velocity],
        )

    def drag(self) -> None:
        assert self.viscosity is not None
        self.viscosity.solve(self.still, self.pool.velocity, impulse=True)

    def follow(self) -> None:
        pool, scene = self.pool, self.scene
        inputs = [self.num, scene.box, *self._active(), scene.dt, pool.held, pool.drag]
        self._launch(self.kernels.follow, inputs, [pool.position])
        self.keep_out()

    def pack(self) -> None:
        assert self.around is not None
        pool = self.pool
        inputs = [*self._active(), pool.position, pool.volume, pool.velocity, pool.overread]
        self._launch(self.kernels.pack, inputs, [self.around.moving])

    def surround(self) -> None:
        assert self.around is not None
        self._over_pairs(self.kernels.surround, self.around.moving, self.around.data)

    def strain(self) -> None:
        assert self.elastic is not None and self.around is not None
        self._over_pairs(self.kernels.strain, self.around.moving, self.elastic.straining)

    def pull(self) -> None:
        assert self.elastic is not None
        self._over_pairs(self.kernels.pull, self.elastic.pulling, self.elastic.straining)

    def wall_friction(self) -> None:
        pool, scene = self.pool, self.scene
        self._launch(
            self.kernels.wall_friction,
            [
                scene.box,
                *self._active(),
                scene.dt,
                pool.held,
                scene.spacing,
                scene.force,
                pool.position,
            ],
            [pool.velocity],
        )

    def prepare(self) -> None:
        if self.scene.changes:
            self.scene.crew.load(aging)
        self.neighbours.prepare()
        self.order.prepare()
        self.backend.prepare(self)

    def carried(self) -> dict[str, Any]:
        return {"fill": self.fill, **self.neighbours.carried(), **carried_by(self.viscosity)}

    def sort_keys(self) -> Any:
        return self.order.keys()

    def solves(self) -> dict[str, float]:
        return effort_of(self.viscosity)

    def densities(self) -> np.ndarray:
        return present_density(self.pool, 1.0 / np.maximum(self.fill.numpy(), 1.0))

    def traffic(self) -> dict[str, float]:
        """Implicit viscosity left out."""
        rows = [PLACE, push_row(self.drawn)] * self.config.iterations + [MOVING] * self.drawn
        return self.neighbours.traffic(rows + [PULLING] * self.scene.elastic)

    def footprint(self) -> dict[str, int]:
        own = ("motion", "correction", "still", "fill", "places", "pushes")
        bytes_of = {name: getattr(self, name).capacity for name in own} | self.neighbours.footprint()
        for part in (self.around, self.elastic):
            bytes_of |= {} if part is None else part.footprint()
        return bytes_of | footprint_of(self.viscosity) | table_of(self.tool)
