"""What `stability` measures: blocks against theory, and points along axes, each a piece of work in its own process."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..errors import UserError, quoted, suggestion
from ..method.suitability import refusal
from ..method.target import Target
from ..registry import get_method
from ..runs.experiment import CRASH, Experiment
from ..scenario import Scenario
from ..scenario.library import validate
from ..scenario.numerics import configure
from .limits import block

Task = dict[str, Any]

Runner = Callable[[Sequence[Experiment]], list[dict[str, Any]]]  # has experiments done, by whomever

HELD, FAILED, REFUSED, ERROR = "held", "failed", "refused", "error"

OPENING_STEPS = 2000  # substeps of the scenario itself, from its start, in a full study

SPACINGS = (1 / 3, 0.5, 1.0, 2.0, 8 / 3)


@dataclass(frozen=True)
class Axis:
    """A quantity to vary: its key in the scenario, its values (all, and those of a quick study), its unit."""

    key: str
    values: tuple[float, ...]
    quick: tuple[float, ...]
    unit: str
    power: float = 1.0
    method: str | None = None  # that it is a matter of alone

    def setting(self, scenario: Scenario, value: float) -> dict[str, Any]:
        """Dotted keys of the scenario at a value."""
        return {self.key: value}


class Spacing(Axis):
    def setting(self, scenario: Scenario, value: float) -> dict[str, Any]:
        return {self.key: value * scenario.spacing}


class Own(Axis):
    def setting(self, scenario: Scenario, value: float) -> dict[str, Any]:
        return {self.key: value**self.power}


AXES = {
    "viscosity": Axis("material.viscosity", (1e-3, 1e-1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5), (1e-3, 10.0, 1e5), "Pa s"),
    "youngs_modulus": Axis("material.youngs_modulus", (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9), (1e3, 1e6, 1e9), "Pa"),
    "poisson_ratio": Axis("material.poisson_ratio", (0.0, 0.2, 0.3, 0.4, 0.45, 0.49, 0.499), (0.0, 0.3, 0.499), "-"),
    "yield_stress": Axis("material.yield_stress", (0.0, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5), (0.0, 1e2, 1e5), "Pa"),
    "exit_speed": Axis("nozzle.exit_speed", (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0), (0.01, 0.3, 10.0), "m/s"),
    "density": Axis("material.density", (10.0, 100.0, 1e3, 3e3, 1e4), (10.0, 1e3, 1e4), "kg/m^3"),
    "spacing": Spacing("spacing", SPACINGS, (SPACINGS[0], 1.0, SPACINGS[-1]), "of the scenario's"),
}


def choose(names: Sequence[str], methods: Sequence[str]) -> dict[str, Axis]:
    """The axes named, or all, those of the methods' own numerics included; raises UserError with the nearest known
    name."""
    known = dict(AXES)
    for method in methods:
        for axis in get_method(method).axes:
            known[axis.name] = Own(
                f"numerics.{method}.{axis.key}", axis.values, axis.quick, axis.unit, axis.power, method
            )
    for name in names:
        if name not in known:
            raise UserError(f"no axis {quoted(name)}{suggestion(name, known)}")
    return {name: known[name] for name in names or known}


def point_tasks(
    scenario: Scenario, axes: dict[str, Axis], methods: Sequence[str], quick: bool, target: Target
) -> list[tuple[str, Task]]:
    """(label, task) of every point of every axis; a method's own axes are a matter of that method alone."""
    tasks = []
    for name, axis in axes.items():
        for method in [m for m in methods if axis.method in (None, m)]:
            for value in axis.quick if quick else axis.values:
                task = {
                    "scenario": scenario.model_dump(mode="json"),
                    "settings": axis.setting(scenario, value),
                    "axis": name,
                    "value": value,
                    "method": method,
                    "quick": quick,
                    "target": asdict(target),
                }
                tasks.append((f"{name}-{method}", task))
    return tasks


def measure_points(tasks: Sequence[tuple[str, Task]], run: Runner) -> list[dict[str, Any]]:
    """A row a point, in order; one that could not be measured has the verdict `error` and says why."""
    results = run([_experiment("measure_point", label, task) for label, task in tasks])
    return [
        r
        if CRASH not in r
        else {key: t[key] for key in ("axis", "value", "method")} | {"verdict": ERROR, "reason": r[CRASH]}
        for (_, t), r in zip(tasks, results, strict=True)
    ]


