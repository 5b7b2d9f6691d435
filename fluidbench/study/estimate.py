"""What a run will need, before anything runs: particles, substeps, memory and time."""

from dataclasses import dataclass
from typing import Any

from ..method.contract import Method
from ..method.suitability import Demands, approximations, refusal
from ..method.timestep import Bound, Plan, plan
from ..runs.needs import memory_needed
from ..scenario import Scenario
from ..scenario.layout import capacity_of
from ..scenario.numerics import configure


@dataclass(frozen=True)
class Estimate:
    """Expected needs of one method on one scenario; time is for one CPU core and good to a factor of two. A method that
    picks its own step has no plan, and nothing that follows from one."""

    method: str
    refusal: str | None
    approximations: list[str]
    bounds: list[Bound]
    plan: Plan | None
    particles: int
    substeps: int | None
    memory_bytes: float
    wall_s: float | None


def estimate(scenario: Scenario, solver: type[Method]) -> Estimate:
    """Bounds at the scenario's reference speed, and what follows from them."""
    config: Any = configure(solver, scenario)
    tick, ticks, _ = scenario.schedule
    bounds = solver.bounds(Demands(solver, scenario, config).worst(), config, scenario.reference_speed)
    steps = plan(bounds, tick) if bounds else None
    substeps = None if steps is None else steps.substeps * ticks
    particles = capacity_of(scenario)
    filling = min(scenario.track.end / scenario.duration, 1.0) if scenario.track is not None else 0.0
    mean = particles * (1.0 - 0.5 * filling)
    weight = solver.weight_of_a_step(scenario, config)
    return Estimate(
        method=solver.name,
        refusal=refusal(solver, scenario, config),
        approximations=approximations(solver, scenario, config),
        bounds=bounds,
        plan=steps,
        particles=particles,
        substeps=substeps,
        memory_bytes=memory_needed(scenario, solver),
        wall_s=None if substeps is None else weight * substeps * mean / solver.typical_rate,
    )
