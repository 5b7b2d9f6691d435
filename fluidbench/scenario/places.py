"""Whether nozzle, bodies and collider lie where they can."""

from typing import TYPE_CHECKING

import numpy as np

from .body import Body

if TYPE_CHECKING:
    from .scenario import Scenario

NOZZLE = "nozzle (standoff and layers)"
VOLUMES = 2.0  # largest factor between a particle's own volume and spacing^3


def check_nozzle(scenario: "Scenario") -> None:
    """A nozzle that particles fit into, on a path inside the domain."""
    if scenario.nozzle is None or scenario.track is None:
        return
    if scenario.spacing > scenario.nozzle.diameter / 2:
        raise ValueError(
            f"spacing = {scenario.spacing} is too coarse for nozzle.diameter = {scenario.nozzle.diameter}: "
            "at least 2 particles must fit across it, 8 resolve a bead"
        )
    r = scenario.nozzle.diameter / 2
    margin = np.array([r, r, 0.0])
    low, high = scenario.track.position.min(axis=0) - margin, scenario.track.position.max(axis=0) + margin
    if scenario.fed_from is not None:
        high[2] = scenario.fed_from
    for axis, a, b in zip("xyz", low, high, strict=True):
        i = "xyz".index(axis)
        if a < scenario.domain.lower[i] or b > scenario.domain.upper[i]:
            what = "nozzle (standoff, layers, bore and what feeds it)" if scenario.fed_from is not None else NOZZLE
            what = what if axis == "z" else "toolpath (with the nozzle's radius)"
            raise ValueError(
                f"the {what} spans {axis} = {a:.6g} .. {b:.6g} m and leaves the domain, which spans "
                f"{scenario.domain.lower[i]:.6g} .. {scenario.domain.upper[i]:.6g} m"
            )


def check_bodies(scenario: "Scenario") -> None:
    """Bodies of some thickness inside the domain, which appear before the end."""
    for i, body in enumerate(scenario.bodies):
        low, high = np.asarray(body.center) - body.extent, np.asarray(body.center) + body.extent
        if (high <= scenario.domain.lower).any() or (low >= scenario.domain.upper).any():
            raise ValueError(f"bodies.{i} lies outside the domain")
        if body.positions is None and (2 * body.extent < scenario.spacing).any():
            raise ValueError(f"bodies.{i} is thinner than one particle spacing ({scenario.spacing} m)")
        _check_volumes(scenario, i, body)
        if body.start > 0 and body.start > scenario.duration - scenario.schedule[0]:
            raise ValueError(f"bodies.{i}: start = {body.start} s is not before the last tick of {scenario.duration} s")


def _check_volumes(scenario: "Scenario", i: int, body: Body) -> None:
    if body.volumes is None:
        return
    low, high = (float(v) / scenario.spacing**3 for v in (body.volumes.array.min(), body.volumes.array.max()))
    if low < 1 / VOLUMES or high > VOLUMES:
        raise ValueError(
            f"bodies.{i}: volumes span {low:.3g} .. {high:.3g} spacing^3; a particle stands for one, within a "
            f"factor of {VOLUMES:g}"
        )


def check_collider(scenario: "Scenario") -> None:
    """A collider that starts clear of bodies and of the material that leaves the nozzle."""
    if scenario.collider is None:
        return
    if scenario.track is None or scenario.nozzle is None:
        raise ValueError("collider: it is carried along the toolpath; give nozzle and toolpath")
    start, r = scenario.track.at(0.0), scenario.nozzle.diameter / 2
    for i, body in enumerate(scenario.bodies):
        low, high = np.asarray(body.center) - body.extent, np.asarray(body.center) + body.extent
        grid = [np.linspace(a, b, 9) for a, b in zip(low, high, strict=True)]
        points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3)
        if (scenario.collider.distance(points - start) < 0).any():
            raise ValueError(f"collider: it starts inside bodies.{i}; raise collider.clearance or move the body")
    jet = np.array(
        [[x, y, z] for x in (-r, 0, r) for y in (-r, 0, r) for z in np.linspace(-scenario.nozzle.standoff, 0, 9)]
    )
    if (scenario.collider.distance(jet) < 0).any():
        raise ValueError("collider: it starts inside the material that leaves the nozzle; raise collider.clearance")
