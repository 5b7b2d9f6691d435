"""Where a run happens."""

from dataclasses import dataclass
from importlib.util import find_spec

from ..errors import UserError

DEFAULT_BACKEND = "warp"
BACKENDS = {"warp": "warp-lang", "taichi": "taichi"}  # the packages that they come in


@dataclass(frozen=True)
class Target:
    """Device, language of the kernels, and threads on the CPU.

    Raises UserError for Taichi on a second GPU, which it would not use.
    """

    device: str = "cpu"
    backend: str = DEFAULT_BACKEND
    threads: int = 1

    def __post_init__(self) -> None:
        if self.backend == "taichi" and self.device not in ("cpu", "cuda:0"):
            raise UserError(f"the backend taichi runs on cuda:0 alone, not on {self.device}; set CUDA_VISIBLE_DEVICES")
        if self.device != "cpu":
            object.__setattr__(self, "threads", 1)

    @property
    def suffix(self) -> str:
        """What sets a label apart: nothing for the default backend."""
        return "" if self.backend == DEFAULT_BACKEND else f" ({self.backend})"

    @property
    def options(self) -> str:
        """What a command line needs to run here, with a leading blank; nothing for the defaults."""
        given = {"--device": self.device, "--backend": self.backend, "--threads": self.threads}
        usual = {"--device": "cpu", "--backend": DEFAULT_BACKEND, "--threads": 1}
        return "".join(f" {name} {value}" for name, value in given.items() if value != usual[name])

    @property
    def alone(self) -> str:
        """The same for `fluidbench run`, which takes all cores by itself."""
        return self.options + (" --threads 1" if self.device == "cpu" and self.threads == 1 else "")

    @property
    def other(self) -> "Target | None":
        """The other backend on this device, on one thread; None where it is not installed."""
        backend = next(b for b in BACKENDS if b != self.backend)
        return Target(self.device, backend) if find_spec(backend) is not None else None


HERE = Target()
