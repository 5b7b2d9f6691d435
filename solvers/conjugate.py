"""What decides how long conjugate gradients go on, and what they have taken: all of it on the device."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import ClassVar, Protocol

import warp as wp

from .backends import Backend
from .conjugate_warp import TEAM, Ending, Totals

MOST = 400  # iterations of one solve: a thousandfold of an explicit step takes some hundred


class Iterations:
    """The iterations of solves in several worlds at once, each with sums and an end of its own."""

    def __init__(
        self,
        backend: Backend,
        kernels: SimpleNamespace,
        tolerance: float,
        begin: wp.array,
        past: wp.array,
        partial: wp.array,
    ) -> None:
        """`tolerance` is of the residual over v* and what forces give in a step [-]; a world's sums are those of
        partial[begin[world]] and so on, before past[world]."""
        self.backend, self.kernels = backend, kernels
        self.sums = [begin, past]
        self.partial = partial
        self.ending = Ending()
        self.ending.tolerance, self.ending.most = tolerance, MOST
        worlds = self.worlds = len(past)
        self.team = 1 if wp.get_device(begin.device).is_cpu else TEAM
        with wp.ScopedDevice(begin.device):
            self.totals, self.going = wp.zeros(worlds, dtype=Totals), wp.zeros(1, dtype=int)
            self.counted, self.worst = wp.zeros((worlds, 3), dtype=int), wp.zeros(worlds, dtype=float)

    def begin_with(self) -> None:
        """Enqueue: m r.r and m (v*.v* + |dt f|^2) are summed up."""
        self._weigh("weigh_start")

    def repeat(self, body: Callable[[], None]) -> None:
        """Enqueue iterations until all worlds are solved, or know that they will not be; note what they took."""
        self.backend.repeat(self.going, body)
        inputs = [self.ending, self.totals]
        self.backend.launch(self.kernels.note, self.worlds, inputs, [self.going, self.counted, self.worst])

    def step(self) -> None:
        """Enqueue: how far to go along the direction, of which p.Kp is summed up."""
        self._weigh("weigh_step")

    def turn(self) -> None:
        """Enqueue: how much of the direction to keep, and whether to go on; r.r is summed up."""
        self._weigh("weigh_turn")

    def _weigh(self, name: str) -> None:
        inputs = [self.ending, *self.sums, self.team, self.partial]
        self.backend.launch(getattr(self.kernels, name), self.worlds * self.team, inputs, [self.totals, self.going])

    def effort(self, world: int = 0) -> dict[str, float]:
        """Iterations a solve, largest residual over v* and dt f, share of solves that did not converge; nothing before
        the first."""
        solves, iterations, unconverged = (int(n) for n in self.counted.numpy()[world])
        if not solves:
            return {}
        return {
            "iterations": iterations / solves,
            "residual": float(self.worst.numpy()[world]),
            "unconverged": unconverged / solves,
        }


class Solve(Protocol):
    """What a method solves for by these iterations; it may solve for nothing (None)."""

    OWN: ClassVar[tuple[str, ...]]  # its arrays
    iterations: Iterations


def carried_by(solve: Solve | None) -> dict[str, wp.array]:
    """What a checkpoint must hold of it."""
    return {} if solve is None else {"counted": solve.iterations.counted, "worst": solve.iterations.worst}


def effort_of(solve: Solve | None) -> dict[str, float]:
    """What it has taken, in the first world."""
    return {} if solve is None else solve.iterations.effort()


def footprint_of(solve: Solve | None) -> dict[str, int]:
    """Bytes that it takes beside the pool."""
    return {} if solve is None else {f"viscous_{name}": getattr(solve, name).capacity for name in solve.OWN}
