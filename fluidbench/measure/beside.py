"""What a run has of what somebody measured, and what no run of a scenario can have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..scenario import Scenario
from ..scenario.measured import ALONG, Measured
from .bead import stations
from .ledger import bead_of, deposit_of
from .tower import is_tower

if TYPE_CHECKING:
    from ..runs.record import Run

OF_A_CYLINDER, OF_A_BOX = ("slump", "spread_radius_m"), ("front_x_m", "height_m")
NEAR = 1e-6  # of a path by which a place may lie beyond its end: lengths are written rounded


def computed(run: Run, measured: Sequence[Measured]) -> list[float]:
    """The values in a finished run [SI], NaN where it has none."""
    bead = None
    if any(one.place is not None for one in measured):
        frame = run.frame()
        bead = bead_of(frame, deposit_of(frame, run.scenario), run.scenario)
    found = []
    for one in measured:
        if one.place is None:
            found.append(run.record.measures.get(one.key, math.nan))
        elif bead is None or not _is_along(one.place, bead.station):
            found.append(math.nan)
        else:
            found.append(float(np.interp(one.place, bead.station, getattr(bead, ALONG[one.key]))))
    return found


def _is_along(place: float, station: np.ndarray) -> bool:
    return bool(station[0] - NEAR * station[-1] <= place <= station[-1] * (1.0 + NEAR))


def wanting(one: Measured, scenario: Scenario) -> str | None:
    """Why no run of a scenario has what was measured, the column first, and what would be right; None where it may."""
    if one.layer is not None:
        return _wanting_of_a_layer(one, one.layer, scenario)
    moves = scenario.track is not None and scenario.toolpath is not None and scenario.toolpath.speed > 0
    if one.key in ALONG and not moves:
        instead = "; of a block it is height_m, of anything top" if one.key == "bead_height_m" else ""
        return f"quantity: {one.words} is of a bead, and the scenario has no path that one is laid along{instead}"
    if one.place is not None and not _is_along(one.place, station := stations(scenario)):
        low, high = 1e3 * station[0], 1e3 * station[-1]
        return f"place: beads are measured from {low:.6g} to {high:.6g} mm along the path (got {1e3 * one.place:g} mm)"
    if one.key == "print_height_m" and not is_tower(scenario):
        return f"quantity: {one.words} is of layers on top of each other, and the scenario has none; top is of anything"
    if one.key == "ring_drift_m" and not (moves and _is_ring(scenario)):
        return f"quantity: {one.words} is of a ring, and the scenario has none"
    for kind, keys in (("cylinder", OF_A_CYLINDER), ("box", OF_A_BOX)):
        if one.key in keys and not _begins_with(kind, scenario):
            later = any(body.start > 0 for body in scenario.bodies)
            why = "a body comes later (start)" if later else "the first body is none"
            return f"quantity: {one.words} is of a {kind} that is there at the start, and {why}"
    return None


def _wanting_of_a_layer(one: Measured, layer: int, scenario: Scenario) -> str | None:
    layers = 0 if scenario.toolpath is None else scenario.toolpath.layers
    if layer > layers:
        return f"layer: the scenario has {layers or 'no'} layer{'s' * (layers != 1)} (got {layer})"
    name = one.key.removeprefix(f"layer_{layer}_")
    if name == "height_m" and layer == 1:
        return "layer: a layer's height is its rise above the one below, from layer 2 on (got 1)"
    if not is_tower(scenario):
        return f"layer: {one.words} is of layers on top of each other, and the scenario has none; take the layer out"
    if name in ("radius_m", "drift_m") and not _is_ring(scenario):
        return f"quantity: {one.words} is of a ring, and the scenario has none"
    return None


def _is_ring(scenario: Scenario) -> bool:
    return scenario.toolpath is not None and scenario.toolpath.kind == "ring"


def _begins_with(kind: str, scenario: Scenario) -> bool:
    """Whether the body that slump and front are measured of is of this kind (measure_slump)."""
    bodies = scenario.bodies
    if not bodies or any(body.start > 0 for body in bodies) or bodies[0].kind != kind:
        return False
    return kind == "box" or bodies[0].where is None
