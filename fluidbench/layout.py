"""Bodies laid out as particles, on the host."""

import numpy as np

from .process.stream import Stream
from .scenario import Body, Scenario


def sample(body: Body, scenario: Scenario) -> tuple[np.ndarray, float]:
    """(positions (n, 3) [m], volume of a particle [m^3]) of a body's part inside the domain.

    A cubic lattice of the scenario's spacing, centred on the body; the particle volume makes the whole body's volume
    exact.
    """
    cells = np.maximum(1, np.rint(2.0 * body.extent / scenario.spacing).astype(int))
    axes = [(np.arange(n) + 0.5) * scenario.spacing - 0.5 * n * scenario.spacing for n in cells]
    if body.kind == "box":
        axes = [
            axis * (2.0 * half / (n * scenario.spacing)) for axis, half, n in zip(axes, body.extent, cells, strict=True)
        ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if body.kind == "cylinder":
        points = points[np.hypot(points[:, 0], points[:, 1]) <= body.extent[0]]
    elif body.kind == "sphere":
        points = points[np.linalg.norm(points, axis=1) <= body.extent[0]]
    volume = body.volume / len(points)
    points = points + np.asarray(body.center)
    if scenario.jitter:
        shift = np.random.default_rng(scenario.seed).uniform(-1, 1, points.shape)
        points = points + scenario.jitter * scenario.spacing * shift
    return points[scenario.domain.contains(points)], volume


def capacity_of(scenario: Scenario) -> int:
    """Particles that a scenario will ever hold."""
    bodies = sum(len(sample(body, scenario)[0]) for body in scenario.bodies)
    return bodies + (Stream(scenario).particles if scenario.nozzle is not None else 0)
