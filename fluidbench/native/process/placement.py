"""Bodies put into the pool: those that a scenario starts with, and layers that are laid on them later."""

import numpy as np

from ...method.frame import CLAMPED, FREE
from ...scenario import Scenario
from ...scenario.layout import lay_out
from ...scenario.stream import Stream
from ..pool import Pool


class Placement:
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

    def advance(self, now: float) -> bool:
        """Place the bodies that are due at `now` [s]; whether there were any."""
        before = self.placed
        while self.waiting and self.waiting[0].start <= now * (1.0 + 1e-9):
            body = self.waiting.pop(0)
            laid = lay_out(body, self.scenario)
            held, n = CLAMPED if body.clamped else FREE, len(laid.volume)
            self.pool.place(*laid, held, np.arange(self.placed, self.placed + n), body.start)
            self.placed += n
        return self.placed > before
