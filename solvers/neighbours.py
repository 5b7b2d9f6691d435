"""Neighbour lists for SPH and PBD: kept until something has moved half a skin (search.py).

On the CPU eight particles that are side by side in memory share a list, on a GPU each has its own: see pairs.py, which
reads them. A list holds all that is within reach of any of its particles: first what lies inside, they themselves too,
then images (images.py).
"""

import math
from collections.abc import Sequence

import numpy as np
import warp as wp

from fluidbench.native.crew import put
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.scenario.expansion import Expansion

from . import search
from .backends import Backend
from .cells import WhoIsWhere
from .order import CellOrder

ROOM = 1.7  # how much denser than a lattice matter may get before its lists overflow
LANES = 8  # particles that share a list on the CPU: as many floats as its vector registers hold
FEWEST, MOST = 4, 32  # threads that share a particle on a GPU
BUSY = 2**18  # threads that keep a large GPU busy
WORTHWHILE = 11  # entries that a thread goes through at least
THINNEST = 0.02  # how far lists reach beyond the support, over it, however still matter lies


def crowded(expansion: Expansion) -> str | None:
    """Why spawned children would not fit into the lists; None if they do."""
    if expansion.kind == "growth" or expansion.per_pass <= 0.9 * ROOM:
        return None
    passes = math.ceil(math.log(expansion.ratio) / math.log(0.9 * ROOM))
    return (
        f"{expansion.per_pass:.3g} children at once, in the place of one, overfill its neighbour lists; set "
        f'material.expansion.passes = {passes} or more, or kind = "growth"'
    )


class Neighbours:
    """Lists of all pairs within `radius`, and of what may come there before they are made anew: up to `skin` beyond,
    both [m]."""

    def __init__(self, scene: Scene, pool: Pool, backend: Backend, radius: float, skin: float) -> None:
        self.scene, self.pool, self.backend = scene, pool, backend
        self.radius, self.thinnest, self.widest = radius, min(THINNEST * radius, skin), skin
        self.reach = self.radius + self.widest
        self.group = LANES if scene.device.is_cpu and backend.name == "warp" else 1
        self.groups = pool.size // self.group
        expansion = scene.scenario.material.expansion
        least = 1.0 if expansion is None else expansion.least_volume
        self.limit = self.group * room(self.reach / scene.spacing, least)
        with wp.ScopedDevice(scene.device):
            self.entries = wp.empty(self.groups * self.limit, dtype=int)
            self.number = wp.zeros(self.groups, dtype=int)
            self.inside = wp.zeros(self.groups, dtype=int)
            self.listed = wp.zeros(pool.size, dtype=wp.vec3)
            self.outdated = wp.ones(1, dtype=int)
            self.skin = wp.array([[self.widest, 0.0]], dtype=wp.vec2)
        lists = self.lists = search.Lists()
        lists.entries, lists.number, lists.inside, lists.group = self.entries, self.number, self.inside, self.group
        lists.threads = (
            1
            if scene.device.is_cpu or backend.name != "warp"
            else threads_for(pool.size, room(self.reach / scene.spacing) / ROOM)
        )
        # On the CPU a list is contiguous; on a GPU what neighbouring threads read at a time is.
        contiguous = self.limit, 1
        lists.row, lists.column = contiguous if scene.device.is_cpu else (lists.threads, pool.size * lists.threads)
        self._allocate_cells()

    def _allocate_cells(self) -> None:
        self.who = WhoIsWhere(self.scene, self.pool, self.reach)

    @property
    def work(self) -> int:
        """Threads of a launch that sums over all pairs."""
        return self.groups * self.lists.threads

    def prepare(self) -> None:
        """Compile the search."""
        self.who.prepare()
        self.scene.crew.load(search)

    def refresh(self) -> None:
        """The pool was changed from outside: make the lists anew at the next substep."""
        self.scene.crew.launch(put, 1, [1, self.outdated])

    def update(self) -> None:
        """Enqueue the check of the lists and, on the device's own decision, their renewal."""
        pool = self.pool
        self.backend.launch(
            search.watch,
            pool.size,
            [pool.capacity, pool.count, pool.position, self.listed, self.radius, self.thinnest],
            [self.skin, self.outdated],
        )
        wp.capture_if(self.outdated, on_true=self._renew)

    def _renew(self) -> None:
        pool = self.pool
        limits = [self.radius, self.thinnest, self.widest]
        self.scene.crew.launch(search.fit_skin, 1, [*limits, self.outdated], [self.skin])
        self.who.tell(self.backend)
        on_cpu = self.scene.device.is_cpu
        self.backend.launch(
            search.fill_lists if on_cpu else search.fill_in_teams,
            self.groups if on_cpu else self.groups * search.TEAM,
            [
                self.scene.box,
                pool.capacity,
                pool.count,
                self.radius,
                self.skin,
                self.limit,
                self.who.cells,
                pool.position,
                self.lists,
            ],
            [self.listed, pool.fault, self.outdated],
        )

    def carried(self) -> dict[str, wp.array]:
        """The lists as they are: made anew, they would be summed over in another order."""
        return {name: getattr(self, name) for name in ("entries", "number", "inside", "listed", "outdated", "skin")}

    def traffic(self, rows: Sequence[int]) -> dict[str, float]:
        """Bytes of passes that ask these many floats of each neighbour: lists are streamed, rows come from caches."""
        entries = float(self.number.numpy().sum())
        return {"memory": 4.0 * entries * len(rows), "cache": 4.0 * entries * sum(rows)}

    def footprint(self) -> dict[str, int]:
        lists = (self.entries, self.number, self.inside, self.listed)
        return {
            "neighbour lists": sum(array.capacity for array in lists),
            "neighbour cells": self._cell_bytes(),
        }

    def _cell_bytes(self) -> int:
        return self.who.footprint()


def neighbours_of(scene: Scene, pool: Pool, backend: Backend, radius: float, skin: float) -> Neighbours:
    """Lists found by a backend's own search."""
    if backend.name == "taichi":
        from .neighbours_taichi import TaichiNeighbours

        return TaichiNeighbours(scene, pool, backend, radius, skin)
    return Neighbours(scene, pool, backend, radius, skin)


def side_by_side(scene: Scene, pool: Pool) -> CellOrder:
    """The order of memory in which those that share a list are closest: cells that hold so many particles at rest."""
    return CellOrder(scene, pool, LANES ** (1.0 / 3.0) * scene.spacing)


def room(reach_ratio: float, least: float = 1.0) -> int:
    """Entries to allow for: 1.7 times those of a lattice of particles that take `least` spacings^3 each. Odd multiples
    of 8, lest rows collide in the cache."""
    return 16 * math.ceil(ROOM * 4.0 / 3.0 * math.pi * reach_ratio**3 / least / 16.0) + 8


def threads_for(particles: int, entries: float) -> int:
    """Threads that share a particle on a GPU: more where particles alone would leave it idle, as long as each has
    enough of the particle's entries to go through."""
    wanted = 2 ** math.ceil(math.log2(max(BUSY / particles, 1.0)))
    worth = 2 ** math.floor(math.log2(max(entries / WORTHWHILE, 1.0)))
    return int(np.clip(min(wanted, worth), FEWEST, MOST))
