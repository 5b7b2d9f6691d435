"""Bodies put into the pool: those that a scenario starts with, and layers that are laid on them later."""

import numpy as np

from ..layout import sample
from ..particles import CLAMPED, FREE, Pool
from ..scenario import Scenario
from .stream import Stream


class Laying:
    """Places every body of a scenario at its start; later ones appear whole, as in element birth."""

    def __init__(self, scenario: Scenario, pool: Pool) -> None:
        self.scenario, self.pool = scenario, pool
        self.waiting = sorted(scenario.bodies, key=lambda body: body.start)
        self.placed = 0
        self.advance(0.0)
        self.placed += Stream(scenario).particles if scenario.nozzle is not None else 0

    def progress(self) -> list[int]:
        """How many bodies wait, and how many particles were placed."""
        return [len(self.waiting), self.placed]

    def go_on(self, progress: list[int]) -> None:
        """From where another one came to."""
        self.waiting = self.waiting[len(self.waiting) - progress[0] :]
        self.placed = progress[1]

    def advance(self, now: float) -> None:
        """Place the bodies that are due at `now` [s]."""
        while self.waiting and self.waiting[0].start <= now * (1.0 + 1e-9):
            body = self.waiting.pop(0)
            points, volume = sample(body, self.scenario)
            held, origin = CLAMPED if body.clamped else FREE, np.arange(self.placed, self.placed + len(points))
            self.pool.place(points, body.velocity_at(points), volume, held, origin, body.start)
            self.placed += len(points)
