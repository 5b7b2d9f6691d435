"""A case with a known answer: scenario, reference and error measure in one object; the cases lie in
scenarios/analytic, one file each."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UserError, quoted, suggestion
from ..scenario import Scenario
from .execute import Finished

if TYPE_CHECKING:
    import pandas as pd

PHYSICS = (
    "kinematics", "emission", "liquid", "viscous", "yield stress", "elastic", "viscoelastic", "process", "numerics",
)  # fmt: skip
METHOD_OF_LAW = "law"


class Run:
    """A finished run of a case: its record, its scenario and its snapshots over time."""

    def __init__(self, finished: Finished) -> None:
        self.record, self.folder = finished.record, finished.folder
        self.method = str(self.record["method"])
        self.scenario = Scenario.model_validate(self.record["input"])

    @cached_property
    def frames(self) -> list[dict[str, np.ndarray]]:
        """Snapshots in order of time; `time` [s] is a 0-d array, see Simulation.frame for the rest."""
        found = []
        for name in sorted(name for name in self.record["files"] if name.startswith("frame_")):
            with np.load(self.folder / name) as data:
                found.append({key: data[key] for key in data.files})
        return found

    @cached_property
    def series(self) -> pd.DataFrame:
        """The run's measures at every output."""
        import pandas as pd

        return pd.read_parquet(self.folder / "series.parquet")

    @property
    def times(self) -> np.ndarray:
        return np.array([float(frame["time"]) for frame in self.frames])

    def near(self, time: float) -> dict[str, np.ndarray]:
        """The snapshot nearest to a time [s]."""
        return self.frames[int(np.argmin(np.abs(self.times - time)))]

    @property
    def dt(self) -> float:
        """Mean time step [s]."""
        return float(self.record["cost"]["mean_dt_s"])


@dataclass(frozen=True)
class Number:
    """One measured value beside its reference."""

    quantity: str
    measured: float
    reference: float


@dataclass(frozen=True)
class Curve:
    """A measured profile beside its reference, in the units that the labels say."""

    name: str
    x_label: str
    y_label: str
    x: np.ndarray
    y: np.ndarray
    reference_x: np.ndarray
    reference_y: np.ndarray


@dataclass(frozen=True)
class Finding:
    """What a case measured: the error that is judged, and what stands behind it."""

    error: float
    numbers: tuple[Number, ...] = ()
    curves: tuple[Curve, ...] = ()


@dataclass(frozen=True, eq=False)
class Case:
    """One question with a known answer.

    `scenarios` gives the runs needed at a spacing [m], by label; `evaluate` measures them. A law without a flow has
    `drive` instead: it takes a time step (in place of the spacing) and answers at once.
    `exempt` says for each method that is not expected to pass why not; `skipped` why it is not even run; `causes` why a
    method that should pass is known to miss.
    """

    name: str
    title: str
    physics: str
    source: str
    measure: str
    spacing: float
    tolerance: float
    scenarios: Callable[[float], dict[str, Scenario]] | None = None
    evaluate: Callable[[dict[str, Run]], Finding] | None = None
    drive: Callable[[float], Finding] | None = None
    fine_tolerance: float | None = None
    tolerances: Mapping[str, float] = field(default_factory=dict)
    exempt: Mapping[str, str] = field(default_factory=dict)
    skipped: Mapping[str, str] = field(default_factory=dict)
    causes: Mapping[str, str] = field(default_factory=dict)
    quick: float | None = None

    def limit(self, method: str, level_factor: float) -> float:
        """The error allowed for a method at `level_factor` times the coarse spacing; above 1, in proportion."""
        coarse = self.tolerances.get(method, self.tolerance)
        if level_factor <= 0.5 and method not in self.tolerances and self.fine_tolerance is not None:
            return self.fine_tolerance
        return coarse * max(level_factor, 1.0)


def cases() -> dict[str, Case]:
    """All cases of scenarios/analytic, ordered by physics."""
    from scenarios import analytic

    found: list[Case] = []
    for module in pkgutil.iter_modules(analytic.__path__):
        found.append(importlib.import_module(f"{analytic.__name__}.{module.name}").CASE)
    return {case.name: case for case in sorted(found, key=lambda c: (PHYSICS.index(c.physics), c.name))}


def select(names: list[str]) -> list[Case]:
    """The cases named, or all; raises UserError with the nearest known name."""
    known = cases()
    for name in names:
        if name not in known:
            raise UserError(f"no case named {quoted(name)}{suggestion(name, known)}")
    return [known[name] for name in names] if names else list(known.values())


def scenario(name: str, **table: Any) -> Scenario:
    """A case's scenario from keyword tables, validated like any other."""
    from ..library import validate

    return validate({"name": name, **table}, f"case {name}")
