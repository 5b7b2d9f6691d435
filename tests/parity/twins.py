"""The same simulation in both languages, run pass by pass from one state."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.method.target import BACKENDS, Target
from fluidbench.native.scene import PERIODIC
from fluidbench.native.simulation import Simulation
from fluidbench.scenario import Scenario
from solvers.images import INDEX_BITS, INDEX_MASK
from solvers.pbd.numbers import distances
from solvers.smoothing import drag_weight

TOLERANCE = 2e-5  # float32; sums may be taken in another order
GRID = ("raw", "moving")
BY_CHANCE = ("table", "block_of")  # in the order in which threads come, on a GPU
GARBAGE = 1.0e6  # in slots that nobody may touch
# Each language has its own lists, and makes them when it needs them.
OWN_LISTS = tuple(f"neighbours.{name}" for name in ("entries", "number", "inside", "listed", "skin"))
PARTS = (("neighbours.", "neighbours"), ("", "around"), ("", "elastic"))  # of a solver that hold arrays
# Rows that neighbours are asked for: which of their floats are one quantity, and judged by its size.
PLACE, VELOCITY = [(0, 3), (3, 4)], (4, 7)
ROWS = {
    "matter": [*PLACE, VELOCITY, (7, 8), (8, 11), (11, 12)],
    "places": PLACE,
    "moving": [*PLACE, VELOCITY, (7, 8)],
    "pulling": [*PLACE, (4, 13), (13, 16)],
}
PUSHES = [*PLACE, (4, 7), (7, 8)]
TOLD = [*PLACE, (4, 5), (5, 8)]
BY_WIDTH = {
    "told": {8: TOLD, 12: [*TOLD, (8, 11)]},
    "pushes": {12: [*PUSHES, (8, 9)], 16: [*PUSHES, (8, 14), (14, 15), (15, 16)]},
}


def state_rows(strength: bool, tensile: bool, width: int) -> list[tuple[int, int]]:
    """Of SPH's force: pressure or stress, what pulls back, and scalars up to the `width`."""
    vectors = [(7, 16), (16, 19)] if strength else [(7, 16)] if tensile else []
    scalars = 19 if strength else 16 if tensile else 7
    return [*PLACE, VELOCITY, *vectors, *((k, k + 1) for k in range(scalars, width))]


class Difference(AssertionError):
    """A pass whose results differ: says which, in what, and by how much."""


def arrays_of(sim: Simulation) -> dict[str, wp.array]:
    """Everything on the device that passes read or write, by name."""
    found = {f"pool.{name}": array for name, array in sim.pool.fields.items()}
    found |= {"pool.count": sim.pool.count, "pool.fault": sim.pool.fault}
    found |= {name: getattr(sim.scene, name) for name in ("dt", "force", "phases")}
    found |= {f"hours.{name}": getattr(sim.scene.clock.hours, name) for name in ("row", "exit", "drift", "feeding")}
    parts = [("", sim.solver), *((prefix, getattr(sim.solver, name, None)) for prefix, name in PARTS)]
    for prefix, owner in parts:
        for name, value in vars(owner).items() if owner is not None else ():
            if isinstance(value, wp.array):
                found[prefix + name] = value
    return found