def measure_blocks(tasks: Sequence[tuple[str, Task]], run: Runner) -> list[dict[str, Any]]:
    """A row a block, in order; one that could not be measured has a `reason` instead of limits."""
    results = run([_experiment("measure_block", label, task) for label, task in tasks])
    return [
        r if CRASH not in r else {"kind": t["kind"], "method": t["method"], "reason": r[CRASH]}
        for (_, t), r in zip(tasks, results, strict=True)
    ]


def _experiment(function: str, label: str, task: Task) -> Experiment:
    return Experiment(f"{__name__}:{function}", label, task["method"], task, Target(**task["target"]))


def measure_point(task: Task) -> dict[str, Any]:
    """One point: do the defaults hold, and where are the limits of the resting block and of the thrown lump? A method
    whose session cannot be told its step refuses."""
    try:
        return _point(task)
    except UserError as reason:
        named = {key: task[key] for key in ("axis", "value", "method")}
        return named | {"verdict": REFUSED, "reason": str(reason)}


def _point(task: Task) -> dict[str, Any]:
    from .limits import Limit, bisect, block_limit, default_dt, lump_survives

    row = {key: task[key] for key in ("axis", "value", "method")}
    solver = get_method(task["method"])
    try:
        scenario = varied(task["scenario"], task["settings"])
        config = configure(solver, scenario)
        reason = refusal(solver, scenario, config)
    except UserError as error:
        return row | {"verdict": REFUSED, "reason": str(error).splitlines()[0]}
    if reason is not None:
        return row | {"verdict": REFUSED, "reason": reason}
    if not solver.bounds(scenario, config, scenario.reference_speed):
        return row | {"verdict": REFUSED, "reason": "it picks its own step"}
    target, precision = Target(**task["target"]), 0.2 if task["quick"] else 0.05
    own, binding = default_dt(scenario, solver, config)
    trouble = lump_survives(scenario, solver, config, own, target)
    if trouble is None and not task["quick"]:
        trouble = opening(scenario, task["method"], target)
    row |= {
        "verdict": HELD if trouble is None else FAILED,
        "reason": trouble or "",
        "binding": binding,
        "dt_own_s": own,
        "dt_theory_s": solver.theory(scenario, config),
    }
    if not solver.bounded:  # is it still sound far beyond its bound of accuracy?
        beyond = lump_survives(scenario, solver, config, 8 * own, target) is None
        limit = Limit(8 * own, math.inf) if beyond else Limit(own, 8 * own)
    else:
        limit = bisect(lambda dt: lump_survives(scenario, solver, config, dt, target) is None, own, precision, 8.0)
        still = block(block_material(scenario), scenario.spacing).model_copy(update={"numerics": scenario.numerics})
        row["dt_block_s"] = block_limit(still, solver, config, own, precision, target).dt
    return row | {"dt_lump_s": limit.stable, "lump_limit_found": math.isfinite(limit.unstable)}


def varied(table: dict[str, Any], settings: dict[str, Any]) -> Scenario:
    """A scenario with dotted keys changed; raises UserError where that makes no scenario."""
    from ..scenario.library import assign

    changed = Scenario.model_validate(table).model_dump(mode="json", exclude_none=True)
    for key, value in settings.items():
        if key.startswith("nozzle") and "nozzle" not in changed:
            raise UserError(f"{key}: the scenario has no nozzle")
        if key == "nozzle.exit_speed":
            changed["nozzle"].pop("flow_rate", None)
        assign(changed, key, value)
    return validate(changed, changed["name"])


def block_material(scenario: Scenario) -> dict[str, Any]:
    """The scenario's material as a block that has not yielded: yielding is implicit and takes no part in stability."""
    m = scenario.material.model_dump(exclude_none=True)
    if scenario.material.relaxation_time is None:
        m.pop("yield_stress", None)
        m["plastic_viscosity"] = 0.0
    if scenario.material.youngs_modulus is None and not {"sound_speed", "bulk_modulus"} & set(m):
        m["sound_speed"] = scenario.liquid_sound_speed
    return m


