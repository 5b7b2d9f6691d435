"""In what order matter ended: how near particles came, and how dense it is."""

from __future__ import annotations

import numpy as np

from ..method.frame import CARRIED, Frame
from ..scenario import Scenario

DEPARTED = 0.05  # of mean density from rest, beyond which a run says so
LOOSE = 0.1  # the same of packing, which is known to a few per cent, from mean density
TURN = (0.2, 0.25, 0.3)  # of the cells in which packing is told, about the axes [rad]
DEPTH, LEAST, MOST = 2, 300, 4_000_000  # cells below a surface, and of how many packing is told
SAMPLED = 64  # every such particle's nearest tells how near others are worth a look
CELL = 2.0  # edge of the cells in which particles are counted, in spacings


def order(frame: Frame, scenario: Scenario) -> dict[str, float]:
    """Least distance of two particles over their spacing at rest; least, mean and largest density over that at rest, by
    what the method itself takes them for; most particles in a cell of two spacings over the eight of a lattice; and
    `packing`. Nothing of a single particle."""
    free = frame["held"] != CARRIED
    if free.sum() < 2:
        return {}
    place, volume = frame["position"].compress(free, axis=0).astype(float), frame["volume"][free].astype(float)
    density = frame["density"][free] * volume / frame["mass"][free]
    cells = np.floor((place - place.min(axis=0)) / (CELL * scenario.spacing)).astype(np.int64)
    width = cells.max(axis=0) + 1
    _, filled = np.unique((cells[:, 0] * width[1] + cells[:, 1]) * width[2] + cells[:, 2], return_counts=True)
    packed = packing(place, volume)
    return {
        "least_distance": least_distance(place, np.cbrt(volume)),
        "least_density": float(density.min()),
        "mean_density": float(density.mean()),
        "largest_density": float(density.max()),
        "most_in_cell": float(filled.max()) / CELL**3,
        **({} if packed is None else {"packing": packed}),
    }


def least_distance(place: np.ndarray, edge: np.ndarray) -> float:
    """Least distance of the particles at `place` (n, 3) [m] from their nearest over the mean of both `edge` (n,) [m].

    That of a few bounds that of all, and what is nearer than the bound is found soon.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(place)

    def least(some: slice, within: float) -> float:
        distance, index = (found[:, 1] for found in tree.query(place[some], k=2, distance_upper_bound=within))
        near = index < len(place)
        ratio = 2.0 * distance[near] / (edge[some][near] + edge[index[near]])
        return float(ratio.min(initial=np.inf))

    bound = least(slice(None, None, SAMPLED), np.inf)
    return min(bound, least(slice(None), bound * edge.max() * (1.0 + 1e-9)))


def packing(place: np.ndarray, volume: np.ndarray) -> float | None:
    """Rest volumes [m^3] of the particles at `place` [m], shape (n, 3), over the room that they take, where that is
    well within matter: density over that at rest, told by where particles are and by nothing that a method believes.

    Matter is the cells of a mean spacing that hold a particle, gaps of a cell or two closed; well within is DEPTH cells
    below its surface, that of a hollow, too, which may be meant. Cells are turned against the axes, along which
    particles are often aligned. None where fewer than LEAST cells are well within, or matter is strewn over too many.
    """
    from scipy import ndimage
    from scipy.spatial.transform import Rotation

    edge = float(np.cbrt(volume.mean()))
    turned = Rotation.from_euler("xyz", TURN).apply(place)
    cell = np.floor((turned - turned.min(axis=0)) / edge).astype(np.int64) + DEPTH
    shape = cell.max(axis=0) + 1 + DEPTH
    if np.prod(shape.astype(float)) > MOST:
        return None
    flat = np.ravel_multi_index(tuple(cell.T), tuple(shape))
    held = np.bincount(flat, volume, int(np.prod(shape))).reshape(tuple(shape))
    beside = np.ones((3, 3, 3), dtype=bool)
    matter = ndimage.binary_closing(held > 0, beside)
    within = np.asarray(ndimage.binary_erosion(matter, beside, iterations=DEPTH), dtype=bool)
    count = int(within.sum())
    return float(held[within].sum()) / (count * edge**3) if count >= LEAST else None


def departures(measures: dict[str, float]) -> list[str]:
    """What is to be said of matter that has lost or gained volume."""
    mean = measures.get("mean_density", 1.0)
    packed = measures.get("packing", mean)
    told = []
    if abs(mean - 1.0) > DEPARTED:
        told.append(f"its mean density is {mean:.3g} of that at rest: its volume is not to be trusted")
    if abs(packed - mean) > LOOSE * mean:
        told.append(
            f"by where its particles are it is {packed:.3g} times as dense as at rest (the method takes it for "
            f"{mean:.3g}): its volume is not to be trusted"
        )
    return told
