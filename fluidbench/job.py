"""What a run is asked to be."""

from dataclasses import asdict, dataclass, field
from typing import Any

from .provenance import code
from .store import key_of
from .target import HERE, Target

CHECKPOINTS = 300.0  # wall seconds between checkpoints


@dataclass(frozen=True)
class Job:
    """One run: what it is (scenario, method, target, repeat, variant), and how it is watched."""

    scenario: dict[str, Any]
    method: str
    target: Target = HERE
    repeat: int = 0
    variant: str = ""  # sets runs apart that differ in how they are watched, where that is measured
    wall_limit: float | None = None
    keep_frames: bool = False
    film_every: float | None = None
    checkpoint_every: float = field(default=CHECKPOINTS)  # wall seconds; 0 for none

    def inputs(self) -> dict[str, Any]:
        """What a run is; how long it may take, and whether it is filmed, is not."""
        return {
            "scenario": self.scenario, "method": self.method, "target": asdict(self.target), "repeat": self.repeat,
            **({"variant": self.variant} if self.variant else {}),
        }  # fmt: skip

    @property
    def key(self) -> str:
        return key_of(self.inputs())

    def watched(self) -> dict[str, Any]:
        """What is to lie beside a run's results: a run that was watched otherwise has other files."""
        return {"film_every": self.film_every, "keep_frames": self.keep_frames}

    def heading(self) -> dict[str, Any]:
        """How every record of this job begins, whatever became of it: what was asked for, and by which code."""
        return {
            "scenario": self.scenario["name"], "method": self.method, **asdict(self.target), "repeat": self.repeat,
            "key": self.key, "seed": self.scenario["seed"], "spacing_m": self.scenario["spacing"],
            "code": code(self.method, self.target.backend),
        }  # fmt: skip
