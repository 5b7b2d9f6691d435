"""The particle pool: one preallocated structure of arrays, shared by all worlds, reordered as a whole."""

from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from ..errors import UserError
from ..method.contract import OutOfCapacity
from ..scenario.extent import ADDRESSABLE
from .crew import index_of
from .scene import Scene

wp.set_module_options({"enable_backward": False})

FAULT_ASTRAY, FAULT_STATE = wp.constant(1024), wp.constant(2048)  # bits of Pool.fault: the run has blown up
MOST = 1.0e18  # beyond it a number's square is no float32

CORE = {
    "position": wp.vec3,  # [m]
    "velocity": wp.vec3,  # [m/s]
    "mass": float,  # [kg]
    "volume": float,  # rest volume, mass over rest density [m^3]
    "phase": int,  # row of the scene's phase table
    "held": int,  # FREE; CARRIED along by the feed, without strain; CLAMPED: strains, but keeps its velocity
    "birth_time": float,  # when it left the nozzle, 0 for a body [s]
    "origin": int,  # number in the order of creation: the particle's identity
}


def whole_warps(capacity: int) -> int:
    """Capacity rounded up to whole groups of 32 slots, so that no GPU warp is cut by the end of a launch."""
    return 32 * max(1, -(-capacity // 32))


@wp.struct
class Memory:
    """The fields of a pool as words of 32 bits: a particle has `width` of them in a field, `before` in earlier ones."""

    address: wp.array(dtype=wp.uint64)
    width: wp.array(dtype=int)
    before: wp.array(dtype=int)
    spare: wp.array(dtype=int)  # room for all


class Pool:
    """Slots world * capacity .. world * capacity + counts[world] - 1 are active.

    `add_field` lets a solver keep its own state here, so that reordering carries it along. Fields of unused slots hold
    their initial values: a particle needs no initialisation by the solver when it appears.
    """

    def __init__(self, scene: Scene, capacity: int) -> None:
        if scene.worlds * capacity > ADDRESSABLE:
            raise UserError(
                f"{scene.worlds} world(s) of {capacity} particles exceed the {ADDRESSABLE} that can be addressed; "
                "use a larger spacing"
            )
        self.scene, self.capacity, self.worlds = scene, whole_warps(capacity), scene.worlds
        self.size = self.worlds * self.capacity
        self.counts = [0] * self.worlds
        self.stale = True  # set whenever particles appear or move otherwise than by a substep
        self.fields: dict[str, wp.array] = {}
        self.ranges: dict[str, tuple[float, float]] = {}
        with wp.ScopedDevice(scene.device):
            self.count = wp.zeros(self.worlds, dtype=int)
            self.fault = wp.zeros(1, dtype=int)  # bits set by kernels; Solver.faults says what they mean
        for name, dtype in CORE.items():
            self.add_field(name, dtype, within=self._core_range(name))

    def _core_range(self, name: str) -> tuple[float, float]:
        """What a core field may hold: a particle stands for a volume near spacing^3, expanded at most."""
        scenarios = self.scene.scenarios
        ratio = max(1.0 if (e := s.material.expansion) is None else e.ratio for s in scenarios)
        volume = (1e-6 * self.scene.spacing**3, 1e3 * ratio * self.scene.spacing**3)
        densities = [s.material.density for s in scenarios]
        return {
            "mass": (volume[0] * min(densities) / ratio, volume[1] * max(densities)),
            "volume": volume,
            "phase": (0, self.scene.levels - 1),
            "held": (0, 2),
            "birth_time": (0.0, self.scene.clock.last_birth),
        }.get(name, (-MOST, MOST))

    def add_field(
        self, name: str, dtype: Any, initial: Any = None, within: tuple[float, float] = (-MOST, MOST)
    ) -> wp.array:
        """A per-particle array of this dtype, zero or `initial` everywhere. A component beyond the range `within` is no
        state of matter: health finds it, and the run has diverged."""
        array = wp.zeros(self.size, dtype=dtype, device=self.scene.device)
        if initial is not None:
            array.fill_(initial)
        self.fields[name], self.ranges[name] = array, within
        return array

    def __getattr__(self, name: str) -> wp.array:
        try:
            return self.__dict__["fields"][name]
        except KeyError:
            raise AttributeError(f"the pool has no field '{name}'") from None

    def need(self, world: int, more: int) -> None:
        """Raise OutOfCapacity unless `more` particles fit into a world."""
        if self.counts[world] + more > self.capacity:
            raise OutOfCapacity(
                f"the pool holds {self.capacity} particles a world and {self.counts[world] + more} are needed"
            )

    def set_count(self, world: int, count: int) -> None:
        self.counts[world] = count
        self.count.assign(np.array(self.counts, np.int32))
        self.stale = True

    def place(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        volume: np.ndarray,
        held: int,
        origin: np.ndarray,
        birth: float,
    ) -> None:
        """Add the same particles to every world: positions (n, 3) [m], velocities [m/s], rest volumes (n,) [m^3],
        numbers in the order of creation (n,), and the time of their birth [s]."""
        n = len(position)
        for world, scenario in enumerate(self.scene.scenarios):
            self.need(world, n)
            first = world * self.capacity + self.counts[world]
            columns = {
                "position": np.asarray(position, np.float32),
                "velocity": np.asarray(velocity, np.float32),
                "volume": np.asarray(volume, np.float32),
                "mass": np.asarray(volume * scenario.material.density, np.float32),
                "held": np.full(n, held, np.int32),
                "birth_time": np.full(n, birth, np.float32),
                "origin": np.asarray(origin, np.int32),
            }
            for name, values in columns.items():
                array = self.fields[name]
                wp.copy(array, wp.array(values, dtype=array.dtype, device=self.scene.device), first, 0, n)
            self.set_count(world, self.counts[world] + n)

    @cached_property
    def memory(self) -> "Memory":
        """The fields, all of which have been added by now, as words."""
        widths = [wp.types.type_size_in_bytes(array.dtype) // 4 for array in self.fields.values()]
        memory = Memory()
        with wp.ScopedDevice(self.scene.device):
            memory.address = wp.array([array.ptr for array in self.fields.values()], dtype=wp.uint64)
            memory.width = wp.array(widths, dtype=int)
            memory.before = wp.array(np.cumsum([0, *widths[:-1]]), dtype=int)
            memory.spare = wp.empty(self.size * sum(widths), dtype=int)
        return memory

    def permute(self, order: wp.array) -> None:
        """Enqueue: the particle in slot order[i] to slot i, all fields at once; order stays within each world."""
        for kernel in (set_aside, put_back):
            self.scene.crew.launch(kernel, self.size, [self.size, order, self.memory])
        self.stale = True

    def snapshot(self, world: int = 0, **more: np.ndarray) -> dict[str, np.ndarray]:
        """The core fields of a world's active particles as NumPy arrays, in order of creation; and `more` columns,
        given for all slots."""
        part = slice(world * self.capacity, world * self.capacity + self.counts[world])
        columns = {name: self.fields[name].numpy()[part].copy() for name in CORE}
        columns |= {name: values[part].copy() for name, values in more.items()}
        order = np.argsort(columns["origin"], kind="stable")
        return {name: values[order] for name, values in columns.items()}

    def footprint(self) -> dict[str, int]:
        """Bytes of each field, and of what sorting needs."""
        return {name: array.capacity for name, array in self.fields.items()} | {"spare": self.memory.spare.capacity}


@wp.kernel
def set_aside(share: wp.vec3i, size: int, order: wp.array(dtype=int), memory: Memory):
    """All words of the particles in their new order."""
    i = index_of(share, wp.tid())
    for field in range(memory.width.shape[0]):
        width = memory.width[field]
        words = wp.array(ptr=memory.address[field], shape=(size * width,), dtype=wp.int32)
        to = memory.before[field] * size + i * width
        for k in range(width):
            memory.spare[to + k] = words[order[i] * width + k]


@wp.kernel
def put_back(share: wp.vec3i, size: int, order: wp.array(dtype=int), memory: Memory):
    """And back into their fields."""
    i = index_of(share, wp.tid())
    for field in range(memory.width.shape[0]):
        width = memory.width[field]
        words = wp.array(ptr=memory.address[field], shape=(size * width,), dtype=wp.int32)
        at = memory.before[field] * size + i * width
        for k in range(width):
            words[i * width + k] = memory.spare[at + k]
