"""The pool in its solver's order: side by side in memory what is side by side in space."""

from typing import cast

import numpy as np
import warp as wp

from .pool import Pool
from .solver import Solver

EVERY = 32  # ticks between reorderings, at most


class Sorting:
    """Reorders a pool by the keys of its solver, if it has any: enqueued, and recorded from the second time on."""

    def __init__(self, pool: Pool, solver: Solver, recorded: bool) -> None:
        self.pool, self.solver, self.recorded = pool, solver, recorded
        slots = np.tile(np.arange(pool.size, dtype=np.int32), 2)
        self._identity, self._order = (wp.array(slots, dtype=int, device=pool.scene.device) for _ in range(2))
        self._known: bool | None = None  # whether the solver has an order; not known before it was asked

    def sort(self) -> None:
        if not self.recorded or self._known is None:
            self._known = (keys := self.solver.sort_keys()) is not None
            if keys is not None:
                self.reorder(keys)
        elif self._known:
            self.pool.scene.crew.run("sort", lambda: self.reorder(cast(wp.array, self.solver.sort_keys())))
            self.pool.stale = True

    def reorder(self, keys: wp.array) -> None:
        """Enqueue: the pool by these keys, see Solver.sort_keys."""

        def rank() -> None:
            wp.copy(self._order, self._identity)
            wp.utils.radix_sort_pairs(keys, self._order, self.pool.size, 0, self.solver.sort_bits)

        self.pool.scene.crew.alone(rank)
        self.pool.permute(self._order)
