"""Towers of layers: what each layer is like, how the whole stands, and what became of the print.

Particles belong to the layer during which they (or their ancestor) left the nozzle. All is judged along the middle of
the path, in sectors no shorter than the deposit resolves, from what fills space: a lone particle decides nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario
from .collapse import LEANT, Collapse, collapse_of, posture
from .deposit import Deposit
from .feed import is_out

SECTORS = 48  # parts of a path in which a layer must have material, at most
SHORTEST = 3.0  # spacings that a sector is long, at least: shorter ones hold material by chance
THIN = 0.4  # share of the mass laid per length below which a layer is broken
BESIDE = 1.5  # nozzle diameters from the path (of expanded material) beyond which material is not its layer any more
SPAN = (0.05, 0.95)  # quantiles of mass between which a layer's width is taken
HEIGHT_TOLERANCE, RADIUS_TOLERANCE, CREEP, WHOLE = 0.25, 0.10, 0.05, 0.95


class Print(StrEnum):
    """What became of a print, the worst first."""

    INCOMPLETE = "incomplete"
    COLLAPSED = "collapsed"
    BROKEN = "broken"
    DEFORMED = "deformed"
    SOUND = "sound"


@dataclass(frozen=True)
class Criterion:
    """One condition of success, as measured and as wanted; `met` is for it alone, `failure` what it says if not."""

    name: str
    measured: float
    wanted: str
    met: bool
    failure: Print


def is_tower(scenario: Scenario) -> bool:
    path, track = scenario.toolpath, scenario.track
    return path is not None and track is not None and path.layers > 1 and path.speed > 0 and track.repeats


def is_wall(scenario: Scenario) -> bool:
    """Whether a tower's layers have a side to lean to: those of a ring hold each other."""
    return is_tower(scenario) and scenario.toolpath is not None and scenario.toolpath.kind != "ring"


def layer_of(frame: Frame, scenario: Scenario) -> np.ndarray:
    """Layer of every particle, shape (n,); -1 while it is in the nozzle."""
    assert scenario.track is not None
    layer = scenario.track.layer_at(frame["birth_time"].astype(float) - 1e-9)
    return np.where(is_out(frame, scenario), layer, -1)


