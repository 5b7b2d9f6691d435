"""Whether a method can run a scenario, and what it must respect while matter ages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..errors import UserError
from ..scenario.scenario import Scenario
from .contract import Method
from .features import needed
from .target import DEFAULT_BACKEND, HERE, Target
from .timestep import Bound, lost_speed

LOST = 0.1  # share of a scenario's own speed that single precision may lose

STILL = 1e-3  # reference speed of a scenario that implies no motion [m/s]: nothing can be lost


def check_backend(method: type[Method], target: Target) -> None:
    """Raise UserError unless the method has the target's backend, and runs on its kind of device."""
    if target.backend not in method.backends:
        raise UserError(f"{method.name} has no backend '{target.backend}'; it has {' and '.join(method.backends)}")
    if target.device.partition(":")[0] not in method.devices:
        raise UserError(f"{method.name} runs on {' and '.join(method.devices)} alone, not on {target.device}")
    if target.threads > 1 and not can_share(method, target):
        raise UserError(f"{method.name} runs on one thread of the CPU, not on {target.threads}")


def can_share(method: type[Method], target: Target) -> bool:
    """Whether several threads of the CPU can work for a method there; a GPU has its own."""
    return target.device == "cpu" and (target.backend != DEFAULT_BACKEND or method.shares_threads)


class Demands:
    """The materials of a scenario that bound a method's step, as its matter ages: the fresh one, which may always come,
    and the most demanding one that can be there by then."""

    def __init__(self, method: type[Method], scenario: Scenario, config: Any) -> None:
        self.ages, materials = scenario.aged
        self.scenarios, least = [], math.inf
        for material in materials:
            made = scenario.made_of(material)
            dt = min((b.dt for b in method.bounds(made, config, scenario.reference_speed)), default=math.inf)
            self.scenarios.append(made if dt < least or not self.scenarios else self.scenarios[-1])
            least = min(dt, least)

    def until(self, time: float) -> list[Scenario]:
        """The scenario as if made of each of those materials, up to a time [s]."""
        k = min(int(np.searchsorted(self.ages, time)), len(self.ages) - 1)
        return [self.scenarios[0]] if self.scenarios[k] is self.scenarios[0] else [self.scenarios[0], self.scenarios[k]]

    def unchanged_until(self, time: float) -> float:
        """How long what `until` says of a time [s] stays true [s]."""
        k = int(np.searchsorted(self.ages, time))
        return float(self.ages[k]) if k < len(self.ages) - 1 else math.inf

    def worst(self) -> Scenario:
        """The scenario made of the most demanding material of the whole run."""
        return self.scenarios[-1]


def refusal(method: type[Method], scenario: Scenario, config: Any, target: Target = HERE) -> str | None:
    """Why a method cannot run a scenario on a target, for reasons of its own or for want of precision; None when it
    can."""
    asked, lacking = needed(scenario), method.lacking.get(target.backend, frozenset())
    for missing, where in ((asked - method.features, ""), (asked & lacking, f" on the backend {target.backend}")):
        if missing:
            return f"it has no {' and no '.join(sorted(feature.value for feature in missing))}{where}"
    lost, binding = _lost(method, scenario, config)
    if binding is not None and scenario.reference_speed > STILL and lost > LOST * scenario.reference_speed:
        return (
            f"its step of {binding.dt:.2g} s (bound '{binding.name}') is too small for single precision: motion slower "
            f"than {lost:.2g} m/s would stand still; soften what binds it, or use a larger spacing"
        )
    return method.refuses(scenario, config)


def approximations(method: type[Method], scenario: Scenario, config: Any) -> list[str]:
    """What a method only approximates in a scenario, and the motion that its steps are too small to resolve."""
    lost, _ = _lost(method, scenario, config)
    slow = [f"motion slower than {lost:.2g} m/s is lost in single precision at this time step"]
    return method.approximates(scenario, config) + (slow if lost > 0.01 * scenario.reference_speed else [])


def _lost(method: type[Method], scenario: Scenario, config: Any) -> tuple[float, Bound | None]:
    """(speed that is lost at the method's step [m/s], the bound that binds it); nothing for one that picks its own."""
    worst = Demands(method, scenario, config).worst()
    bounds = method.bounds(worst, config, scenario.reference_speed)
    if not bounds:
        return 0.0, None
    binding, domain = min(bounds, key=lambda bound: bound.dt), scenario.domain
    return lost_speed(binding.dt, max(map(abs, (*domain.lower, *domain.upper)))), binding
