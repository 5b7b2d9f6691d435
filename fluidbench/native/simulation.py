"""A native session: emit, plan substeps, advance, look. Solver, time step and processes meet only here."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..errors import UserError
from ..method.contract import Steps
from ..method.suitability import Demands, check_backend, refusal
from ..method.target import DEFAULT_BACKEND, HERE, Target
from ..method.timestep import SPEED_MARGIN, Bound, Plan, plan
from ..registry import get_method
from ..scenario import Scenario
from ..scenario.layout import capacity_of, emitted, generations
from ..scenario.numerics import configure
from . import carriage, clock, crew, health, pool, sorting
from .device import CountedLaunches
from .health import Health, Letter, Vital
from .pool import Pool
from .process import births, contact, curing, emission, expansion, room
from .process.contact import Contact
from .process.curing import Curing
from .process.emission import Emission
from .process.expansion import Growing
from .process.placement import Placement
from .readout import Readout
from .scene import Scene
from .solver import Solver
from .sorting import Sorting

LOOK_TICKS = 8  # ticks between looks on a GPU, where looking waits for it


class Simulation(Readout):
    """One native method on one scenario, or on several worlds of it."""

    resumable = True

    def __init__(
        self,
        scenarios: Scenario | Sequence[Scenario],
        method: str | type[Solver],
        target: Target = HERE,
        config: Any = None,
        graphs: bool = True,
    ) -> None:
        solver_class = get_method(method) if isinstance(method, str) else method
        if not issubclass(solver_class, Solver):
            raise TypeError(f"{solver_class.name} has sessions of its own")
        check_backend(solver_class, target)
        self.target = target
        self.scene = Scene(scenarios, target.device, target.threads if target.backend == DEFAULT_BACKEND else 1)
        self.scenario = self.scene.scenario
        given = configure(solver_class, self.scenario) if config is None else config
        self.config = solver_class.decided(self.scenario, given)
        for scenario in self.scene.scenarios:
            if reason := refusal(solver_class, scenario, self.config, target):
                raise UserError(f"{solver_class.name} cannot run {scenario.name}: {reason}")
        self.pool = Pool(self.scene, capacity_of(self.scenario))
        self.placement = Placement(self.scenario, self.pool)
        self.placed = sum(self.pool.counts) > 0  # bodies, whose particles may lie where others are, since the last tick
        self.emission = Emission(self.scene, self.pool) if self.scenario.nozzle is not None else None
        material = self.scenario.material
        growing = material.expansion is not None
        family = (emitted(self.scenario), generations(self.scenario)) if growing else ()
        self.growing = Growing(self.scene, self.pool, *family) if growing else None
        self.solver = solver_class(self.scene, self.pool, self.config, target.backend, target.threads)
        self.curing = Curing(self.scene, self.pool, self.solver.harden) if material.cure is not None else None
        self.contact = Contact(self.scene, self.pool) if self.scenario.collider is not None else None
        self.health = Health(self.scene, self.pool)
        self._demands = [Demands(solver_class, s, self.config) for s in self.scene.scenarios]
        self.tick, self.ticks, per_output = self.scenario.schedule
        self.stride = self.tick * (1 if self.scene.device.is_cpu else min(LOOK_TICKS, per_output))
        self.speed = self.scenario.reference_speed
        self.done = 0
        self.unseen = True  # whether somebody else may have changed the particles since the last audit
        self.aged = 0  # ticks that this process has run
        self._planned: tuple[float, float, Plan] | None = None  # speed, end of its validity [s], plan
        self.posted: Letter | None = None  # a reading on its way from a GPU
        self.heard = Vital(self.speed, 0.0, 0.0, None)
        self.substep_launches = self.process_launches = 0  # of a substep, of the processes a tick; at most
        self._use_graphs = graphs and target.backend == DEFAULT_BACKEND
        self.sorting = Sorting(self.pool, self.solver, self._use_graphs)

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self.done * self.tick

    def bounds(self) -> list[Bound]:
        """The bounds that hold now, over all worlds and materials that can be there, for the speed last seen."""
        speed = SPEED_MARGIN * self.speed
        return [
            b
            for d in self._demands
            for s in d.until(self.now + self.tick)
            for b in self.solver.bounds(s, self.config, speed)
        ]

    def prepare(self) -> None:
        """Compile and load every kernel."""
        self.solver.prepare()
        for module in (clock, crew, health, pool):
            self.scene.crew.load(module)
        parts = [(emission, self.emission), (curing, self.curing), (contact, self.contact)]
        parts += [(carriage, self.scene.carriage)]
        parts += [(module, self.growing) for module in (expansion, births, room)]
        for module in (module for module, part in parts if part is not None):
            self.scene.crew.load(module)

    def begin(self) -> Vital:
        self.scene.clock.show(0)
        self._age(self._expect())
        self._refresh()
        return self.look()

    def advance(self, until: float) -> Steps:
        """Whole ticks, to the first that ends at `until` [s] or later, or at which a GPU is known to have broken."""
        taken = Steps()
        for _ in range(max(1, math.ceil((until - self.now) / self.tick - 1e-6))):
            plan = self.advance_tick()
            active = sum(self.pool.counts)
            taken.substeps += plan.substeps
            taken.particle_substeps += plan.substeps * active
            taken.peak_particles = max(taken.peak_particles, active)
            taken.binding[plan.binding.name] = taken.binding.get(plan.binding.name, 0.0) + self.tick
            if self.heard.complaint is not None:
                break
        return taken

    def advance_tick(self) -> Plan:
        """One tick: feed, plan, and run its substeps. A GPU is never idle for it, but where matter gives birth."""
        if not self.scene.device.is_cpu and self.done % LOOK_TICKS == 0:
            self._exchange()
        if self.done % sorting.EVERY == 0:
            self.sort()
        self.scene.clock.show(self.done)
        feeding = self._expect()
        steps = self._plan()
        self._run_tick(feeding, steps)
        self.done += 1
        self.aged += 1
        return steps

    def _expect(self) -> bool:
        """What the host must know or do at the start of a tick; whether the nozzle holds anything to be moved."""
        self.placed |= self.placement.advance(self.now)
        return self.emission is not None and self.emission.expect()

    def _plan(self) -> Plan:
        """The substeps of the coming tick, planned anew where the speed or the materials are others."""
        end = self.now + self.tick
        if self._planned is None or self._planned[0] != self.speed or end > self._planned[1]:
            same = min(d.unchanged_until(end) for d in self._demands)
            self._planned = self.speed, same, plan(self.bounds(), self.tick)
        return self._planned[2]

    def _run_tick(self, feeding: bool, steps: Plan) -> None:
        """The audit, what happens to the material, and the substeps: replayed, but the first time in a process and
        where bodies or births need the host."""
        on_cpu, anew = self.scene.device.is_cpu, self.placed or self._births_due()
        turn = self._turn()
        audited, self.unseen = self.unseen or on_cpu, False  # on a GPU what nobody has looked at since is ours
        if not self._use_graphs or self.aged == 0 or anew:
            if audited:
                self._audit()
            self._age(feeding)
            self.scene.clock.strike()
            self.scene.clock.struck()
            self._refresh()
            self.scene.set_dt(steps.dt)
            if turn >= 0:
                self._wait()
                self.solver.arrange(turn)
            self._run(steps.substeps)
            return
        self.scene.set_dt(steps.dt)
        first = audited, feeding, self.pool.stale, turn
        self.pool.stale = False
        if on_cpu:  # where replay is free
            start = self.scene.crew.recorded(first, lambda: self._start_tick(*first))
            self.scene.crew.replay([(start, 1), *self._recorded(steps.substeps)])
        else:
            whole = *first, steps.substeps
            self.scene.crew.replay([(self.scene.crew.recorded(whole, lambda: self._whole_tick(*whole)), 1)])
        self.scene.clock.struck()

    def _turn(self) -> int:
        """Of arranging, due at the start of a tick; -1 if it is not."""
        every = self.solver.arranges
        return self.done // every % self.solver.turns if every > 0 and self.done % every == 0 else -1

    def _start_tick(self, audited: bool, feeding: bool, stale: bool, turn: int) -> None:
        """Enqueue all of a tick but its substeps."""
        if audited:
            self.health.audit()
        self._age(feeding)
        self.scene.clock.strike()
        if stale:
            self.solver.refresh()
        if turn >= 0:
            self.solver.arrange(turn)

    def _whole_tick(self, audited: bool, feeding: bool, stale: bool, turn: int, substeps: int) -> None:
        self._start_tick(audited, feeding, stale, turn)
        self._substeps(substeps, self.solver.portion(substeps))

    def _age(self, feeding: bool) -> None:
        """What happens to material whatever the method, at the start of a tick."""
        born = False
        with CountedLaunches() as counted:
            if self.emission is not None and feeding:
                self.emission.feed()
            if self.growing is not None:
                self.growing.grow()
                born = self._births_due() and self.growing.give_birth(self.now)
            if self.curing is not None:
                self.curing.ripen()
            if self.scene.carriage is not None:
                self.scene.carriage.follow()
        if self.scene.crew.leading:
            self.process_launches = max(self.process_launches, counted.count)
        if self.solver.makes_room and (self.placed or born):
            self._make_room()
        self.placed = False

    def _births_due(self) -> bool:
        return self.growing is not None and self.growing.due(self.done)

    def _make_room(self) -> None:
        """For bodies that were placed and for what was born."""
        if self.aged == 0:
            self.solver.refresh()  # the first time outside any graph
        if self._use_graphs:
            self.scene.crew.run(f"make room {self.placed}", lambda: self.solver.make_room(self.placed))
        else:
            self._wait()
            self.solver.make_room(self.placed)
            self._wait()

    def sort(self) -> None:
        self.sorting.sort()

    def march(self, dt: float, substeps: int) -> None:
        """Take substeps of a given dt [s], whatever the bounds say, without emission: for experiments on stability."""
        self._audit()
        self._refresh()
        self.scene.set_dt(dt)
        self._run(substeps)

    def _refresh(self) -> None:
        """Tell the solver, once, of particles that appeared or were moved."""
        if self.pool.stale:
            self.solver.refresh()
            self.pool.stale = False

    def _audit(self) -> None:
        self.scene.crew.run("audit", self.health.audit)

    def look(self) -> Vital:
        vital = self._told(self.health.read(), self.now)
        self.unseen = True
        if self.scene.device.is_cpu or self.done == 0:
            self._go_by(vital)
        return vital

    def news(self) -> Vital:
        return self.look() if self.scene.device.is_cpu else self.heard

    def _go_by(self, vital: Vital) -> None:
        """Plan for what was seen, if it is matter's."""
        self.heard = vital
        if vital.complaint is None:
            self.speed = max(vital.speed, 0.1 * self.scenario.reference_speed)

    def _exchange(self) -> None:
        """On a GPU, which is not to wait for the host: send for what is there now, and go by what came of the last
        time. When that is depends on the number of ticks alone, and so does every plan."""
        if self.posted is not None:
            self._go_by(self._told(self.health.open(self.posted), self.posted.time))
        self.posted = self.health.post(self.now)
        self.unseen = True

    def _told(self, vital: Vital, time: float) -> Vital:
        """With its time, and a shortage in the solver's words."""
        words = [text for bit, text in self.solver.faults.items() if bit & vital.bits]
        return replace(vital, time=time, shortage="; ".join(words) if words else None)

    def conclude(self) -> str | None:
        """What is carried to the end is tested like what is carried on."""
        self._audit()
        return self.health.broken()

    def kick(self, velocity: np.ndarray) -> None:
        self.pool.velocity.assign(velocity.astype(np.float32))

    def _substeps(self, number: int, portion: int) -> None:
        """Everything of so many substeps, in portions, as it is captured."""
        after = [part.substep for part in (self.scene.carriage, self.contact) if part is not None]
        with CountedLaunches() as counted:
            if not after:
                self.solver.substeps(number, portion)
            else:
                for _ in range(number):
                    for part in (self.solver.substep, *after):
                        part()
        if self.scene.crew.leading:
            self.substep_launches = max(self.substep_launches, math.ceil(counted.count / number))

    def _run(self, substeps: int) -> None:
        """Replay `substeps` substeps."""
        if self._use_graphs:
            self.scene.crew.replay(self._recorded(substeps))
        else:
            self._launch(substeps)

    def _recorded(self, substeps: int) -> list[tuple[list[Any], int]]:
        """The graphs of so many substeps, and how often each: one for all on CUDA; on the CPU, where replay is free, of
        a portion and of the rest."""
        portion = self.solver.portion(substeps)
        each = portion if self.scene.device.is_cpu else substeps
        portions = [(each, substeps // each), (substeps % each, 1)]
        found = []
        for size, times in portions:
            if size * times > 0:
                found.append((self.scene.crew.recorded(size, partial(self._substeps, size, portion)), times))
        return found

    def _launch(self, substeps: int) -> None:
        """Launch `substeps` substeps one by one, between those of Warp that came before and come after."""
        self._wait()
        self._substeps(substeps, self.solver.portion(substeps))
        self._wait()

    def _wait(self) -> None:
        if self.solver.backend is not None:
            self.solver.backend.wait()

    def state(self) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        progress: dict[str, Any] = {
            "done": self.done,
            "speed": self.speed,
            "counts": self.pool.counts,
            "stale": bool(self.pool.stale),
            "placement": self.placement.progress(),
            "posted": None if self.posted is None else self.posted.copy(),
        }
        progress |= {"emission": self.emission.progress()} if self.emission is not None else {}
        return progress, {name: array.numpy() for name, array in self.arrays().items()}

    def resume(self, progress: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        for name, array in self.arrays().items():
            array.assign(arrays[name])
        self.done, self.speed = progress["done"], progress["speed"]
        self.pool.counts, self.pool.stale = list(progress["counts"]), progress["stale"]
        self.placement.go_on(progress["placement"])
        self.placed = False
        self.posted = None if progress["posted"] is None else Letter(**progress["posted"])
        if self.emission is not None:
            self.emission.go_on(progress["emission"])
        self.solver.resume()
