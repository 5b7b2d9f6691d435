"""Bodies laid out as particles, on the host."""

import math
from typing import NamedTuple

import numpy as np

from ..errors import UserError
from .body import Body
from .expression import evaluate
from .scenario import Scenario
from .stream import Stream


class Layout(NamedTuple):
    """Particles of a body inside the domain: positions (n, 3) [m], velocities (n, 3) [m/s], volumes (n,) [m^3]."""

    position: np.ndarray
    velocity: np.ndarray
    volume: np.ndarray


def lay_out(body: Body, scenario: Scenario) -> Layout:
    """A body as particles: those of its shape, or those that it gives one by one."""
    if body.positions is None:
        points, volume = sample(body, scenario)
        return Layout(points, body.velocity_at(points), np.full(len(points), volume))
    points, n = body.positions.array, len(body.positions)
    kept = scenario.domain.contains(points)
    kept &= np.ones(n, bool) if body.where is None else evaluate(body.where, points) > 0
    velocities = body.velocity_at(points) + (0.0 if body.velocities is None else body.velocities.array)
    volumes = np.full(n, scenario.spacing**3) if body.volumes is None else body.volumes.array
    return Layout(points[kept], velocities[kept], volumes[kept])


def sample(body: Body, scenario: Scenario) -> tuple[np.ndarray, float]:
    """(positions (n, 3) [m], volume of a particle [m^3]) of a body's part inside the domain.

    A cubic lattice of about the scenario's spacing, centred on the body: whole layers along the axes of a box and of a
    cylinder, then stretched by a percent or so until every point owns its share of the body. Density read from
    positions is so that at rest, and the volume is exact.
    """
    edges = 2.0 * body.extent
    cells = np.maximum(1, np.rint(edges / scenario.spacing).astype(int))
    faces = np.stack([scenario.domain.lower, scenario.domain.upper])
    halved = (np.abs(faces - np.asarray(body.center)) < 1e-9 * edges).any(axis=0)
    even = 2 * np.maximum(1, np.rint(edges / (2 * scenario.spacing)).astype(int))
    cells = np.where(halved, even, cells)  # an odd number would put a layer of particles into the face that cuts it
    step = edges / cells if body.kind == "box" else np.full(3, scenario.spacing)
    if body.kind == "cylinder":
        step[2] = edges[2] / cells[2]
    axes = [(np.arange(n) + 0.5 - 0.5 * n) * size for n, size in zip(cells, step, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    round_axes = {"box": 0, "cylinder": 2, "sphere": 3}[body.kind]
    if round_axes:
        points = points[np.linalg.norm(points[:, :round_axes], axis=1) <= body.extent[0]]
    volume = body.volume / len(points)
    points[:, :round_axes] *= (volume / step.prod()) ** (1.0 / max(round_axes, 1))
    points = points + np.asarray(body.center)
    if scenario.jitter:
        shift = np.random.default_rng(scenario.seed).uniform(-1, 1, points.shape)
        points = points + scenario.jitter * scenario.spacing * shift
    kept = scenario.domain.contains(points)
    if body.where is not None:
        kept &= evaluate(body.where, points) > 0
    return points[kept], volume


def sources(scenario: Scenario) -> list[tuple[int, float]]:
    """(particles, largest rest volume of one [m^3]) of every body and of the nozzle's stream, without offspring."""
    laid = [lay_out(body, scenario) for body in scenario.bodies]
    found = [(len(own.volume), float(own.volume.max(initial=0.0))) for own in laid]
    if scenario.nozzle is not None:
        stream = Stream(scenario)
        found.append((stream.particles, stream.volume))
    return found


def emitted(scenario: Scenario) -> int:
    """Particles that a scenario brings in, without offspring."""
    return sum(count for count, _ in sources(scenario))


def generations(scenario: Scenario) -> int:
    """How often a particle and its offspring may split or spawn in a row."""
    model = scenario.material.expansion
    if model is None:
        return 0
    if model.kind == "spawn":
        return model.passes
    return max(model.generations(volume / scenario.spacing**3) for _, volume in sources(scenario))


def capacity_of(scenario: Scenario) -> int:
    """Particles to preallocate: the scenario's `pool`, or what it will ever hold (six standard deviations above the
    mean where offspring come by chance).

    Raises UserError when `pool` is smaller than that.
    """
    need, model = emitted(scenario), scenario.material.expansion
    if model is not None:
        certain = model.kind == "growth" or model.per_pass == int(model.per_pass)
        expected = need * (2.0 ** generations(scenario) if model.kind == "growth" else model.ratio)
        need = math.ceil(expected - 1e-9 if certain else expected + 6.0 * model.ratio * math.sqrt(need))
    if scenario.pool is not None and scenario.pool < need:
        raise UserError(f"pool = {scenario.pool} is too small: {scenario.name} will hold up to {need} particles")
    return scenario.pool or need
