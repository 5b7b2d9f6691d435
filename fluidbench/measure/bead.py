"""Beads and layers along the path that the nozzle took."""

from dataclasses import dataclass

import numpy as np

from ..scenario import Scenario
from .deposit import Deposit, Section, cut

MIDDLE = (0.2, 0.8)  # share of the path over which a bead's averages are taken
BEGUN = 3.0  # nozzle diameters of path that a strand may be drawn along as it is begun: thin there, heavy before it
STRAIGHT = 0.9  # cosine of the turn from which a corner is one: 26 degrees
BESIDE = 1.0  # nozzle diameters from a corner within which no section is taken


@dataclass(frozen=True)
class Bead:
    """Sections along one layer of the path; all arrays of shape (stations,)."""

    station: np.ndarray  # distance along the path [m]
    width: np.ndarray  # [m]
    height: np.ndarray  # [m]
    area: np.ndarray  # [m^2]
    matter: np.ndarray  # its volume per length [m^2]
    middle: Section
    laid: float = 1.0  # share of the path that the nozzle has come
    begun: float = 0.0  # length of path that its begin disturbs [m]

    @property
    def _inner(self) -> np.ndarray:
        return in_middle(self.station, self.laid * self.station[-1], self.begun)

    def _mean(self, values: np.ndarray) -> float:
        return float(values[self._inner].mean())

    def summary(self, layers: int) -> dict[str, float]:
        """Averages over the middle of what was laid of the path, per layer where that is meant; nothing where that is
        too short to have a middle."""
        if not self._inner.any():
            return {}
        inner = self.area[self._inner]
        return {
            "bead_width_m": self._mean(self.width),
            "bead_height_m": self._mean(self.height),
            "bead_area_m2": self._mean(self.area) / layers,
            "bead_matter_m2": self._mean(self.matter) / layers,
            "bead_continuity": float((inner > 0.5 * max(np.median(inner), 1e-30)).mean()),
        }


def measure_bead(deposit: Deposit, scenario: Scenario, laid: float = 1.0) -> Bead | None:
    """Sections every spacing along the longest stroke of the first layer, of which the nozzle has come the share
    `laid`; None without a moving nozzle."""
    path, nozzle = scenario.toolpath, scenario.nozzle
    if path is None or nozzle is None or scenario.track is None or path.speed == 0:
        return None
    stroke = scenario.track.stroke
    legs = np.diff(stroke.points, axis=0) / np.diff(stroke.distance)[:, None]
    station = stations(scenario)
    points = np.stack([np.interp(station, stroke.distance, stroke.points[:, i]) for i in range(2)], axis=1)
    height = deposit.origin[2] + (deposit.fill.shape[2] - 0.5) * deposit.spacing - scenario.domain.lower[2]
    expansion = scenario.material.expansion
    reach = 2.5 * nozzle.diameter * (1.0 if expansion is None else expansion.ratio ** (1 / 3))
    if path.kind == "ring" and path.radius is not None:
        reach = min(reach, path.radius)  # not as far as the other side
    sections = [
        cut(deposit, p, legs[i], reach, height, scenario.domain.lower[2])
        for p, i in zip(points, leg_at(scenario, station), strict=True)
    ]
    columns = (np.array([getattr(s, key) for s in sections]) for key in ("width", "height", "area", "matter"))
    middle = sections[int(laid * (len(station) // 2))]
    return Bead(station, *columns, middle=middle, laid=laid, begun=BEGUN * nozzle.diameter)


def stations(scenario: Scenario) -> np.ndarray:
    """Distances along the path at which sections are taken [m]: every spacing, 12 at least and 160 at most, without
    those beside a corner, which would cut the other leg as well."""
    assert scenario.track is not None and scenario.nozzle is not None
    stroke = scenario.track.stroke
    length = stroke.distance[-1]
    station = np.linspace(0.0, length, int(np.clip(length / scenario.spacing, 12, 160)))
    legs = np.diff(stroke.points, axis=0) / np.diff(stroke.distance)[:, None]
    sharp = stroke.distance[1:-1][(legs[1:] * legs[:-1]).sum(axis=1) < STRAIGHT]
    apart = np.abs(station[:, None] - sharp).min(axis=1, initial=np.inf) >= BESIDE * scenario.nozzle.diameter
    return station[apart] if apart.any() else station


def leg_at(scenario: Scenario, station: np.ndarray) -> np.ndarray:
    """The leg of the path that each station lies on."""
    assert scenario.track is not None
    knots = scenario.track.stroke.distance
    return np.clip(np.searchsorted(knots, station, side="right") - 1, 0, len(knots) - 2)


def planned_area(scenario: Scenario) -> float:
    """Q / V [m^2], averaged over the stations of which a bead's averages are taken, once all of it was laid."""
    assert scenario.track is not None and scenario.nozzle is not None
    station = stations(scenario)
    inner = station[in_middle(station, station[-1], BEGUN * scenario.nozzle.diameter)]
    return scenario.nozzle.rate * float(scenario.track.stroke.fed[leg_at(scenario, inner)].mean())


def in_middle(station: np.ndarray, laid: float, begun: float) -> np.ndarray:
    """Whether averages are taken there, at distances along the path of which a length was laid [m]: in its middle 60 %,
    and beyond what its begin disturbs unless that is more than half of it."""
    low, high = (share * laid for share in MIDDLE)
    return (station >= (max(low, begun) if begun <= 0.5 * laid else low)) & (station <= high)


def laid_share(birth_time: np.ndarray, scenario: Scenario) -> float:
    """Share of the measured stroke that the nozzle has come when the last of these particles left it."""
    path, track, nozzle = scenario.toolpath, scenario.track, scenario.nozzle
    if path is None or track is None or nozzle is None or path.speed == 0 or not len(birth_time):
        return 1.0
    disc = scenario.spacing * (1.0 + path.speed / nozzle.speed)  # that the last of them may have been early
    stroke = track.stroke
    come = float(np.interp(float(birth_time.max()), stroke.time, stroke.distance)) + disc
    return min(come / stroke.distance[-1], 1.0)


def layer_heights(position: np.ndarray, birth_time: np.ndarray, scenario: Scenario) -> list[float]:
    """Rise of the mean height from each layer to the next [m]; empty for one layer."""
    track = scenario.track
    if track is None or scenario.toolpath is None or scenario.toolpath.layers < 2:
        return []
    layer = track.layer_at(birth_time - 1e-9)
    mean = [position[layer == i, 2].mean() for i in range(scenario.toolpath.layers) if (layer == i).any()]
    return [float(step) for step in np.diff(mean)]
