"""Whether a scenario fits into memory, into single precision and into a computer's time: judged by its numbers alone,
before anything is laid out."""

import math
from typing import TYPE_CHECKING

from .model import LEAST

if TYPE_CHECKING:
    from .scenario import Scenario

ADDRESSABLE = 2**26  # particles: neighbour lists keep 26 bits for an index
RESOLVED = 2**18  # spacings from the origin at which single precision still resolves a 64th of a spacing
MOST_TICKS, MOST_OUTPUTS = 10**8, 10**6


def check_size(scenario: "Scenario") -> None:
    """Enough room in memory and in single precision, before anything is laid out."""
    d, domain = scenario.spacing, scenario.domain
    boxes = [
        math.prod(2.0 * float(edge) / d + 1.0 for edge in body.extent)
        if body.positions is None
        else len(body.positions)
        for body in scenario.bodies
    ]
    stream = 0.0
    if scenario.nozzle is not None:
        stream = scenario.nozzle.rate * scenario.duration / d**3 + (scenario.nozzle.diameter / d + 5.0) ** 2
    expansion = scenario.material.expansion
    most = (sum(boxes) + stream) * (1.0 if expansion is None else 2.0 * expansion.ratio)
    if scenario.pool is not None and scenario.pool > ADDRESSABLE:
        raise ValueError(f"pool = {float(scenario.pool):.6g}: {too_many(scenario.pool)}")
    if most > 8.0 * ADDRESSABLE:  # bodies may fill little of their boxes; the exact count is judged later
        raise ValueError(f"spacing = {d:g} m: bodies and nozzle would be {too_many(most)}")
    far = max(map(abs, (*domain.lower, *domain.upper)))
    if far > RESOLVED * d:
        cells = math.prod((high - low) / d for low, high in zip(domain.lower, domain.upper, strict=True))
        raise ValueError(
            f"domain: it reaches to {far:.6g} m, {far / d:.3g} spacings, and holds as much as {too_many(cells)}; "
            f"single precision resolves positions up to {RESOLVED} spacings ({RESOLVED * d:.3g} m): use a larger "
            "spacing or a smaller domain"
        )
    if 0 < abs(scenario.material.poisson_ratio) < LEAST:
        raise ValueError(f"material.poisson_ratio = {scenario.material.poisson_ratio:g} is beyond any physics; give 0")


def check_time(scenario: "Scenario") -> None:
    """A number of ticks and outputs that a computer comes to the end of."""
    outputs = scenario.duration / min(scenario.output_interval or scenario.duration / 20.0, scenario.duration)
    if outputs > MOST_OUTPUTS:
        raise ValueError(
            f"output_interval = {scenario.output_interval:g} s makes {outputs:.3g} outputs of {scenario.duration:g} s; "
            f"at most {MOST_OUTPUTS} are measured and kept"
        )
    ticks = scenario.duration / (scenario.tick or 0.25 * scenario.spacing / scenario.reference_speed)
    if ticks > MOST_TICKS:
        spacing = f"spacing = {scenario.spacing:g} m, {scenario.reference_speed:.3g} m/s"
        key = f"tick = {scenario.tick:g} s" if scenario.tick else spacing
        raise ValueError(
            f"duration = {scenario.duration:g} s at {key} makes {ticks:.3g} ticks of a substep or more; at most "
            f"{MOST_TICKS} end in a day"
        )


def too_many(particles: float) -> str:
    """What a number of particles would take, and what there is."""
    import psutil

    there, particles = psutil.virtual_memory().available / 2**30, float(particles)
    return (
        f"{particles:.3g} particles, at some 300 bytes each {300 * particles / 2**30:.3g} GiB at least; "
        f"{ADDRESSABLE} can be addressed, and this machine has {there:.3g} GiB left"
    )
