"""What a comparison needs of any method: what it is, and a session that runs a scenario through it.

Studies know nothing else of a method. `fluidbench.native` is one way to be a method: on our particle pool, one substep
at a time. An engine that owns its particles and its time step is another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import UserError
from ..scenario.model import Model
from .features import Feature

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy as np

    from ..scenario import Scenario
    from .frame import Frame
    from .target import Target
    from .timestep import Bound
    from .vitals import Vital


class Config(Model):
    """A method's own numerical settings; frozen, unknown keys refused."""


@dataclass(frozen=True)
class Economy:
    """A numerical setting relaxed to save time: keys of the method's own section of `numerics`."""

    name: str
    settings: dict[str, Any]


@dataclass(frozen=True)
class NumericalAxis:
    """A setting of a method's own to vary in `stability`: its values (all, and those of a quick study), its unit, and
    the power of the value that the setting takes."""

    name: str
    key: str
    values: tuple[float, ...]
    quick: tuple[float, ...]
    unit: str
    power: float = 1.0


@dataclass
class Steps:
    """What an advance took: substeps, particle-substeps, the simulated time [s] that each bound held the step back, and
    the most particles that there were."""

    substeps: int = 0
    particle_substeps: int = 0
    binding: dict[str, float] = field(default_factory=dict)
    peak_particles: int = 0


class OutOfCapacity(RuntimeError):
    """There is no room for what is to be added; the message says how much is needed."""


