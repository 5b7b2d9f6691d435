"""What a run leaves: a typed record, and the files beside it.

JSON (`record.json`) and a row of a table (`Record.row`) are the record's two faces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..measure.collapse import Collapse
from ..measure.reference import Answer
from ..measure.tower import Criterion, Print
from ..method.frame import Frame
from ..method.target import Target
from ..method.verdict import Evidence, Verdict, evidence_of
from ..scenario import Scenario
from .store import RECORD, read_record, write_record

if TYPE_CHECKING:
    import pandas as pd

SERIES, FINAL_FRAME = "series.parquet", "final.npz"
IDENTITY = ("scenario", "method", "device", "backend", "threads", "repeat", "seed", "spacing_m")


def frame_name(number: int) -> str:
    """The file of a snapshot that was kept on the way."""
    return f"frame_{number:04d}.npz"


class Cost(BaseModel):
    """What a run cost, compilation apart; rates are of the loop alone, measurements and output not included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    simulated_s: float
    wall_s: float
    cpu_s: float
    prepare_s: float
    total_s: float
    substeps: int
    mean_dt_s: float
    steps_per_s: float
    particle_substeps_per_s: float
    particle_substeps_per_cpu_s: float
    wall_per_simulated_s: float
    simulated_to_real: float
    peak_particles: int
    bytes_per_particle: float
    peak_memory_MiB: float
    peak_device_MiB: float | None = None


class Record(BaseModel):
    """What a run was, how it ended, what it measured, how far off that is, and what it cost; SI units."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scenario: str
    method: str
    device: str
    backend: str
    threads: int
    repeat: int
    key: str
    seed: int
    spacing_m: float
    code: dict[str, str]
    verdict: Verdict
    reason: str = ""
    measures: dict[str, float] = {}
    moving: tuple[str, ...] = ()  # lengths among them that still changed at the end
    answers: tuple[Answer, ...] = ()
    not_compared: tuple[str, ...] = ()  # why references do not apply
    success: tuple[Criterion, ...] = ()  # of a print
    print: Print | None = None  # what became of it
    collapse: Collapse | None = None  # of a wall that came down
    cost: Cost | None = None
    launches: dict[str, float] = {}
    solves: dict[str, float] = {}  # what iterative solves took, see native/solver.py
    bytes: dict[str, int] = {}
    bounds_s: dict[str, float] = {}
    binding_s: dict[str, float] = {}  # simulated time that each bound held the step back
    approximations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    config: dict[str, Any] = {}
    input: dict[str, Any] | None = None  # the scenario as it was run; none where nothing was run
    machine: dict[str, str] = {}
    film_every: float | None = None
    resumed: int = 0
    files: dict[str, str] = Field({}, description="sums of the files that belong to it")
    seal: str = ""

    @property
    def binding(self) -> str:
        """The bound that held the step back for most of the simulated time."""
        return max(self.binding_s, key=self.binding_s.__getitem__) if self.binding_s else ""

    @property
    def at_a_time(self) -> int:
        """How many runs of the same study went on beside it at most, itself included."""
        return int(self.machine.get("runs_at_a_time", "1"))

    @property
    def counted(self) -> Cost | None:
        """Its cost where that counts, as studies tell it: none where the run has no result, whatever it took."""
        return self.cost if evidence_of(self.verdict) is Evidence.RESULT else None

    @property
    def seconds(self) -> float:
        """What its loop took [s]: CPU time on one core, which other work on the machine leaves as it is; wall time on
        several and on a GPU. NaN where it was not run."""
        if self.cost is None:
            return math.nan
        return self.cost.cpu_s if self.device == "cpu" and self.threads == 1 else self.cost.wall_s

    def row(self) -> dict[str, Any]:
        """The record as a row of a table."""
        row: dict[str, Any] = {key: getattr(self, key) for key in IDENTITY}
        row |= {"verdict": str(self.verdict), "reason": self.reason}
        row |= {"print": str(self.print or "")} | self.measures
        row |= {f"error: {a.quantity}": a.error for a in self.answers}
        row |= self.counted.model_dump(exclude_none=True) if self.counted else {}
        return row | {"binding_bound": self.binding} | {f"machine_{k}": v for k, v in self.machine.items()}


def keep(folder: Path, record: Record, files: Sequence[str] = ()) -> Record:
    """Seal a record with the sums of its files, write it, and return it as a reader will see it."""
    table = record.model_dump(mode="python", exclude={"files", "seal"})
    return Record.model_validate(write_record(folder, table, [folder / name for name in files]))


def recall(folder: Path) -> tuple[Record | None, str]:
    """(record, "") of a folder; (None, why not) where it is missing, torn, edited or of another edition."""
    table, why = read_record(folder)
    if table is None:
        return None, why
    try:
        return Record.model_validate(table), ""
    except ValidationError:
        return None, f"{RECORD} is of another edition of fluidbench"


@dataclass(frozen=True)
class Run:
    """A finished run: its record and the folder that holds its files; `reused` when an earlier call had made it."""

    record: Record
    folder: Path
    reused: bool = False
    keeper: Any = field(default=None, repr=False, compare=False)  # keeps a temporary folder as long as this is held

    @property
    def verdict(self) -> Verdict:
        return self.record.verdict

    @property
    def reason(self) -> str:
        return self.record.reason

    @property
    def method(self) -> str:
        return self.record.method

    @property
    def name(self) -> str:
        """The run in words."""
        return f"{self.record.scenario}, {self.label}, d = {1e3 * self.record.spacing_m:.3g} mm"

    @property
    def evidence(self) -> Evidence:
        """What it says of its method."""
        return evidence_of(self.verdict)

    @property
    def ok(self) -> bool:
        """Whether it has a result."""
        return self.evidence is Evidence.RESULT

    @property
    def target(self) -> Target:
        return Target(self.record.device, self.record.backend, self.record.threads)

    @property
    def label(self) -> str:
        return f"{self.record.method}{self.target.suffix}"

    @property
    def cost(self) -> Cost:
        """What it cost; raises ValueError where it was not run."""
        if self.record.cost is None:
            raise ValueError(f"{self.name}: {self.verdict}: it has no cost")
        return self.record.cost

    @property
    def dt(self) -> float:
        """Mean time step [s]."""
        return self.cost.mean_dt_s

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario as it was run."""
        return Scenario.model_validate(self.record.input)

    @cached_property
    def series(self) -> pd.DataFrame:
        """The run's measures at every output."""
        import pandas as pd

        return pd.read_parquet(self.folder / SERIES)

    def frame(self, name: str = FINAL_FRAME) -> Frame:
        """The last snapshot, or the one in a file of the folder; see method/frame.py for what it holds."""
        with np.load(self.folder / name) as data:
            return {key: data[key] for key in data.files}

    @cached_property
    def frames(self) -> list[Frame]:
        """Snapshots in order of time, where they were kept."""
        return [self.frame(name) for name in sorted(n for n in self.record.files if n.startswith("frame_"))]

    @property
    def times(self) -> np.ndarray:
        """Times of the snapshots [s]."""
        return np.array([float(frame["time"]) for frame in self.frames])

    def near(self, time: float) -> Frame:
        """The snapshot nearest to a time [s]."""
        return self.frames[int(np.argmin(np.abs(self.times - time)))]
