"""Towers of layers: what each layer is like, how the whole stands, and whether it is a success.

Particles belong to the layer during which they (or their ancestor) left the nozzle.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..particles import CARRIED
from ..scenario import Scenario

SECTORS = 48  # parts of a path in which a layer must have material
THIN = 0.4  # share of its usual mass per sector below which a layer is broken
SPAN = (0.05, 0.95)  # quantiles of mass between which a layer's width is taken
HEIGHT_TOLERANCE, RADIUS_TOLERANCE, CREEP = 0.25, 0.10, 0.05
Frame = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Criterion:
    """One condition of success, as measured and as wanted; `met` is for it alone."""

    name: str
    measured: float
    wanted: str
    met: bool


def is_tower(scenario: Scenario) -> bool:
    return scenario.toolpath is not None and scenario.toolpath.layers > 1


def layer_of(frame: Frame, scenario: Scenario) -> np.ndarray:
    """Layer of every particle, shape (n,); -1 while it is in the nozzle."""
    assert scenario.track is not None
    layer = scenario.track.layer_at(frame["birth_time"].astype(float) - 1e-9)
    return np.where(frame["held"] == CARRIED, -1, layer)


def measure_tower(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Per layer: mean height, width, continuity and, on a ring, radius and drift of the centre; lengths in metres."""
    path = scenario.toolpath
    assert path is not None
    layer, mass = layer_of(frame, scenario), frame["mass"].astype(float)
    x = frame["position"].astype(float)
    row: dict[str, float] = {}
    for k in range(path.layers):
        own = layer == k
        if not own.any():
            continue
        along, across, up = _path_coordinates(x[own], scenario)
        m = mass[own]
        name = f"layer_{k + 1}"
        row[f"{name}_level_m"] = float(np.average(up, weights=m))
        row[f"{name}_width_m"] = _spread(across, m) / (SPAN[1] - SPAN[0])
        row[f"{name}_continuity"] = _continuity(along, m)
        if path.kind == "ring" and path.center is not None and path.radius is not None:
            row[f"{name}_radius_m"] = path.radius + float(np.average(across, weights=m))
            center = np.average(x[own, :2], axis=0, weights=m)
            row[f"{name}_drift_m"] = float(np.hypot(*(center - path.center)))
    return row


def _path_coordinates(x: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(share of the path 0..1, distance across it [m], height above the floor [m]) of points (n, 3)."""
    path = scenario.toolpath
    assert path is not None
    up = x[:, 2] - scenario.domain.lower[2]
    if path.kind == "ring":
        arm = x[:, :2] - np.asarray(path.center)
        angle = np.arctan2(arm[:, 1], arm[:, 0]) / (2 * np.pi) % 1.0
        return angle, np.hypot(arm[:, 0], arm[:, 1]) - (path.radius or 0.0), up
    corners = path.corners()
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    best = np.full(len(x), np.inf)
    along, across = np.zeros(len(x)), np.zeros(len(x))
    for start, leg, length, before in zip(corners, legs, lengths, np.cumsum(lengths) - lengths, strict=False):
        unit = leg / length
        arm = x[:, :2] - start
        s = np.clip(arm @ unit, 0.0, length)
        distance = np.hypot(*(arm - s[:, None] * unit).T)
        side = arm @ np.array([-unit[1], unit[0]])
        near = distance < best
        best, along = np.where(near, distance, best), np.where(near, (before + s) / lengths.sum(), along)
        across = np.where(near, side, across)
    return along, across, up


def _spread(values: np.ndarray, weights: np.ndarray) -> float:
    """Distance between two quantiles of mass."""
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    low, high = (values[order][min(np.searchsorted(share, q), len(order) - 1)] for q in SPAN)
    return float(high - low)


def _continuity(along: np.ndarray, mass: np.ndarray) -> float:
    """Share of the path's sectors that hold at least THIN of the median mass."""
    sectors = np.bincount(np.minimum((along * SECTORS).astype(int), SECTORS - 1), mass, minlength=SECTORS)
    return float((sectors >= THIN * np.median(sectors)).mean())


def progress(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """What changes over time: share of mass that is cured to 95 %, and volume over fresh volume."""
    free = frame["held"] != CARRIED
    row: dict[str, float] = {}
    m = scenario.material
    mass = frame["mass"][free].astype(float)
    if not len(mass):
        return row
    if m.cure is not None:
        row["cured_share"] = float(mass[frame["phase"][free] >= 0.95 * m.cure.levels].sum() / mass.sum())
    if m.expansion is not None:
        row["volume_growth"] = float(frame["volume"][free].astype(float).sum() * m.density / mass.sum())
    return row


def family_spread(frame: Frame, ancestors: int) -> float:
    """Root mean square distance of offspring from the centre of their family [m]; 0 without offspring."""
    free = frame["held"] != CARRIED
    family = frame["origin"][free] % ancestors
    x, m = frame["position"][free].astype(float), frame["mass"][free].astype(float)
    total = np.bincount(family, m, minlength=ancestors)
    many = np.bincount(family, minlength=ancestors)[family] > 1
    if not many.any():
        return 0.0
    center = np.stack([np.bincount(family, m * x[:, i], minlength=ancestors) for i in range(3)], axis=1)
    arm = x - center[family] / total[family][:, None]
    return float(np.sqrt(np.average((arm[many] ** 2).sum(axis=1), weights=m[many])))


def success(scenario: Scenario, measures: Mapping[str, float], series: Any) -> list[dict[str, Any]]:
    """The paper's conditions, each alone: layers complete and continuous, height and radius within tolerance, stable
    after the last layer. `series` is the table of measures over time."""
    times, tops = series["time_s"].tolist(), series["top_m"].tolist()
    path, track, nozzle = scenario.toolpath, scenario.track, scenario.nozzle
    assert path is not None and track is not None and nozzle is not None
    names = [f"layer_{k + 1}" for k in range(path.layers)]
    laid = [n for n in names if f"{n}_level_m" in measures]
    worst = min((measures[f"{n}_continuity"] for n in laid), default=0.0)
    top = tops[-1] if len(tops) else 0.0
    plan = path.layers * (path.layer_height or nozzle.standoff)
    found = [
        Criterion("layers laid", len(laid), f"{path.layers}", len(laid) == path.layers),
        Criterion("continuity of the worst layer", worst, ">= 0.95", worst >= 0.95),
        Criterion("height over plan", top / plan, f"1 ± {HEIGHT_TOLERANCE:g}", abs(top / plan - 1) <= HEIGHT_TOLERANCE),
    ]
    if path.kind == "ring" and path.radius:
        off = max((abs(measures[f"{n}_radius_m"] / path.radius - 1) for n in laid), default=1.0)
        found.append(Criterion("worst radius error", off, f"<= {RADIUS_TOLERANCE:g}", off <= RADIUS_TOLERANCE))
    after = [h for t, h in zip(times, tops, strict=True) if t >= track.end]
    sunk = 1.0 - after[-1] / after[0] if len(after) > 1 and after[0] > 0 else float("nan")
    found.append(Criterion("sunk after the last layer", sunk, f"<= {CREEP:g}", bool(sunk <= CREEP)))
    return [vars(c) | {"met": bool(c.met)} for c in found]
