"""Where a run happens."""

from dataclasses import dataclass

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


HERE = Target()
