"""What `ablate` runs: one change at a time, then the leanest mix that stays within the tolerance."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..errors import UserError
from ..method.verdict import lacking
from ..registry import get_method
from ..runs.job import Job
from ..runs.record import Run
from ..scenario import Friction, Scenario
from ..scenario.numerics import configure
from .lengths import lengths_of
from .points import varied
from .workplace import Workplace

WORTH = 0.05  # a saving below this is lost in the noise of a shared machine

SOFTER, COARSER, QUIETER = 0.25, 1.25, 0.5  # factors on Young's modulus, spacing, sound speed


@dataclass(frozen=True)
class Change:
    """One thing made simpler: dotted keys and their new values (None takes a key out), for one method or for all."""

    name: str
    settings: dict[str, Any]
    method: str | None = None


@dataclass
class Effect:
    """What a change did to a method: how far which length moved, and the share of the time it saved."""

    change: Change
    method: str
    run: Run
    moved: float = float("nan")
    length: str = ""
    saved: float = float("nan")

    @property
    def ok(self) -> bool:
        return self.run.ok


@dataclass
class Ablation:
    """All effects, for each method the leanest mix that was confirmed by a run, and changes that make no scenario."""

    base: dict[str, Run]
    effects: list[Effect] = field(default_factory=list)
    lean: dict[str, Effect] = field(default_factory=dict)
    impossible: list[str] = field(default_factory=list)

    def changed(self) -> list[Run]:
        return [*(e.run for e in self.effects), *(e.run for e in self.lean.values())]

    def runs(self) -> list[Run]:
        return [*self.base.values(), *self.changed()]

    def missing(self) -> list[str]:
        """Runs that it needed and has nothing of; that a method refuses a change is an answer."""
        return lacking(self.base.values()) + lacking(self.changed(), refusals=False)


def changes(scenario: Scenario, methods: Sequence[str]) -> list[Change]:
    """Every physical feature that can be switched off, every numerical economy that can be switched on."""
    return [*features(scenario), *economies(scenario, methods)]


def features(scenario: Scenario) -> list[Change]:
    m, found = scenario.material, []
    if m.youngs_modulus is not None and not m.is_solid:
        liquid = {f"material.{key}": None for key in ("youngs_modulus", "yield_stress", "plastic_viscosity")}
        liquid |= {"material.relaxation_time": None, "material.viscosity": max(m.viscosity, m.plastic_viscosity)}
        found.append(Change("no elasticity, no yield: a Newtonian liquid", liquid))
    if m.yield_stress:
        found.append(Change("no yield stress", {"material.yield_stress": 0.0}))
    if m.plastic_viscosity > 0:
        found.append(Change("no plastic viscosity", {"material.plastic_viscosity": 0.0}))
    if m.viscosity > 0:
        found.append(Change("no viscosity", {"material.viscosity": 0.0}))
    processes = {"curing": "material.cure", "expansion": "material.expansion", "collider": "collider"}
    present = {"curing": m.cure, "expansion": m.expansion, "collider": scenario.collider}
    found += [Change(f"no {name}", {key: None}) for name, key in processes.items() if present[name] is not None]
    rough = {f"domain.walls.{face}": "slip" for face, wall in scenario.domain.walls if isinstance(wall, Friction)}
    if rough:
        found.append(Change("no friction", rough))
    if scenario.domain.walls.z_lower == "stick":
        found.append(Change("slip floor", {"domain.walls.z_lower": "slip"}))
    return found


def economies(scenario: Scenario, methods: Sequence[str]) -> list[Change]:
    m = scenario.material
    found = [Change("coarser spacing", {"spacing": COARSER * scenario.spacing})]
    if m.youngs_modulus is not None:
        found.append(Change("softer elasticity", {"material.youngs_modulus": SOFTER * m.youngs_modulus}))
    elif m.sound_speed is None and m.bulk_modulus is None:
        found.append(Change("slower sound", {"sound_speed_ratio": QUIETER * scenario.sound_speed_ratio}))
    for name in methods:
        method = get_method(name)
        found += [
            Change(economy.name, {f"numerics.{name}.{key}": value for key, value in economy.settings.items()}, name)
            for economy in method.economies(scenario, configure(method, scenario))
        ]
    return found


def ablation(scenario: Scenario, methods: Sequence[str], tolerance: float, place: Workplace) -> Ablation:
    """Run everything; the leanest mixes last."""

    def job(settings: dict[str, Any], method: str) -> Job:
        changed = varied(scenario.model_dump(mode="json"), settings)
        return Job(changed.model_dump(mode="json"), method, place.target, wall_limit=place.wall_limit)

    wanted = [(c, m) for c in changes(scenario, methods) for m in methods if c.method in (None, m)]
    planned, impossible = [], []
    for change, method in wanted:
        try:
            planned.append((change, method, job(change.settings, method)))
        except UserError as error:  # a nozzle too fine for the coarser spacing, say
            impossible.append(f"{method}: {change.name}: not possible here: {error}")
    runs = place.run([job({}, m) for m in methods] + [j for *_, j in planned], "ablate", together=True)
    impossible += [
        f"{m}: it picks its own step: nothing of its own was relaxed" for m in methods if _steps_itself(m, scenario)
    ]
    result = Ablation(dict(zip(methods, runs, strict=False)), impossible=impossible)
    for (change, method, _), run in zip(planned, runs[len(methods) :], strict=True):
        result.effects.append(effect(change, method, run, result.base[method]))
    for method in methods:
        if result.base[method].ok:
            lean = _leanest(result, method, tolerance, lambda s, m: place.run([job(s, m)], "leanest mix")[0])
            if lean is not None:
                result.lean[method] = lean
    return result


def _steps_itself(name: str, scenario: Scenario) -> bool:
    method = get_method(name)
    config = configure(method, scenario)
    return not method.bounds(scenario, config, scenario.reference_speed) and not method.economies(scenario, config)


def effect(change: Change, method: str, run: Run, base: Run) -> Effect:
    """Compare a run with the unchanged one."""
    seen = Effect(change, method, run)
    if run.ok and base.ok:
        before, after = lengths_of(base.record), lengths_of(run.record)
        shifts = {key: abs(after.get(key, 0.0) / value - 1.0) for key, value in before.items() if value}
        seen.length, seen.moved = max(shifts.items(), key=lambda item: item[1], default=("", float("nan")))
        clock = "cpu_s" if base.record.device == "cpu" else "wall_s"
        seen.saved = 1.0 - getattr(run.cost, clock) / getattr(base.cost, clock)
    return seen


def _leanest(result: Ablation, method: str, tolerance: float, run: Any) -> Effect | None:
    """Join the changes that save most while their shifts add up to less than the tolerance; confirm by a run, and leave
    out the one that moves most until the run agrees."""
    free = [e for e in result.effects if e.method == method and e.ok and e.saved > WORTH and e.moved <= tolerance]
    chosen: list[Effect] = []
    for candidate in sorted(free, key=lambda e: -e.saved):
        if sum(e.moved for e in chosen) + candidate.moved <= tolerance and not _clash(candidate, chosen):
            chosen.append(candidate)
    while chosen:
        settings = {key: value for e in chosen for key, value in e.change.settings.items()}
        joined = Change(" + ".join(e.change.name for e in chosen), settings, method)
        seen = effect(joined, method, run(settings, method), result.base[method])
        if seen.ok and seen.moved <= tolerance and seen.saved > WORTH:
            return seen
        chosen.remove(max(chosen, key=lambda e: e.moved))
    return None


def _clash(candidate: Effect, chosen: Sequence[Effect]) -> bool:
    return any(set(candidate.change.settings) & set(e.change.settings) for e in chosen)


def command(scenario: str, given: Sequence[str], seen: Effect) -> str:
    """The command that runs a lean mix alone, on top of the settings given (key=value)."""
    own = [text for text in given if text.split("=")[0].strip() not in seen.change.settings]
    sets = " ".join(
        f"--set {shlex.quote(text)}" for text in [*own, *(f"{k}={_toml(v)}" for k, v in seen.change.settings.items())]
    )
    return f"fluidbench run {shlex.quote(scenario)} --solver {seen.method}{seen.run.target.alone} {sets}"


def _toml(value: Any) -> str:
    return "none" if value is None else str(value)
