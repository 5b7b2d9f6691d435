"""The one loop: emit, plan substeps, advance, look. Solver, time step, emission and measurement meet only here."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from . import health
from .device import CountedLaunches
from .errors import UserError
from .health import Health, Vital
from .layout import capacity_of, emitted, generations
from .particles import OutOfCapacity, Pool
from .process import contact, curing, emission, expansion
from .process.contact import Contact
from .process.curing import Curing
from .process.emission import Emission
from .process.expansion import Growing
from .process.laying import Laying
from .scenario import Scenario
from .scene import Scene
from .solver import Demands, Solver, check_backend, configure, get_solver, refusal
from .target import DEFAULT_BACKEND, HERE, Target
from .timestep import Bound, Plan, plan
from .verdict import Verdict

if TYPE_CHECKING:
    from .checkpoint import Checkpoints

SORT_TICKS = 32  # ticks between reorderings of the pool, at most
SPEED_MARGIN = 1.25  # the speed seen at the last look may grow by this much until the next
PACE_SECONDS = 8.0  # wall time after which the pace is judged against the wall limit


@dataclass
class Outcome:
    """How far a run came, what it cost and which bound held it back."""

    verdict: Verdict
    reason: str = ""
    time: float = 0.0
    ticks: int = 0
    substeps: int = 0
    particle_substeps: int = 0
    wall: float = 0.0
    cpu: float = 0.0
    prepare_wall: float = 0.0
    binding: dict[str, float] = field(default_factory=dict)
    peak_particles: int = 0


class Simulation:
    """One method on one scenario, or on several worlds of it."""

    def __init__(
        self, scenarios: Scenario | Sequence[Scenario], method: str | type[Solver], target: Target = HERE,
        config: Any = None, graphs: bool = True,
    ) -> None:  # fmt: skip
        solver_class = get_solver(method) if isinstance(method, str) else method
        check_backend(solver_class, target)
        self.target = target
        self.scene = Scene(scenarios, target.device)
        self.scenario = self.scene.scenario
        self.config = configure(solver_class, self.scenario) if config is None else config
        for scenario in self.scene.scenarios:
            if reason := refusal(solver_class, scenario, self.config):
                raise UserError(f"{solver_class.name} cannot run {scenario.name}: {reason}")
        self.pool = Pool(self.scene, capacity_of(self.scenario))
        self.laying = Laying(self.scenario, self.pool)
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
        self.tick, self.ticks, self.ticks_per_output = self.scenario.schedule
        self.speed = self.scenario.reference_speed
        self.done = 0
        self.unseen = True  # whether somebody else may have changed the particles since the last audit
        self.film: Any = None  # takes pictures on the way: due(time), shoot(simulation)
        self._identity = np.tile(np.arange(self.pool.size, dtype=np.int32), 2)
        self._order = wp.array(self._identity, dtype=int, device=self.scene.device)
        self._graphs: dict[int, Any] = {}
        self.substep_launches, self.process_launches = CountedLaunches(), CountedLaunches()
        self._use_graphs = graphs and target.backend == DEFAULT_BACKEND

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self.done * self.tick

    def bounds(self) -> list[Bound]:
        """The bounds that hold now, over all worlds and materials that can be there, for the speed last seen."""
        speed = SPEED_MARGIN * self.speed
        return [b for d in self._demands for s in d.until(self.now + self.tick)
                for b in self.solver.bounds(s, self.config, speed)]  # fmt: skip

    def prepare(self) -> None:
        """Compile and load every kernel."""
        self.solver.prepare()
        wp.load_module(health, device=self.scene.device)
        parts = {emission: self.emission, curing: self.curing, expansion: self.growing, contact: self.contact}
        for module in (module for module, part in parts.items() if part is not None):
            wp.load_module(module, device=self.scene.device)

    def advance(self) -> Plan:
        """One tick: feed, plan, and run its substeps."""
        if self.unseen or self.scene.device.is_cpu:  # on a GPU what nobody has looked at since the last audit is ours
            self.health.audit()
            self.unseen = False
        with self.process_launches:
            self._age()
        if self.done % SORT_TICKS == 0 and (keys := self.solver.sort_keys()) is not None:
            self.reorder(keys)
        self._refresh()
        steps = plan(self.bounds(), self.tick)
        self.scene.set_dt(steps.dt)
        self._run(steps.substeps)
        self.done += 1
        return steps

    def _age(self) -> None:
        """What happens to material whatever the method, at the start of a tick."""
        self.laying.advance(self.now)
        if self.emission is not None:
            self.emission.advance(self.now, self.tick)
        if self.growing is not None:
            self.growing.advance(self.now, self.tick)
        if self.curing is not None:
            self.curing.advance(self.now)
        if self.contact is not None:
            self.contact.advance(self.now, self.tick)

    def march(self, dt: float, substeps: int) -> None:
        """Take substeps of a given dt [s], whatever the bounds say, without emission: for experiments on stability."""
        self.health.audit()
        self._refresh()
        self.scene.set_dt(dt)
        self._run(substeps)

    def _refresh(self) -> None:
        """Tell the solver, once, of particles that appeared or were moved."""
        if self.pool.stale:
            self.solver.refresh()
            self.pool.stale = False

    def look(self) -> Vital:
        """Read the vital signs; synchronises with the device."""
        vital, self.unseen = self.health.read(), True
        self.speed = max(vital.speed, 0.1 * self.scenario.reference_speed)
        return vital

    def frame(self, world: int = 0) -> dict[str, np.ndarray]:
        """A world's particles as they are now: the pool's core fields, `density` [kg/m^3], `spin` [kg m^2/s] and, where
        the method has it, `stress` [Pa]."""
        spins = self.solver.spins()
        spins = np.zeros((self.pool.size, 3), np.float32) if spins is None else spins
        stresses = self.solver.shear_stresses()
        more = {} if stresses is None else {"stress": stresses}
        return self.pool.snapshot(world, density=self.solver.densities(), spin=spins, **more)

    def reorder(self, keys: wp.array) -> None:
        """Sort the pool by a solver's keys."""
        self._order.assign(self._identity)
        wp.utils.radix_sort_pairs(keys, self._order, self.pool.size)
        self.pool.permute(self._order)

    def _substep(self) -> None:
        """Everything of one substep, as it is captured."""
        self.solver.substep()
        if self.contact is not None:
            self.contact.substep()

    def _run(self, substeps: int) -> None:
        """Replay `substeps` substeps: one graph a substep on the CPU, where replay is free, one for all on CUDA."""
        if not self._use_graphs:
            self._launch(substeps)
            return
        each = 1 if self.scene.device.is_cpu else substeps
        if each not in self._graphs:
            self.substep_launches = CountedLaunches()
            with self.substep_launches, wp.ScopedCapture(device=self.scene.device) as capture:
                for _ in range(each):
                    self._substep()
            self.substep_launches.count //= each
            self._graphs[each] = capture.graph
        for _ in range(substeps // each):
            wp.capture_launch(self._graphs[each])

    def _launch(self, substeps: int) -> None:
        """Launch `substeps` substeps one by one, between those of Warp that came before and come after."""
        self._wait()
        self.substep_launches = CountedLaunches()
        with self.substep_launches:
            for _ in range(substeps):
                self._substep()
        self.substep_launches.count //= substeps
        self._wait()

    def _wait(self) -> None:
        if self.solver.backend is not None:
            self.solver.backend.wait()

    def footprint(self) -> dict[str, int]:
        """Bytes by part of everything allocated: the pool, the method, and each process that is on."""
        owners = {"pool": self.pool, "solver": self.solver, "curing": self.curing, "expansion": self.growing,
                  "contact": self.contact}  # fmt: skip
        return {
            f"{owner}.{name}": size
            for owner, part in owners.items() if part is not None for name, size in part.footprint().items()
        }  # fmt: skip

    def fault(self) -> str | None:
        """What a kernel could not do, in the solver's words."""
        bits = int(self.pool.fault.numpy()[0])
        words = [text for bit, text in self.solver.faults.items() if bits & bit]
        return "; ".join(words) if words else None

    def arrays(self) -> dict[str, wp.array]:
        """Everything on the device that a run must have to go on as it was."""
        found = {f"pool.{name}": array for name, array in self.pool.fields.items()}
        found |= {"pool.count": self.pool.count, "pool.fault": self.pool.fault}
        return found | {f"solver.{name}": array for name, array in self.solver.carried().items()}

    def progress(self) -> dict[str, Any]:
        """Everything on the host that a run must have to go on as it was, as JSON can hold it."""
        found: dict[str, Any] = {"done": self.done, "speed": self.speed, "counts": self.pool.counts,
                                 "stale": bool(self.pool.stale), "laying": self.laying.progress()}  # fmt: skip
        return found | ({"emission": self.emission.progress()} if self.emission is not None else {})

    def go_on(self, progress: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        """Take the place of a run whose `progress` and `arrays` were kept; raises KeyError if one is not there."""
        for name, array in self.arrays().items():
            array.assign(arrays[name])
        self.done, self.speed = progress["done"], progress["speed"]
        self.pool.counts, self.pool.stale = list(progress["counts"]), progress["stale"]
        self.laying.go_on(progress["laying"])
        if self.emission is not None:
            self.emission.go_on(progress["emission"])
        self.solver.resume()

    def run(
        self,
        observe: Callable[["Simulation", Vital], None] | None = None,
        wall_limit: float | None = None,
        checkpoints: "Checkpoints | None" = None,
    ) -> Outcome:
        """Run to the end, or until something breaks; `observe` is called at every output, and checkpoints are written,
        off the clock. Goes on from a checkpoint where there is one."""
        outcome = Outcome(Verdict.COMPLETED)
        start = time.perf_counter()
        self.prepare()
        outcome.prepare_wall = time.perf_counter() - start
        every = 1 if self.scene.device.is_cpu else min(8, self.ticks_per_output)
        going_on = checkpoints is not None and checkpoints.restore(outcome)
        if observe is not None and not going_on:
            self._age()
            self._refresh()
            observe(self, self.look())
        while self.done < self.ticks and outcome.verdict is Verdict.COMPLETED:
            self._tick(outcome, every, observe, wall_limit)
            if checkpoints is not None and outcome.verdict is Verdict.COMPLETED and checkpoints.due():
                checkpoints.write(outcome)
        self._conclude(outcome)
        return outcome

    def _conclude(self, outcome: Outcome) -> None:
        """What is carried to the end is tested like what is carried on."""
        outcome.time, outcome.ticks = self.now, self.done
        self.health.audit()
        if outcome.verdict is Verdict.COMPLETED and (broken := self.health.broken()):
            outcome.verdict, outcome.reason = Verdict.DIVERGED, f"at t = {self.now:.4g} s {broken}"

    def _tick(self, outcome: Outcome, every: int, observe, wall_limit: float | None) -> None:
        wall, cpu = time.perf_counter(), time.process_time()
        at_output = False
        try:
            steps = self.advance()
            at_output = self.done % self.ticks_per_output == 0 or self.done == self.ticks
            vital = self.look() if self.done % every == 0 or at_output else None
            if self.film is not None and self.film.due(self.now):
                self.film.shoot(self)
        except OutOfCapacity as error:
            outcome.verdict, outcome.reason = Verdict.OUT_OF_CAPACITY, str(error)
            return
        outcome.wall += time.perf_counter() - wall
        outcome.cpu += time.process_time() - cpu
        active = sum(self.pool.counts)
        outcome.substeps += steps.substeps
        outcome.particle_substeps += steps.substeps * active
        outcome.peak_particles = max(outcome.peak_particles, active)
        outcome.binding[steps.binding.name] = outcome.binding.get(steps.binding.name, 0.0) + self.tick
        if vital is None:
            return
        if vital.complaint:
            outcome.verdict, outcome.reason = Verdict.DIVERGED, f"at t = {self.now:.4g} s {vital.complaint}"
        elif fault := self.fault():
            outcome.verdict, outcome.reason = Verdict.OUT_OF_CAPACITY, f"at t = {self.now:.4g} s {fault}"
        elif wall_limit is not None and (late := self._too_slow(outcome, wall_limit)):
            outcome.verdict, outcome.reason = Verdict.TIMEOUT, late
        elif observe is not None and at_output:
            observe(self, vital)

    def _too_slow(self, outcome: Outcome, limit: float) -> str | None:
        """Over the wall limit, or certain to be: the pace only falls as particles are added."""
        expected = outcome.wall * self.ticks / self.done
        if outcome.wall > limit or (outcome.wall > min(PACE_SECONDS, limit) and expected > 2.0 * limit):
            return (
                f"stopped at t = {self.now:.4g} s after {outcome.wall:.0f} s: at this pace the run takes at least "
                f"{expected:.0f} s, the limit is {limit:.0f} s"
            )
        return None
