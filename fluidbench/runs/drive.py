"""The one loop over a session: advance, look, observe, keep. Whatever the method, it is here that time is taken."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from ..method.contract import OutOfCapacity, Session, Steps
from ..method.verdict import Verdict
from ..method.vitals import Vital
from ..scenario import Scenario

if TYPE_CHECKING:
    from .checkpoint import Checkpoints

PACE_SECONDS = 8.0  # wall time after which the pace is judged against the wall limit
Observer = Callable[[Session, Vital], None]


class Camera(Protocol):
    """Takes pictures on the way."""

    next: float

    def shoot(self, session: Session) -> None: ...


@dataclass
class Outcome:
    """How far a run came, what it cost and which bound held it back."""

    verdict: Verdict = Verdict.COMPLETED
    reason: str = ""
    time: float = 0.0  # that the verdict is of
    simulated: float = 0.0  # that was paid for: a GPU may have gone on a little before it was known to have broken
    substeps: int = 0
    particle_substeps: int = 0
    wall: float = 0.0
    cpu: float = 0.0
    prepare_wall: float = 0.0
    binding: dict[str, float] = field(default_factory=dict)
    peak_particles: int = 0

    def add(self, steps: Steps) -> None:
        self.substeps += steps.substeps
        self.particle_substeps += steps.particle_substeps
        self.peak_particles = max(self.peak_particles, steps.peak_particles)
        for name, held in steps.binding.items():
            self.binding[name] = self.binding.get(name, 0.0) + held

    def end(self, verdict: Verdict, reason: str, time: float) -> None:
        """That was at `time` [s]."""
        self.verdict, self.reason, self.time = verdict, reason, time


@dataclass
class Drive:
    """A session on its way through a scenario: run to the end, or until something breaks.

    `observe` is called at every output, checkpoints are written off the clock, pictures are taken on it. With
    checkpoints the run goes on from one where there is one. Where `rests` says so at an output, the run is complete.
    """

    session: Session
    scenario: Scenario
    observe: Observer | None = None
    wall_limit: float | None = None
    checkpoints: Checkpoints | None = None
    camera: Camera | None = None
    rests: Callable[[], bool] | None = None
    outcome: Outcome = field(default_factory=Outcome)

    def __post_init__(self) -> None:
        tick, ticks, per_output = self.scenario.schedule
        self.end, self.interval = tick * ticks, tick * per_output
        self.near = 1e-6 * tick  # two times nearer than this are the same
        self.rested = False

    def run(self) -> Outcome:
        outcome, session = self.outcome, self.session
        start = time.perf_counter()
        session.prepare()
        outcome.prepare_wall = time.perf_counter() - start
        if self.checkpoints is None or not self.checkpoints.restore(outcome):
            self.begin()
        while session.now < self.end - self.near and self.going:
            self.leg()
            if self.checkpoints is not None and self.checkpoints.due() and self.going:
                self.checkpoints.write(outcome)
        outcome.simulated = session.now
        if outcome.verdict is Verdict.COMPLETED:
            outcome.time = session.now
            if broken := session.conclude():
                outcome.end(Verdict.DIVERGED, f"at t = {session.now:.4g} s {broken}", session.now)
        return outcome

    @property
    def going(self) -> bool:
        """Whether nothing has ended the run yet."""
        return self.outcome.verdict is Verdict.COMPLETED and not self.rested

    def begin(self) -> None:
        try:
            vital = self.session.begin()
        except OutOfCapacity as error:
            self.outcome.end(Verdict.OUT_OF_CAPACITY, str(error), self.session.now)
            return
        if self.observe is not None:
            self.observe(self.session, vital)

    def leg(self) -> None:
        """On to the next time at which there is something to do, and a look at what came of it."""
        session, outcome = self.session, self.outcome
        output = min(self.interval * (int((session.now + self.near) / self.interval) + 1), self.end)
        until = min(output, session.now + session.stride)
        if self.camera is not None and self.camera.next > session.now + self.near:
            until = min(until, self.camera.next)
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            steps = session.advance(until)
        except OutOfCapacity as error:
            outcome.end(Verdict.OUT_OF_CAPACITY, str(error), session.now)
            if (vital := session.look()).complaint:  # what has broken asks for any room
                self.judge(vital, False)
            return
        at_output = session.now >= output - self.near
        saved = self.checkpoints is not None and self.checkpoints.due()  # which waits: on the clock, then
        vital = session.look() if at_output or saved else session.news()
        if self.camera is not None and session.now >= self.camera.next - self.near:
            self.camera.shoot(session)
        outcome.wall += time.perf_counter() - wall
        outcome.cpu += time.process_time() - cpu
        outcome.add(steps)
        self.judge(vital, at_output)

    def judge(self, vital: Vital, at_output: bool) -> None:
        """End the run for what its vital signs, or its clock, say; otherwise observe what is to be observed."""
        session, outcome = self.session, self.outcome
        time = session.now if vital.time is None else vital.time
        if vital.complaint:
            outcome.end(Verdict.DIVERGED, f"at t = {time:.4g} s {vital.complaint}", time)
        elif vital.shortage:
            outcome.end(Verdict.OUT_OF_CAPACITY, f"at t = {time:.4g} s {vital.shortage}", time)
        else:
            if self.observe is not None and at_output:
                self.observe(session, vital)
                self.rested = self.rests is not None and self.rests()
            if self.rested:
                return
            if late := self.too_slow():
                if time < session.now - self.near and (now := session.look()).complaint:
                    self.judge(now, False)  # not late but broken, since the last news
                    return
                if self.checkpoints is not None and self.checkpoints.every > 0:
                    self.checkpoints.write(outcome)  # with a larger limit it goes on from here
                outcome.end(Verdict.TIMEOUT, late, session.now)

    def too_slow(self) -> str | None:
        """Over the wall limit, or certain to be: the pace only falls as particles are added. (What may
        come to rest at any time has its whole limit.)"""
        wall, limit, now = self.outcome.wall, self.wall_limit, self.session.now
        if limit is None:
            return None
        expected = wall * self.end / now
        certain = self.rests is None and wall > min(PACE_SECONDS, limit) and expected > 2.0 * limit
        if wall > limit or certain:
            return (
                f"stopped at t = {now:.4g} s after {_shown(wall)} s: at this pace the run takes at least "
                f"{_shown(expected)} s, the limit is {_shown(limit)} s"
            )
        return None


def _shown(seconds: float) -> str:
    """Whole seconds, and of fewer than 10 two digits."""
    return f"{seconds:.0f}" if seconds >= 10.0 else f"{seconds:.2g}"
