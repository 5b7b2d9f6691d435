"""The material point method: allocation and the order of passes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from fluidbench.native.crew import put
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .. import aging
from ..backends import backend_of
from ..conjugate import carried_by, effort_of, footprint_of
from ..constitutive import STRETCHED
from ..flow import plastic_strains
from ..order import CellOrder
from ..readout import present_density, pressures, shear_stress
from . import kernels_warp as kernels
from .bounds import kept
from .by_block import ByBlock
from .chain import Chain
from .clamp import Clamps
from .gaps import Gaps
from .grid import grid_of
from .implicit import GridViscosity
from .keeping import Keeping
from .particle import EXPLICIT, IMPLICIT, PRESSED
from .piston import piston_of
from .release import Release
from .separation import EVERY, Separation
from .settling import TURNS, Settling
from .tool import Held
from .traits import TraitsMPM

NODE: Any = wp.vec4  # momentum and mass of a grid node


class SolverMPM(TraitsMPM):
    """MLS-MPM with APIC transfers, quadratic B-splines, symplectic Euler, on a block-sparse grid."""

    passes = ("clear_grid", "p2g", "grid_step", "g2p")

    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        self.scene, self.pool, self.config = scene, pool, config
        self.backend = backend_of(backend, scene, threads)
        self.alone = scene.device.is_cpu and threads == 1
        self.kernels = self.kernels_of(backend)
        self.grid = grid_of(scene, config.grid_ratio * scene.spacing)
        self.shifting = 0.0 if scene.expands else config.shifting  # mass does not tell how full a node is, then
        blocks = self.grid.blocks_per_world * scene.worlds
        slots = min(blocks, 512 + int(config.blocks_per_particle * pool.size))
        implicit = scene.viscous and config.viscosity == "implicit"
        pool.add_field("affine", wp.mat33)
        pool.add_field("volume_ratio", float, 1.0, within=(1.0 / STRETCHED, STRETCHED))
        pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0), within=(1.0 / STRETCHED, STRETCHED))
        pool.add_field("elastic_shear", wp.vec3)
        self.strains = [pool.volume_ratio, pool.elastic_normal, pool.elastic_shear, plastic_strains(scene, pool)]
        with wp.ScopedDevice(scene.device):
            self.table = wp.zeros(blocks, dtype=int)
            self.block_of = wp.zeros(slots, dtype=int)
            self.active = wp.zeros(1, dtype=int)
            self.blocks = self.table, self.block_of, self.active
            self.raw = wp.zeros(slots * 64, dtype=NODE)
            self.moving = wp.empty(slots * 64, dtype=NODE)
            self.nothing = wp.zeros(1, dtype=NODE)  # for the grid to empty where no other nodes are to be
        self.started = False
        # particles of one cell share their 27 nodes
        self.order = CellOrder(scene, pool, np.array(self.grid.dx), shift=np.where(scene.periodic, 0.5, 0.0))
        self.sort_bits = self.order.bits
        self.by_block = (
            ByBlock(scene, pool, self.strains, slots, implicit) if scene.device.is_cpu and backend == "warp" else None
        )
        many = min(scene.lanes, slots * 64, max(pool.size, 1024))  # nodes are fewer than particles
        self.node_lanes = scene.crew.threads if scene.device.is_cpu else many
        self.held = None
        if scene.outline is not None:
            self.held = Held(scene, pool, self.grid, slots, self.node_lanes, self.strains[-1], self.shifting)
        clamps = any(body.clamped for scenario in scene.scenarios for body in scenario.bodies)
        self.clamps = Clamps(scene, pool, self.grid) if clamps else None
        self.viscosity = GridViscosity(self, config.viscous_tolerance) if implicit else None
        apart = config.separation > 0.0
        self.separation = Separation(scene, pool, self.grid, self.strains[-1], config.separation) if apart else None
        settles = config.shifting > 0.0 and self.held is None and scene.flows
        rate = TURNS * EVERY * config.shifting
        self.settling = Settling(scene, pool, self.grid, self.strains[-1], rate) if settles else None
        meets = any(scenario.emits or len(scenario.bodies) > 1 for scenario in scene.scenarios)
        told = not (implicit or scene.expands)  # whose push is whose, and by its mass how full a node is
        tool = None if self.held is None else self.held.tool
        self.together = kept(scene.scenario, config)
        self.gaps = None
        if meets and told:
            self.gaps = Gaps(scene, pool, self.grid, slots, self.node_lanes, tool, self.together > 1)
        self.arranges, self.turns = EVERY if apart or settles else 0, TURNS
        fed = scene.scenario.emits and self.held is None
        self.release = Release(scene, pool, self.grid) if fed else None
        self.keeping = Keeping(self) if self.together > 1 else None
        with wp.ScopedDevice(scene.device):
            self.bent = wp.zeros(1, dtype=wp.mat33) if self.keeping is None else self.keeping.bent
        firm = implicit or self.held is not None or self.keeping is not None
        self.piston = piston_of(scene, self.grid.dx, firm)
        self.unmoved = piston_of(scene, self.grid.dx, still=True)
        between = meets or scene.grows or clamps or implicit or self.held is not None  # what a chain leaves out
        self.chain = Chain(self) if not (between or scene.device.is_cpu or backend != "warp") else None

    def kernels_of(self, backend: str) -> SimpleNamespace:
        """The passes in a backend's language, compiled for this scene."""
        if backend == "taichi":
            from . import kernels_taichi

            return kernels_taichi.passes(self.alone)
        return kernels.passes()

    def refresh(self) -> None:
        pool, scene = self.pool, self.scene
        if self.chain is not None:
            self.chain.refresh()
        self._launch("reset_blocks", self.node_lanes, [self.table, self.block_of, self.active, self.node_lanes])
        scene.crew.launch(put, 1, [0, self.active])
        self._launch(
            "find_blocks",
            pool.size,
            [self.grid, pool.capacity, pool.count, pool.position],
            [self.table, self.block_of, self.active, pool.fault],
        )
        if self.by_block is not None:
            self.by_block.refresh()
        if self.gaps is not None:
            self.gaps.refresh()
        if not self.started:
            self._start_affine()

    def _launch(self, name: str, size: int, inputs: list[Any], outputs: list[Any] = []) -> None:  # noqa: B006
        self.backend.launch(getattr(self.kernels, name), size, inputs, outputs)

    def _start_affine(self) -> None:
        """Gather the affine field of the initial velocities: from zero, the first step would be a lossy PIC step.

        At dt = 0, which the scene has until its first plan, the passes change nothing but `affine` and the velocity.
        """
        self.started = True
        velocity = wp.clone(self.pool.velocity)
        for name in self.passes:
            getattr(self, name)()
        self.backend.wait()
        wp.copy(self.pool.velocity, velocity)

    def arrange(self, turn: int) -> None:
        if self.separation is not None:
            homes = None if self.by_block is None else self.by_block.homes
            self.separation.part(self.table, self.block_of, self.active, self.raw, self.node_lanes, homes)
        if self.settling is not None and turn == TURNS - 1:
            self.settling.settle(self.table, self.active, self.raw, self.node_lanes)

    def substep(self) -> None:
        if self.scene.grows:
            self.swell()
        for name in self.passes:
            getattr(self, name)()

    def portion(self, substeps: int) -> int:
        """A cycle of keeping.py: two a tick at least, for with one what was laid crept on."""
        return min(self.together, max(substeps - 1, 1))

    def substeps(self, number: int, portion: int) -> None:
        if self.keeping is not None:
            self.keeping.go(number, portion)
        elif self.chain is not None:
            self.chain.go(number)
        else:
            super().substeps(number, portion)

    def swell(self) -> None:
        pool = self.pool
        self.scene.crew.launch(
            aging.swell_at_volume,
            pool.size,
            [pool.capacity, pool.count, self.scene.dt, pool.growth],
            [pool.volume, pool.volume_ratio],
        )

    def harden(self, due: wp.array) -> None:
        pool = self.pool
        self.scene.crew.launch(
            aging.harden_at_ratio,
            pool.size,
            [pool.capacity, pool.count, self.scene.phases, due],
            [pool.phase, pool.volume, pool.volume_ratio, pool.elastic_normal, pool.elastic_shear],
        )

    def clear_grid(self) -> None:
        self.empty(self.raw)

    def empty(self, nodes: wp.array) -> None:
        self._launch("clear_grid", self.node_lanes, [self.active, self.node_lanes], [nodes])

    def p2g(self) -> None:
        self.scatter(self.scene.dt, self.raw)

    def scatter(self, dt: wp.array, raw: wp.array) -> None:
        """Strain and stress within dt, momentum and mass to nodes that are empty."""
        drags = int(EXPLICIT if self.held is None else PRESSED) if self.viscosity is None else int(IMPLICIT)
        self.give(dt, drags, raw)
        if self.clamps is not None:
            self.clamps.hold(self.table, raw)
        if self.gaps is not None:
            self.gaps.look(*self.blocks, raw, self.piston)
        if self.held is not None:
            self.press(dt, raw)
            self.held.tied.give(dt, self.blocks, raw)

    def press(self, dt: wp.array, raw: wp.array) -> None:
        """Pressure of what is elastic beside a body, which pushes by way of nodes."""
        assert self.held is not None
        dilation = self.held.dilation
        if dilation is not None:
            self.empty(dilation.nodes)
            dilation.press(dt, self.blocks, None if self.gaps is None else self.gaps.known.gap, raw)

    def give(self, dt: wp.array, drags: int, raw: wp.array, anew: float = 1.0) -> None:
        """The same, of particles themselves; or strain and stress alone, to nodes that have momenta and masses."""
        pool, scene = self.pool, self.scene
        if self.by_block is not None:
            self.by_block.p2g(self.grid, self.table, self.block_of, self.active, dt, drags, anew, self.bent, raw)
            return
        self._launch(
            "p2g",
            pool.size,
            [
                self.grid,
                pool.capacity,
                pool.count,
                dt,
                drags,
                anew,
                scene.phases,
                pool.position,
                pool.velocity,
                pool.affine,
                pool.mass,
                pool.volume,
                pool.phase,
                pool.held,
                self.bent,
                self.table,
            ],
            [*self.strains, raw, pool.fault],
        )

    def grid_step(self) -> None:
        self.walled(self.raw, self.scene.force, self.piston, self.moving)
        if self.held is not None:
            self.held.tied.trail(self.blocks, self.moving)
        if self.viscosity is not None:
            self.viscosity.solve()

    def walled(
        self, raw: wp.array, force: wp.array, piston: Any, moving: wp.array, spent: wp.array | None = None
    ) -> None:
        """Velocities of nodes from their momenta and masses, a force for dt, a piston and walls; empties `spent`."""
        lanes = [self.grid, self.node_lanes, self.active, self.block_of, self.table]
        spent = self.nothing if spent is None else spent
        self._launch("grid_step", self.node_lanes, [*lanes, raw, self.scene.dt, force, piston], [moving, spent])

    def resist(self, nodes: wp.array, image: wp.array) -> None:
        """What viscosity resists the velocities of nodes with, added to momenta: dt A v of implicit.py."""
        pool, scene = self.pool, self.scene
        if self.by_block is not None:
            self.by_block.resist(self.grid, self.table, self.block_of, self.active, nodes, image)
            return
        assert self.viscosity is not None
        matter = [pool.phase, pool.position, pool.volume, pool.volume_ratio]
        self.backend.launch(
            self.viscosity.kernels.resist,
            pool.size,
            [self.grid, pool.capacity, pool.count, scene.dt, scene.phases, *matter, self.table, nodes],
            [image],
        )

    def g2p(self) -> None:
        self.take(0, 1, 1.0)

    def take(self, number: int, over: int, moves: float) -> None:
        """Velocities and their gradients to particles, which move (1) or stay (0), in the number-th substep of a cycle,
        from 0 on; so many are `over` with it."""
        if self.held is not None:
            self.empty(self.held.nodes)
            if self.held.dilation is not None:
                self.held.dilation.tell(self.blocks, self.moving)
            self.held.level(self.table, self.piston, self.moving)
        homes = None if self.by_block is None else self.by_block.homes
        if self.gaps is not None:
            self.gaps.keep(self.table, self.moving, number, self.bent)
        self.gather(over, moves)
        if self.release is not None:
            self.release.go_on(self.table, self.moving)
        if self.gaps is not None:
            self.gaps.go_on(moves, over, *self.blocks, homes)
        if self.held is not None:
            self.held.keep_out(self.blocks, homes)

    def gather(self, over: int, moves: float) -> None:
        """Crowds part once in a cycle, for all substeps that are `over`, but not farther than in one."""
        pool, scene = self.pool, self.scene
        shifting = self.shifting * over
        if self.by_block is not None:
            self.by_block.g2p(self.grid, moves, self.moving, shifting, *self.blocks)
            return
        self._launch(
            "g2p",
            pool.size,
            [
                self.grid,
                pool.capacity,
                pool.count,
                scene.dt,
                moves,
                self.moving,
                scene.phases,
                pool.phase,
                pool.held,
                shifting,
            ],
            [
                pool.position,
                pool.velocity,
                pool.affine,
                pool.volume_ratio,
                self.table,
                self.block_of,
                self.active,
                pool.fault,
            ],
        )

    def prepare(self) -> None:
        if self.scene.changes:
            self.scene.crew.load(aging)
        self.order.prepare()
        for part in (self.clamps, self.separation, self.settling, self.gaps, self.release, self.keeping, self.chain):
            if part is not None:
                part.prepare()
        self.backend.prepare(self)
        if self.by_block is not None:
            self.by_block.prepare()
        self.started = False

    def resume(self) -> None:
        """The blocks of the grid are found anew; the affine field is that of the checkpoint."""
        self.started, self.pool.stale = True, True

    def carried(self) -> dict[str, Any]:
        return carried_by(self.viscosity)

    def solves(self) -> dict[str, float]:
        return effort_of(self.viscosity)

    def sort_keys(self) -> Any:
        return self.order.keys()

    def densities(self) -> np.ndarray:
        return present_density(self.pool, self.pool.volume_ratio.numpy())

    def spins(self) -> np.ndarray:
        """m times the antisymmetric part of C D, D = diag(dx^2) / 4 (Jiang et al. 2015)."""
        c = self.pool.affine.numpy() * (0.25 * np.array(self.grid.dx) ** 2)
        turn = np.stack([c[:, 2, 1] - c[:, 1, 2], c[:, 0, 2] - c[:, 2, 0], c[:, 1, 0] - c[:, 0, 1]], axis=1)
        return self.pool.mass.numpy()[:, None] * turn

    def pressures(self) -> np.ndarray:
        return pressures(self.scene, self.pool, self.densities())

    def shear_stresses(self) -> np.ndarray | None:
        return shear_stress(self.scene, self.pool)

    def traffic(self) -> dict[str, float]:
        """A particle's 27 nodes, added to and read again; nodes in use emptied, written, read, written and read."""
        node = 16.0
        nodes = 64.0 * float((self.table.numpy() > 0).sum())
        return {"memory": 5.0 * node * nodes, "cache": 2.0 * 27.0 * node * sum(self.pool.counts)}

    def footprint(self) -> dict[str, int]:
        names = ("table", "block_of", "raw", "moving")
        more = {} if self.by_block is None else self.by_block.footprint()
        more |= {} if self.held is None else self.held.footprint()
        more |= {} if self.separation is None else self.separation.footprint()
        more |= {} if self.gaps is None else self.gaps.footprint()
        more |= {} if self.keeping is None else self.keeping.footprint()
        more |= {} if self.chain is None else self.chain.footprint()
        return {name: getattr(self, name).capacity for name in names} | more | footprint_of(self.viscosity)