def opening(scenario: Scenario, method: str, target: Target) -> str | None:
    """None if the scenario's first steps go well, otherwise what went wrong."""
    solver = get_method(method)
    session = solver.start(scenario, configure(solver, scenario), target)
    tick, ticks, _ = scenario.schedule
    substeps = 0
    while substeps < OPENING_STEPS and session.now < tick * (ticks - 0.5):
        substeps += session.advance(session.now + tick).substeps
        vital = session.look()
        if trouble := vital.complaint or vital.shortage:
            return trouble
    return None


BLOCKS = {
    "acoustic": {"density": 1000.0, "sound_speed": 10.0},
    "viscous": {"density": 1000.0, "sound_speed": 0.05, "viscosity": 100.0},
    "elastic": {"density": 1000.0, "youngs_modulus": 1e5},
}
"""Materials whose limit is known."""


def block_tasks(methods: Sequence[str], quick: bool, target: Target) -> list[tuple[str, Task]]:
    """The blocks of references.md, H, for methods that have a theory."""
    return [
        (
            f"block-{kind}-{method}",
            {"kind": kind, "method": method, "precision": 0.1 if quick else 0.03, "target": asdict(target)},
        )
        for method in methods
        if _has_theory(method)
        for kind in BLOCKS
    ]


def _has_theory(name: str) -> bool:
    method = get_method(name)
    return method.theory(block(BLOCKS["acoustic"], 0.01), method.Config()) is not None


def measure_block(task: Task) -> dict[str, Any]:
    """A block's limit against theory, the method stripped of what theory does not know."""
    from .limits import block_limit, default_dt

    solver = get_method(task["method"])
    config = solver.Config(**solver.bare)
    scenario = block(BLOCKS[task["kind"]], 0.01)
    own, _ = default_dt(scenario, solver, config)
    limit = block_limit(scenario, solver, config, own, task["precision"], Target(**task["target"]))
    return {
        "kind": task["kind"],
        "method": task["method"],
        "dt_limit_s": limit.dt,
        "dt_own_s": own,
        "dt_theory_s": solver.theory(scenario, config),
    }


def findings(points: Sequence[dict[str, Any]], blocks: Sequence[dict[str, Any]]) -> list[str]:
    """One sentence each: agreement with theory, whether defaults held, what narrows each method's step most."""
    lines = []
    for b in blocks:
        if "dt_limit_s" not in b:
            lines.append(f"{b['method']}, {b['kind']} block: {ERROR}: {b['reason']}.")
            continue
        ratio = b["dt_limit_s"] / b["dt_theory_s"]
        lines.append(
            f"{b['method']}, {b['kind']} block: stable up to dt = {b['dt_limit_s']:.3g} s, {ratio:.2f} of theory; the "
            f"method's own bound is {b['dt_own_s'] / b['dt_limit_s']:.2f} of what was measured."
        )
    verdicts = [p["verdict"] for p in points]
    counts = {v: verdicts.count(v) for v in (HELD, REFUSED, FAILED, ERROR)}
    lines.append(
        f"Default steps: {len(points)} points tried, {counts[HELD]} held, {counts[REFUSED]} refused, "
        f"{counts[FAILED]} failed" + f", {counts[ERROR]} could not be measured" * (counts[ERROR] > 0) + "."
    )
    pairs = dict.fromkeys((p["axis"], p["method"]) for p in points)
    lines += [_narrowing(points, axis, method) for axis, method in pairs]
    lines += [
        f"{p['method']}, {p['axis']} = {p['value']:g}: {p['verdict']}: {p['reason']}."
        for p in points
        if p.get("reason")
    ]
    return [line for line in lines if line]


def _narrowing(points: Sequence[dict[str, Any]], axis: str, method: str) -> str:
    own = [p for p in points if p["axis"] == axis and p["method"] == method and "dt_own_s" in p]
    if len(own) < 2:
        return ""
    low, high = min(own, key=lambda p: p["dt_own_s"]), max(own, key=lambda p: p["dt_own_s"])
    ratio = high["dt_own_s"] / low["dt_own_s"]
    if ratio < 1.5:
        return f"{method}: {axis} from {own[0]['value']:g} to {own[-1]['value']:g} leaves the step as it is."
    return (
        f"{method}: {axis} narrows the step {ratio:.3g}-fold, from {high['dt_own_s']:.3g} s at {high['value']:g} to "
        f"{low['dt_own_s']:.3g} s at {low['value']:g} (bound: {low['binding']})."
    )
