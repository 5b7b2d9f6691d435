"""A case with a known answer: scenario, reference and error measure in one object; the cases lie in
scenarios/analytic, one file each."""

from __future__ import annotations

import importlib
import math
import pkgutil
import runpy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UserError, quoted, suggestion
from ..runs.record import Run
from ..scenario import Scenario

PHYSICS = (
    "kinematics",
    "emission",
    "liquid",
    "viscous",
    "yield stress",
    "elastic",
    "viscoelastic",
    "process",
    "numerics",
)
METHOD_OF_LAW = "law"


@dataclass(frozen=True)
class Number:
    """One measured value beside its reference, in the unit that `quantity` ends with: "period [s]"."""

    quantity: str
    measured: float
    reference: float


@dataclass(frozen=True)
class Curve:
    """A measured profile beside its reference, in the units that the labels end with: "x [m]"."""

    name: str
    x_label: str
    y_label: str
    x: np.ndarray
    y: np.ndarray
    reference_x: np.ndarray
    reference_y: np.ndarray


@dataclass(frozen=True)
class Finding:
    """What a case measured: the error that is judged (a share [-], held against the tolerance), and what stands behind
    it."""

    error: float
    numbers: tuple[Number, ...] = ()
    curves: tuple[Curve, ...] = ()


@dataclass(frozen=True, eq=False)
class Case:
    """One question with a known answer.

    `scenarios` gives the runs needed at a spacing [m], by label; `evaluate` measures them. A law without a flow has
    `drive` instead: it takes a time step (in place of the spacing) and answers at once.
    `about` names the one method whose numerics it measures, if it does.
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
    about: str = ""

    def skips(self, method: str) -> str:
        """Why a method is not run on it; empty where it is."""
        if self.about and method != self.about:
            return f"the case measures the numerics of {self.about}"
        return self.skipped.get(method, "")

    def limit(self, method: str, level_factor: float) -> float:
        """The error allowed for a method at `level_factor` times the coarse spacing; above 1, in proportion."""
        coarse = self.tolerances.get(method, self.tolerance)
        if level_factor <= 0.5 and method not in self.tolerances and self.fine_tolerance is not None:
            return self.fine_tolerance
        return coarse * max(level_factor, 1.0)


def check_case(case: Case, where: str) -> Case:
    """The case; raises UserError for one that could not be run or judged."""
    wrong = ""
    if case.physics not in PHYSICS:
        wrong = f"physics: {quoted(case.physics)}{suggestion(str(case.physics), PHYSICS)}"
    elif case.drive is None and (case.scenarios is None or case.evaluate is None):
        wrong = "it needs scenarios and evaluate, or drive"
    for name in ("spacing", "tolerance"):
        value = getattr(case, name)
        if not isinstance(value, int | float) or not 0 < value < math.inf:
            wrong = f"{name}: a positive number is wanted (got {quoted(value)})"
    if wrong:
        raise UserError(f"{where}: {wrong}")
    return case


def scenarios_of(case: Case, spacing: float) -> dict[str, Scenario]:
    """A case's scenarios at a spacing [m]; raises UserError for what are none."""
    assert case.scenarios is not None
    try:
        found = case.scenarios(spacing)
    except UserError:
        raise
    except (Exception, SystemExit) as error:
        raise UserError(f"case {case.name}: its scenarios failed: {type(error).__name__}: {error}") from None
    if not isinstance(found, dict) or not found or not all(isinstance(s, Scenario) for s in found.values()):
        raise UserError(f"case {case.name}: scenarios(spacing) is to return a table of scenarios by label")
    return found


def check_finding(found: Any) -> Finding:
    """What a case has found; raises TypeError or ValueError for what is no finding."""
    if not isinstance(found, Finding):
        raise TypeError(f"a Finding is wanted, not {type(found).__name__}")
    if math.isnan(found.error) or found.error < 0:
        raise ValueError(f"an error is a number of 0 or more, not {found.error}")
    for number in found.numbers:
        for value in (number.measured, number.reference):
            float(value)
    for curve in found.curves:
        for values in (curve.x, curve.y, curve.reference_x, curve.reference_y):
            np.asarray(values, float)
    return found


def cases() -> dict[str, Case]:
    """All cases of scenarios/analytic, ordered by physics."""
    from scenarios import analytic

    found: list[Case] = []
    for module in pkgutil.iter_modules(analytic.__path__):
        found.append(importlib.import_module(f"{analytic.__name__}.{module.name}").CASE)
    return {case.name: case for case in sorted(found, key=lambda c: (PHYSICS.index(c.physics), c.name))}


def select(names: Sequence[str | Path | Case]) -> list[Case]:
    """The cases named, or all; a name may be that of a Python file, and a case stands for itself. Raises UserError with
    the nearest known name."""
    known = cases()
    found = [check_case(n, f"case {n.name}") if isinstance(n, Case) else _named(str(n), known) for n in names]
    return found if names else list(known.values())


def _named(name: str, known: Mapping[str, Case]) -> Case:
    if name in known:
        return known[name]
    if name.endswith(".py"):
        return case_in(Path(name))
    raise UserError(f"no case named {quoted(name)}{suggestion(name, known)}")


def case_in(path: Path) -> Case:
    """The CASE that a Python file of the user's defines; raises UserError where there is none."""
    shown = quoted(str(path))[1:-1]
    try:
        path.read_bytes()
    except (OSError, ValueError) as error:
        raise UserError(f"{shown}: no such case: {getattr(error, 'strerror', None) or error}") from None
    try:
        found = runpy.run_path(str(path))
    except (Exception, SystemExit) as error:
        raise UserError(f"{shown}: it cannot be run: {type(error).__name__}: {error}") from None
    if not isinstance(found.get("CASE"), Case):
        raise UserError(f"{shown}: it defines no CASE (a fluidbench.study.case.Case)")
    return check_case(found["CASE"], shown)
