"""The native contract: a method that is one substep of a pool of particles.

A solver advances a pool of particles by one substep. It knows nothing of nozzles, schedules, files or measures.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from ..method.contract import Method, Session
from ..method.target import Target

if TYPE_CHECKING:
    from ..scenario import Scenario
    from .pool import Pool
    from .scene import Scene


class Solver(Method):
    """A method written on our pool of particles: subclass it, give it a Method's attributes and those below."""

    passes: ClassVar[tuple[str, ...]]
    faults: ClassVar[dict[int, str]] = {}
    arranges: int = 0  # ticks from one call of `arrange` to the next; 0 for never
    turns: int = 1  # calls of `arrange` until it does the same again
    sort_bits: int = 64  # of its sort keys, from the lowest on, that tell any two apart
    makes_room: bool = False  # whether it must be told when particles were put where others may be
    backend: Any = None  # what runs the passes: `name`, and `wait()` for all that was launched

    @classmethod
    def apart(cls, scenarios: Sequence[Scenario]) -> str | None:
        from .worlds import apart

        return apart(scenarios)

    @classmethod
    def start(cls, scenario: Scenario, config: Any, target: Target) -> Session:
        return cls.start_together([scenario], config, target)

    @classmethod
    def start_together(cls, scenarios: Sequence[Scenario], config: Any, target: Target) -> Session:
        from .simulation import Simulation

        return Simulation(scenarios, cls, target, config)

    @abstractmethod
    def __init__(self, scene: Scene, pool: Pool, config: Any, backend: str = "warp", threads: int = 1) -> None:
        """Allocate everything the method needs: nothing is allocated later. `backend` is one of `backends`; `threads`
        are those of the CPU, for a backend that can use several."""

    @abstractmethod
    def substep(self) -> None:
        """Enqueue the passes that advance every particle by `scene.dt`.

        No host synchronisation, no allocation and no branch on device data: with Warp the whole call is captured as a
        graph, once for each thread that shares the work. A method that `shares_threads` launches through
        `scene.crew.launch` alone; any other may use `wp.launch`.
        """

    def portion(self, substeps: int) -> int:
        """How many substeps of a tick of so many belong together: it is enqueued in such portions, and a rest."""
        return 1

    def substeps(self, number: int, portion: int) -> None:
        """Enqueue so many of them in portions, with nothing in between; a method may have a shorter way than one by
        one."""
        for _ in range(number):
            self.substep()

    def prepare(self) -> None:
        """Compile the kernels; timed apart from the run."""

    def refresh(self) -> None:
        """Enqueue what must follow when particles have appeared, moved in memory or were moved: between substeps, the
        first time outside any graph, later recorded like `substep`."""

    def arrange(self, turn: int) -> None:
        """Enqueue, every `arranges` ticks before their substeps and recorded like them: particles into a better order,
        densities to what that order tells; which is no motion of matter. `turn` counts the calls, from 0 to `turns` - 1
        and again."""

    def make_room(self, placed: bool) -> None:
        """Enqueue, if it `makes_room`, between substeps and recorded like them, when bodies were `placed`, whose
        particles may lie at random or within others, or parents had children, which lie over others. A method whose
        pressure is finite lets it push them apart."""

    def carried(self) -> dict[str, Any]:
        """Arrays beyond the pool's that later substeps depend on, by name: what a checkpoint must hold."""
        return {}

    def resume(self) -> None:
        """Called after the pool and what is `carried` were restored from a checkpoint, before the next substep."""

    def harden(self, due: Any) -> None:
        """Enqueue: every particle to its due row of the phase table (int, (worlds * capacity,)); between substeps.

        Position, velocity and stress stay as they are: curing does no work. Required of methods that can CURE.
        """
        raise NotImplementedError(f"{self.name} cannot cure")

    def sort_keys(self) -> Any | None:
        """int64 keys that put neighbours side by side, in the first half of an array of twice the pool's size, once
        what was enqueued is done; None, always, to keep the order. Recorded like `substep`."""
        return None

    @abstractmethod
    def densities(self) -> Any:
        """Present density of every particle slot, shape (worlds * capacity,) [kg/m^3], as a NumPy array."""

    def spins(self) -> Any | None:
        """Angular momentum of every particle slot about its own centre, shape (worlds * capacity, 3) [kg m^2/s]; None
        where particles have none."""
        return None

    def pressures(self) -> Any | None:
        """Pressure of every particle slot, shape (worlds * capacity,) [Pa]; None where there is none."""
        return None

    def shear_stresses(self) -> Any | None:
        """Elastic shear stress sqrt(J2) of every particle slot, shape (worlds * capacity,) [Pa]; None where there is
        none, or where a method carries it otherwise than by particle."""
        return None

    def solves(self) -> dict[str, float]:
        """What iterative solves have taken so far: `iterations` a solve, the largest `residual`, the share that is
        `unconverged`; empty where nothing is solved for."""
        return {}

    def traffic(self) -> dict[str, float] | None:
        """Bytes of a substep beside the pool's, see Session.traffic."""
        return None

    @abstractmethod
    def footprint(self) -> dict[str, int]:
        """Bytes allocated by the method itself, by part."""
