"""Where a run happens."""

from dataclasses import dataclass
from importlib.util import find_spec

DEFAULT_BACKEND = "warp"
BACKENDS = {"warp": "warp-lang", "taichi": "taichi"}  # the packages that they come in


@dataclass(frozen=True)
class Target:
    """Device, language of the kernels, and threads on the CPU; Warp runs one thread there."""

    device: str = "cpu"
    backend: str = DEFAULT_BACKEND
    threads: int = 1

    @property
    def suffix(self) -> str:
        """What sets a label apart: nothing for the default backend."""
        return "" if self.backend == DEFAULT_BACKEND else f" ({self.backend})"

    @property
    def other(self) -> "Target | None":
        """The same in the other backend, on as many threads as this one; None where that is not installed."""
        backend = next(b for b in BACKENDS if b != self.backend)
        return Target(self.device, backend, self.threads) if find_spec(backend) is not None else None


HERE = Target()