def measure_tower(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Per layer: level, width, continuity and, on a ring, radius and drift of the centre; lengths in metres."""
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
        inner = _in_middle(along, scenario)
        if inner.any():
            row[f"{name}_level_m"] = _trimmed_mean(up[inner], m[inner])
        row[f"{name}_width_m"] = _spread(across, m) / (SPAN[1] - SPAN[0])
        row[f"{name}_continuity"] = _continuity(along, across, m, scenario)
        if path.kind == "ring" and path.center is not None and path.radius is not None:
            row[f"{name}_radius_m"] = path.radius + float(np.average(across, weights=m))
            center = np.average(x[own, :2], axis=0, weights=m)
            row[f"{name}_drift_m"] = float(np.hypot(*(center - path.center)))
    return row


def standing(deposit: Deposit, scenario: Scenario) -> dict[str, float]:
    """How high material stands on the path: the median over its sectors [m], and the share of sectors in which that is
    within HEIGHT_TOLERANCE of the plan or above."""
    heights = path_heights(deposit, scenario)
    low = (1.0 - HEIGHT_TOLERANCE) * plan_height(scenario)
    return {"print_height_m": float(np.median(heights)), "print_standing": float((heights >= low).mean())}


def wall_posture(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """How far the centre of any layer lies off the path of a wall, and how wide the lowest layer is, within the middle
    of the path [m]."""
    along, across, up = _path_coordinates(frame["position"].astype(float), scenario)
    layer = np.where(_in_middle(along, scenario), layer_of(frame, scenario), -1)
    found = posture(across, up, frame["mass"].astype(float), layer)
    return {name: found[name] for name in ("wall_lean_m", "foot_width_m")}


def wall_collapse(scenario: Scenario, series: Any) -> Collapse | None:
    """When and how a wall came down, from the table of measures over time; None if it stands."""
    path, track = scenario.toolpath, scenario.track
    assert path is not None and track is not None
    times = series["time_s"].to_numpy()
    whole = np.where(times < track.end * (1.0 - 1e-6), track.layer_at(times), path.layers)
    rows = [series[name].tolist() for name in ("wall_lean_m", "foot_width_m", "print_height_m")]
    return collapse_of(times.tolist(), whole.tolist(), plan_height(scenario) / path.layers, *rows)


def path_heights(deposit: Deposit, scenario: Scenario) -> np.ndarray:
    """Height of the deposit over each sector of the middle of the path, shape (sectors,) [m]: where the field, averaged
    along the sector, is half full for the last time, at the best of the lines within a quarter of the nozzle from the
    path. A lone particle fills no half of a sector that is SHORTEST cells long."""
    track, nozzle = scenario.track, scenario.nozzle
    assert track is not None and nozzle is not None
    reach = max(nozzle.diameter / 4, scenario.spacing)
    corners, edges = track.stroke.points, _sector_edges(scenario)
    low, high = (deposit.place(c) for c in (corners.min(axis=0) - reach, corners.max(axis=0) + reach))
    i, j = (grid.ravel() for grid in np.meshgrid(*map(np.arange, low, high + 1), indexing="ij"))
    x, y = (deposit.origin[axis] + deposit.spacing * index for axis, index in enumerate((i, j)))
    along, across, _ = _path_coordinates(np.stack([x, y, np.zeros(len(x))], axis=1), scenario)
    sector, line = np.searchsorted(edges, along, side="right") - 1, np.rint(across / deposit.spacing).astype(int)
    lines = int(np.ceil(reach / deposit.spacing))
    over = (np.abs(line) <= lines) & (np.abs(across) <= reach) & (sector >= 0) & (sector < len(edges) - 1)
    place = sector[over] * (2 * lines + 1) + line[over] + lines
    size = (len(edges) - 1) * (2 * lines + 1)
    columns = np.maximum(np.bincount(place, minlength=size), 1)
    inside = ((i >= 0) & (i < deposit.fill.shape[0]) & (j >= 0) & (j < deposit.fill.shape[1]))[over]
    filled = np.zeros((size, deposit.fill.shape[2]))
    np.add.at(filled, place[inside], deposit.fill[i[over][inside], j[over][inside]])
    profiles = (filled / columns[:, None]).reshape(len(edges) - 1, -1, deposit.fill.shape[2]).max(axis=1)
    floor = scenario.domain.lower[2]
    return np.array([max(deposit.level(profile) - floor, 0.0) for profile in profiles])


def plan_height(scenario: Scenario) -> float:
    """Height of the print as planned: its layers over one another [m]."""
    path, nozzle = scenario.toolpath, scenario.nozzle
    assert path is not None and nozzle is not None
    return path.layers * (path.layer_height or nozzle.standoff)


def _sector_edges(scenario: Scenario) -> np.ndarray:
    """Edges of the sectors of the middle of the path, as shares of it: all of a closed path; of an open one all but a
    nozzle's diameter (a quarter at most) at each end, where the nozzle turns."""
    path, nozzle, track = scenario.toolpath, scenario.nozzle, scenario.track
    assert path is not None and nozzle is not None and track is not None
    length = track.stroke.distance[-1]
    margin = 0.0 if path.kind == "ring" else min(nozzle.diameter / length, 0.25)
    count = int(np.clip(length * (1.0 - 2.0 * margin) / (SHORTEST * scenario.spacing), 1, SECTORS))
    return np.linspace(margin, 1.0 - margin, count + 1)


def _in_middle(along: np.ndarray, scenario: Scenario) -> np.ndarray:
    edges = _sector_edges(scenario)
    return (along >= edges[0]) & (along <= edges[-1])


def _path_coordinates(x: np.ndarray, scenario: Scenario) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(share of the path 0..1, distance across it [m], height above the floor [m]) of points (n, 3)."""
    path, track = scenario.toolpath, scenario.track
    assert path is not None and track is not None
    up = x[:, 2] - scenario.domain.lower[2]
    if path.kind == "ring":
        arm = x[:, :2] - np.asarray(path.center)
        angle = np.arctan2(arm[:, 1], arm[:, 0]) / (2 * np.pi) % 1.0
        return angle, np.hypot(arm[:, 0], arm[:, 1]) - (path.radius or 0.0), up
    corners = track.stroke.points
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    best = np.full(len(x), np.inf)
    along, across = np.zeros(len(x)), np.zeros(len(x))
    for start, leg, length, before in zip(corners, legs, lengths, np.cumsum(lengths) - lengths, strict=False):
        unit = leg / length
        dx, dy = x[:, 0] - start[0], x[:, 1] - start[1]
        s = np.clip(dx * unit[0] + dy * unit[1], 0.0, length)
        distance = np.hypot(dx - s * unit[0], dy - s * unit[1])
        side = dy * unit[0] - dx * unit[1]
        near = distance < best
        best, along = np.where(near, distance, best), np.where(near, (before + s) / lengths.sum(), along)
        across = np.where(near, side, across)
    return along, across, up


def _quantile(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value below which this share of mass lies."""
    order = np.argsort(values)
    below = np.cumsum(weights[order]) / weights.sum()
    return float(values[order][min(np.searchsorted(below, share), len(order) - 1)])


def _trimmed_mean(values: np.ndarray, weights: np.ndarray) -> float:
    """Mean without the outermost mass on either side."""
    low, high = (_quantile(values, weights, share) for share in SPAN)
    kept = (values >= low) & (values <= high)
    return float(np.average(values[kept], weights=weights[kept]))


def _spread(values: np.ndarray, weights: np.ndarray) -> float:
    """Distance between two quantiles of mass."""
    return _quantile(values, weights, SPAN[1]) - _quantile(values, weights, SPAN[0])


def _continuity(along: np.ndarray, across: np.ndarray, mass: np.ndarray, scenario: Scenario) -> float:
    """Share of the sectors that hold, near the path, at least THIN of the mass that the nozzle lays per length."""
    track, nozzle, expansion = scenario.track, scenario.nozzle, scenario.material.expansion
    assert track is not None and nozzle is not None
    wide = BESIDE * nozzle.diameter * (1.0 if expansion is None else expansion.ratio ** (1 / 3))
    near = np.abs(across) <= wide
    edges = _sector_edges(scenario)
    held, _ = np.histogram(along[near], edges, weights=mass[near])
    stroke = track.stroke
    fed = np.diff(np.interp(edges, stroke.distance / stroke.distance[-1], stroke.extruding))
    laid = scenario.material.density * nozzle.rate * fed
    return float((held >= THIN * laid)[laid > 0].mean())


def progress(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """What changes over time: mean degree of cure, share of mass cured to 95 %, and volume over fresh volume."""
    free = is_out(frame, scenario)
    row: dict[str, float] = {}
    m = scenario.material
    mass = frame["mass"][free].astype(float)
    if not len(mass):
        return row
    if m.cure is not None:
        phase = frame["phase"][free]
        row["mean_cure"] = float((phase * mass).sum() / mass.sum() / m.cure.levels)
        row["cured_share"] = float(mass[phase >= 0.95 * m.cure.levels].sum() / mass.sum())
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


def success(scenario: Scenario, measures: Mapping[str, float], series: Any) -> list[Criterion]:
    """The paper's conditions, each alone: layers complete and continuous, height and radius within tolerance, stable
    after the last layer. `series` is the table of measures over time."""
    path, track = scenario.toolpath, scenario.track
    assert path is not None and track is not None
    names = [f"layer_{k + 1}" for k in range(path.layers)]
    laid = [n for n in names if f"{n}_level_m" in measures]
    end = float(series["time_s"].iloc[-1])
    worst = min((measures[f"{n}_continuity"] for n in laid), default=0.0)
    tall = measures["print_height_m"] / plan_height(scenario)
    stands = measures["print_standing"]
    found = [
        Criterion("layers laid", len(laid), f"{path.layers}", len(laid) == path.layers, Print.INCOMPLETE),
        Criterion("path travelled", min(end / track.end, 1.0), "1", end >= track.end * (1 - 1e-6), Print.INCOMPLETE),
        Criterion(
            "height over plan",
            tall,
            f"1 ± {HEIGHT_TOLERANCE:g}",
            abs(tall - 1) <= HEIGHT_TOLERANCE,
            Print.COLLAPSED if tall < 1 else Print.DEFORMED,
        ),
        Criterion("share of the path that stands", stands, f">= {WHOLE:g}", stands >= WHOLE, Print.COLLAPSED),
        Criterion("continuity of the worst layer", worst, f">= {WHOLE:g}", worst >= WHOLE, Print.BROKEN),
    ]
    if path.kind == "ring" and path.radius:
        off = max((abs(measures[f"{n}_radius_m"] / path.radius - 1) for n in laid), default=1.0)
        met = off <= RADIUS_TOLERANCE
        found.append(Criterion("worst radius error", off, f"<= {RADIUS_TOLERANCE:g}", met, Print.DEFORMED))
    if is_wall(scenario):
        lean = measures["wall_lean_m"] / measures["foot_width_m"] if measures["foot_width_m"] > 0 else 0.0
        found.append(Criterion("lean over the foot's width", lean, f"< {LEANT:g}", lean < LEANT, Print.COLLAPSED))
    after = series.loc[series["time_s"] >= track.end, "print_height_m"].tolist()
    sunk = 1.0 - after[-1] / after[0] if len(after) > 1 and after[0] > 0 else float("nan")
    found.append(Criterion("sunk after the last layer", sunk, f"<= {CREEP:g}", bool(sunk <= CREEP), Print.DEFORMED))
    return [replace(c, met=bool(c.met)) for c in found]


def verdict_of(criteria: Sequence[Criterion]) -> Print:
    """What became of a print: the worst of what its unmet criteria say; settling that nobody saw says nothing."""
    failures = {c.failure for c in criteria if not c.met and c.measured == c.measured}
    return next((kind for kind in Print if kind in failures), Print.SOUND)
