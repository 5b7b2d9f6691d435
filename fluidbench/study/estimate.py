"""What a run will need, before anything runs: particles, substeps, memory and time."""

from dataclasses import dataclass
from typing import Any

from ..layout import capacity_of
from ..scenario import Scenario
from ..solver import Demands, Solver, approximations, configure, refusal
from ..timestep import Bound, Plan, plan


@dataclass(frozen=True)
class Estimate:
    """Expected needs of one method on one scenario; time is for one CPU core and good to a factor of two."""

    method: str
    refusal: str | None
    approximations: list[str]
    bounds: list[Bound]
    plan: Plan
    particles: int
    substeps: int
    memory_bytes: float
    wall_s: float


def estimate(scenario: Scenario, solver: type[Solver]) -> Estimate:
    """Bounds at the scenario's reference speed, and what follows from them."""
    config: Any = configure(solver, scenario)
    tick, ticks, _ = scenario.schedule
    bounds = solver.bounds(Demands(solver, scenario, config).worst(), config, scenario.reference_speed)
    steps = plan(bounds, tick)
    particles = capacity_of(scenario)
    filling = min(scenario.track.end / scenario.duration, 1.0) if scenario.track is not None else 0.0
    mean = particles * (1.0 - 0.5 * filling)
    return Estimate(
        method=solver.name,
        refusal=refusal(solver, scenario, config),
        approximations=approximations(solver, scenario, config),
        bounds=bounds,
        plan=steps,
        particles=particles,
        substeps=steps.substeps * ticks,
        memory_bytes=particles * solver.typical_bytes,
        wall_s=steps.substeps * ticks * mean / solver.typical_rate,
    )