class Twins:
    """A scenario through one method, in Warp and in Taichi."""

    def __init__(
        self, worlds: Scenario | list[Scenario], method: str, ticks: int, device: str = "cpu", threads: int = 1
    ) -> None:
        targets = [Target(device, backend, threads) for backend in BACKENDS]
        self.warp, self.taichi = (Simulation(worlds, method, target, graphs=False) for target in targets)
        self.method = method
        if method != "mpm":  # Taichi's lists are as wide as may be
            self.warp.solver.neighbours.thinnest = self.warp.solver.neighbours.widest
        for sim in (self.warp, self.taichi):
            sim.prepare()
        for _ in range(ticks):
            self.warp.advance_tick()
        self.taichi.pool.counts = list(self.warp.pool.counts)
        for name in ("row", "exit"):  # where the nozzle is
            wp.copy(getattr(self.taichi.scene.clock.hours, name), getattr(self.warp.scene.clock.hours, name))
        self.taichi.solver.started = True  # MPM gathers the affine field of its first state once
        self.ours, self.theirs = arrays_of(self.warp), arrays_of(self.taichi)
        self.shared = [name for name in self.ours if name in self.theirs and name not in OWN_LISTS]
        for name in ("raw", "moving"):  # scratch that begins as it was found
            if name in self.ours:
                self.ours[name].zero_()
        self.least = self._least_scales()
        self.warp.solver.refresh()  # lists are each language's own: both make them
        self.equalise()

    def _least_scales(self) -> dict[str, float]:
        """Of what is made of numbers that cancel: SPH's shifts of crowding of order 1 / h, PBD's multipliers of
        densities of order 1 and what disorder adds to them, its stress of elastic tensors of order 1, what pulls back
        of motion against each other by the linear part of it, MPM's momenta of pushes on one of 27 nodes."""
        sim = self.warp
        if self.method == "sph":
            speed, dt = float(np.abs(sim.pool.velocity.numpy()).max()), float(sim.scene.dt.numpy()[0])
            shift = sim.solver.num.shifting * dt * speed / sim.scene.spacing * sim.solver.num.h
            return {"shift": shift} | ({} if sim.scene.tensile else {"state[8:11]": shift})
        if self.method == "mpm":
            dt, volume = float(sim.scene.dt.numpy()[0]), float(sim.pool.volume.numpy().max())
            squeezed = float(np.abs(sim.pool.volume_ratio.numpy() - 1.0).max())
            pressure = squeezed * float(sim.scene.phases.numpy()["bulk_modulus"].max())
            return {"raw": 4.0 * dt * volume * pressure / float(min(sim.solver.grid.dx)) / 27.0}
        stiffness = float(sim.scene.phases.numpy()["shear_modulus"].max())
        pushes = [f"pushes[{first}:{last}]" for first, last in ((8, 9), (8, 14), (14, 15), (15, 16))]
        fields = [f"pool.{name}" for name in ("overread", "bias", "lack", "fabric_shear")]
        num, speed = sim.solver.num, float(np.abs(sim.pool.velocity.numpy()).max())
        weights = sum(
            drag_weight(float(r) * num.spacing / num.support, num.support) for r in distances(num.support / num.spacing)
        )
        against = 2.0 * speed * float(sim.scene.dt.numpy()[0]) * weights * num.spacing**3
        held = {
            "pulling[4:13]": max(stiffness, 1e-30),
            "pulling[13:16]": max(stiffness * num.hourglass * against, 1e-30),
        }
        return dict.fromkeys(pushes + fields, 1.0) | held

    def equalise(self) -> None:
        """Give Taichi's twin the state of Warp's."""
        for name in self.shared:
            wp.copy(self.theirs[name], self.ours[name])

    def disturb(self, seed: int) -> None:
        """A random state: places, velocities, stresses, phases and holds that no run would bring about."""
        rng, apart, pool = np.random.default_rng(seed), np.random.default_rng([seed, 1]), self.warp.pool
        fields, spacing = pool.fields, self.warp.scene.spacing
        active = np.zeros(pool.size, bool)
        for world, count in enumerate(pool.counts):
            active[world * pool.capacity : world * pool.capacity + count] = True
        for name, array in fields.items():
            values = array.numpy().copy()
            if name == "position":
                values += (rng.uniform(-0.2, 0.2, values.shape) * spacing).astype(np.float32)
                low, high = np.asarray(self.warp.scene.box.lower), np.asarray(self.warp.scene.box.upper)
                values = np.clip(values, low + 0.25 * spacing, high - 0.25 * spacing).astype(np.float32)
            elif name == "velocity":
                values += rng.normal(0.0, 0.1, values.shape).astype(np.float32)
            elif name == "affine":
                values += rng.normal(0.0, 5.0, values.shape).astype(np.float32)
            elif name == "held":
                values = rng.choice([FREE, FREE, FREE, CARRIED, CLAMPED], values.shape).astype(np.int32)
            elif name == "phase":
                values = rng.integers(0, self.warp.scene.levels, values.shape).astype(np.int32)
            elif name in ("mass", "volume", "density", "volume_ratio"):
                values *= rng.uniform(0.97, 1.03, values.shape).astype(np.float32)
            elif name in ("elastic_normal", "elastic_shear"):
                values += rng.normal(0.0, 0.02, values.shape).astype(np.float32)
            elif name in ("fabric_normal", "fabric_shear"):
                values += apart.normal(0.0, 0.1, values.shape).astype(np.float32)
            elif name in ("overread", "bias", "lack"):
                values = apart.normal(0.0, 0.02, values.shape).astype(np.float32)
            elif name == "enclosure":
                values = apart.uniform(0.0, 1.0, values.shape).astype(np.float32)
            elif name == "kept":
                values = rng.uniform(0.0, 1.0, values.shape).astype(np.float32)
            if values.dtype.kind == "f":
                values[~active] = GARBAGE
            array.assign(values)
        self.warp.solver.refresh()
        self.equalise()

    def check(self) -> list[str]:
        """Run every pass that applies, in order, each from Warp's state; returns their names, raises Difference."""
        done = []
        for name, run in self._passes():
            for sim in (self.warp, self.taichi):
                run(sim.solver)
                sim.solver.backend.wait()
            for problem in self.differences(name):
                raise Difference(f"{self.method}.{name}: {problem}")
            self.equalise()
            done.append(name)
        return done

    def _passes(self) -> Iterator[tuple[str, Callable[[Any], None]]]:
        """The solver's passes and what else it launches, in the order in which they depend on each other."""
        solver = self.warp.solver
        if self.method == "mpm":
            yield "refresh", lambda solver: solver.refresh()
        skipped = set()
        if self.method == "pbd":
            skipped |= {"surround"} if solver.elastic is not None else {"strain", "pull"}
            skipped |= set() if solver.around is not None else {"pack", "surround"}
            skipped |= set() if solver.viscosity is not None else {"drag", "follow"}
        for name in self.warp.solver.passes:
            if name not in skipped:
                yield name, lambda solver, name=name: getattr(solver, name)()
        if self.method == "sph" and solver.arranges:
            yield "arrange", lambda solver: solver.arrange(0)

    def differences(self, after: str) -> Iterator[str]:
        """One sentence for every array that is not the same after a pass."""
        if after == "lists":
            yield from self._lists()
        by_chance = not self.warp.scene.device.is_cpu or self.taichi.target.threads > 1
        for name in self.shared:
            if name in BY_CHANCE and by_chance:
                continue
            a, b = self.ours[name].numpy(), self.theirs[name].numpy()
            if self.method != "mpm" and (name in ROWS or name in BY_WIDTH or name == "state"):
                yield from self._rows(name, a, b)
            elif self.method == "mpm" and name in GRID:
                yield from self._nodes(name, a, b)
            elif a.dtype.kind == "f":
                unused = np.abs(a) == GARBAGE
                if (a[unused] != b[unused]).any():
                    yield f"{name} is touched in unused slots"
                scale = max(float(np.abs(a[~unused]).max(initial=0.0)), self.least.get(name, 1e-30))
                scale = max(scale, self.least.get(f"{after}.{name}", 0.0))
                off = float(np.abs(a.astype(float) - b)[~unused].max(initial=0.0)) / scale
                if not off <= TOLERANCE:
                    yield f"{name} differs by {off:.2g} of its largest value"
            elif a.dtype.kind in "iu" and (a != b).any():
                yield f"{name} differs in {int((a != b).sum())} places"

    def _nodes(self, name: str, a: np.ndarray, b: np.ndarray) -> Iterator[str]:
        """Nodes of the grid, momentum (or velocity) and mass (or density) apart: each against its own size, or that of
        the middle one of those that hold anything, or of what cancels; clamps weigh ten thousand times more than what
        they hold."""
        filled = a[:, 3] != 0
        if (b[~filled] != a[~filled]).any():
            yield f"{name} differs in empty nodes"
        a, b = a[filled].astype(float), b[filled].astype(float)
        if not len(a):
            return
        for what, part in (("vectors", slice(0, 3)), ("scalars", slice(3, 4))):
            size = np.linalg.norm(a[:, part], axis=1)
            least = max(float(np.median(size)), self.least.get(name, 0.0) if what == "vectors" else 0.0, 1e-30)
            off = np.linalg.norm((a - b)[:, part], axis=1) / np.maximum(size, least)
            if not off.max(initial=0.0) <= TOLERANCE:
                yield f"{name}: {what} differ by {off.max():.2g} of their size"

    def _rows(self, name: str, a: np.ndarray, b: np.ndarray) -> Iterator[str]:
        """Packed rows, quantity by quantity."""
        size = self.warp.pool.size
        if len(a) < size:  # not used by this scene
            return
        a, b = a.reshape(size, -1), b.reshape(size, -1)
        scene, width = self.warp.scene, a.shape[1]
        state = state_rows(scene.elastic, scene.tensile, width)
        for first, last in state if name == "state" else ROWS.get(name) or BY_WIDTH[name][width]:
            x, y = a[:, first:last], b[:, first:last]
            scale = max(float(np.abs(x).max()), self.least.get(f"{name}[{first}:{last}]", 1e-30))
            off = float(np.abs(x.astype(float) - y).max()) / scale
            if not off <= TOLERANCE:
                yield f"{name}[{first}:{last}] differs by {off:.2g} of its size"

    def _lists(self) -> Iterator[str]:
        """Who is in whose reach: a set for each particle, whoever shares a list with it and in which order."""
        first, second = (self._in_reach(sim) for sim in (self.warp, self.taichi))
        wrong = [i for i in first if first[i] != second[i]]
        if wrong:
            odd = first[wrong[0]] ^ second[wrong[0]]
            yield f"neighbours differ for {len(wrong)} particles, such as {wrong[0]} by {odd}"

    def _in_reach(self, sim: Simulation) -> dict[int, set[int]]:
        """The entries that each particle finds, itself left out, within its kernel."""
        neighbours, pool, box = sim.solver.neighbours, sim.pool, sim.scene.box
        lists = neighbours.lists
        entries, number = neighbours.entries.numpy(), neighbours.number.numpy()
        position = self.warp.pool.position.numpy().astype(float)
        faces = [(box.lower[a], box.upper[a], box.lower_kind[a] == PERIODIC) for a in range(3)]
        found = {}
        for world, count in enumerate(pool.counts):
            for i in range(world * pool.capacity, world * pool.capacity + count):
                group = i // lists.group
                k = np.arange(number[group])
                listed = entries[group * lists.row + k // lists.threads * lists.column + k % lists.threads]
                x = position[listed & INDEX_MASK]
                for axis, (low, high, periodic) in enumerate(faces):
                    which = (listed >> INDEX_BITS) // 3**axis % 3
                    mirrored = [2.0 * low - x[:, axis], 2.0 * high - x[:, axis]]
                    shifted = [x[:, axis] - (high - low), x[:, axis] + (high - low)]
                    x[:, axis] = np.choose(which, [x[:, axis], *(shifted if periodic else mirrored)])
                near = np.linalg.norm(x - position[i], axis=1) < (1.0 - 1e-5) * neighbours.radius
                found[i] = set(listed[near & (listed != i)].tolist())
        return found