class Session(ABC):
    """One method on one scenario, under way."""

    config: Any
    stride: float  # simulated time after which it likes to be looked at [s]
    resumable: ClassVar[bool] = False  # whether `state` and `resume` are there

    @property
    @abstractmethod
    def now(self) -> float:
        """Simulated time [s]."""

    def prepare(self) -> None:  # noqa: B027
        """Compile and load; timed apart from the run."""

    @abstractmethod
    def begin(self) -> Vital:
        """Make the first frame ready and read its vital signs; called once, unless the run is resumed."""

    @abstractmethod
    def advance(self, until: float) -> Steps:
        """Go on to a time [s], or a little further where the method's own step leads there; raises OutOfCapacity."""

    @abstractmethod
    def look(self) -> Vital:
        """Read the vital signs, as they are now."""

    def news(self) -> Vital:
        """The latest vital signs that are there without waiting, which may be of an earlier time."""
        return self.look()

    def conclude(self) -> str | None:
        """What is wrong with the state that the run ends with, if anything."""
        return self.look().complaint

    @abstractmethod
    def frame(self) -> Frame:
        """The particles as they are now, see method/frame.py."""

    def frames(self) -> list[Frame]:
        """The particles of each scenario that it was started with."""
        return [self.frame()]

    def glimpse(self) -> Frame:
        """As much of the frame as a picture needs: position, birth_time and phase."""
        frame = self.frame()
        return {name: frame[name] for name in ("position", "birth_time", "phase")}

    @abstractmethod
    def bounds(self) -> list[Bound]:
        """The limits on the step that hold now; none for an engine that picks its own."""

    @abstractmethod
    def footprint(self) -> dict[str, int]:
        """Bytes allocated, by part; empty where that is not known."""

    @property
    @abstractmethod
    def capacity(self) -> int:
        """Particles that there is room for."""

    def traffic(self) -> dict[str, float] | None:
        """Bytes that a substep moves at the least, "memory" (streamed once) and "cache" (read again and again); None
        where that is not known."""
        return None

    def statistics(self) -> dict[str, Any]:
        """More that belongs into the run's record, as JSON can hold it."""
        return {}

    def peak_device_bytes(self) -> int | None:
        """Most memory that was in use on the GPU; None where that is not known, or there is none."""
        return None

    def sort(self) -> None:  # noqa: B027
        """Put particles into the order in which the method is fastest, as a run does now and then, if there is one."""

    def march(self, dt: float, substeps: int) -> None:
        """Take substeps of a given dt [s], whatever the bounds say, with or without `begin`: for experiments on
        stability. Raises UserError where it cannot be told."""
        raise UserError("it picks its own step")

    def kick(self, velocity: np.ndarray) -> None:
        """Set every slot's velocity, shape (capacity, 3) [m/s]: for experiments on stability. Raises UserError where it
        cannot be told."""
        raise UserError("its particles are its own")

    def state(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        """Everything that a run must have to go on as it was: on the host, as JSON can hold it, and as arrays."""
        raise NotImplementedError("it cannot be resumed")

    def resume(self, progress: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Take the place of a session whose `state` was kept; raises KeyError if something is not there."""
        raise NotImplementedError("it cannot be resumed")

    def close(self) -> None:  # noqa: B027
        """Give back what it holds."""


class Method(ABC):
    """One numerical method. Subclass it (or native.Solver), give it the attributes below, and register the class as an
    entry point of the group `fluidbench.solvers`. It is used as a class: nothing is instantiated but sessions."""

    name: ClassVar[str]
    paradigm: ClassVar[str]
    features: ClassVar[frozenset[Feature]]
    Config: ClassVar[type[Config]]
    rank: ClassVar[int] = 100  # where it stands among others in tables
    backends: ClassVar[tuple[str, ...]] = ("warp",)  # languages of its kernels
    lacking: ClassVar[Mapping[str, frozenset[Feature]]] = {}  # features that it does not have in one of them
    devices: ClassVar[tuple[str, ...]] = ("cpu", "cuda")
    shares_threads: ClassVar[bool] = False  # whether several threads of the CPU can share its Warp kernels
    bounded: ClassVar[bool] = True  # whether its bounds are of stability; otherwise they are of accuracy
    bare: ClassVar[dict[str, Any]] = {}  # settings that leave of it what its theory of stability knows
    axes: ClassVar[tuple[NumericalAxis, ...]] = ()  # settings of its own that `stability` varies
    typical_rate: ClassVar[float] = 1.0e6  # particle-substeps a second on one core, for estimates only
    typical_bytes: ClassVar[float] = 300.0  # bytes a particle, for estimates only

    @classmethod
    def missing(cls) -> str | None:
        """Why it cannot be used here, and what would help; None when it can."""
        return None

    @classmethod
    def interpreter(cls) -> Path | None:
        """The Python that its sessions need, whose packages come after ours; None for the one that runs here."""
        return None

    @classmethod
    def versions(cls) -> dict[str, str]:
        """What decides its results beside the toolkit's sources and its own, by name: kept with every run, and another
        version's runs are not taken for its own."""
        return {}

    @classmethod
    def refuses(cls, scenario: Scenario, config: Any) -> str | None:
        """Why it cannot run this scenario, in words a user understands; None when it can. Features are checked before,
        see suitability.py."""
        return None

    @classmethod
    def approximates(cls, scenario: Scenario, config: Any) -> list[str]:
        """Which parts of the scenario it only approximates, one sentence each; recorded with every run."""
        return []

    @classmethod
    @abstractmethod
    def bounds(cls, scenario: Scenario, config: Any, speed: float) -> list[Bound]:
        """Every limit on dt for matter moving at up to `speed` [m/s], by name, formula and source; none for an engine
        that picks its own step."""

    @classmethod
    def decided(cls, scenario: Scenario, config: Any) -> Any:
        """The settings of a run: what is left to the method (`auto`) decided by the scenario."""
        return config

    @classmethod
    def weight_of_a_step(cls, scenario: Scenario, config: Any) -> float:
        """What a substep costs over one at the typical rate, for estimates only."""
        return 1.0

    @classmethod
    def economies(cls, scenario: Scenario, config: Any) -> Sequence[Economy]:
        """What `ablate` may relax, in the method's own numerics."""
        return ()

    @classmethod
    def theory(cls, scenario: Scenario, config: Any) -> float | None:
        """Largest stable dt [s] in bulk, by analysis; None where there is none."""
        return None

    @classmethod
    def memory(cls, scenario: Scenario, config: Any, particles: int) -> float:
        """What so many particles of a scenario will take [bytes]."""
        return particles * cls.typical_bytes

    @classmethod
    def apart(cls, scenarios: Sequence[Scenario]) -> str | None:
        """Why it cannot run these scenarios in one session, in the same launches; None when it can."""
        return "its sessions hold one scenario each" if len(scenarios) > 1 else None

    @classmethod
    def start_together(cls, scenarios: Sequence[Scenario], config: Any, target: Target) -> Session:
        """One session for scenarios that are not `apart`."""
        raise NotImplementedError(f"{cls.name}: its sessions hold one scenario each")

    @classmethod
    @abstractmethod
    def start(cls, scenario: Scenario, config: Any, target: Target) -> Session:
        """A session at the scenario's beginning; raises UserError where it refuses."""
