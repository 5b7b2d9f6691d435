"""Is the run still sound? Broken state, runaway speed and unfed energy, found on the device.

Methods test each motion before walls act on it (FAULT_ASTRAY of the pool's fault bits), and SPH its density before its
floor (FAULT_STATE): a clamp is never all that stands between a blow-up and a result. `audit` tests everything that
particles carry, once a tick; `read` reads what method/vitals.py judges.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import warp as wp

from ..method.vitals import Vital, complaint, mass_energy
from .crew import index_of, raise_fault
from .pool import FAULT_ASTRAY, FAULT_STATE, Memory, Pool
from .scene import Box, Force, Scene, force_potential

wp.set_module_options({"enable_backward": False})


@wp.kernel
def inspect(
    lanes: int,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    # outputs
    top_speed: wp.array(dtype=float),
    nonfinite: wp.array(dtype=int),
    energy: wp.array2d(dtype=wp.float64),
):
    """Per world: largest speed, number of non-finite particles, kinetic and potential energy."""
    world, lane = wp.tid()
    fastest, bad = float(0.0), int(0)
    kinetic, potential = wp.float64(0.0), wp.float64(0.0)
    i = lane
    while i < count[world]:
        p = world * capacity + i
        v = velocity[p]
        x = position[p]
        speed2 = wp.dot(v, v)
        if wp.isfinite(speed2) and wp.isfinite(wp.dot(x, x)):
            fastest = wp.max(fastest, speed2)
            kinetic += wp.float64(0.5 * mass[p] * speed2)
            potential -= wp.float64(mass[p] * force_potential(force[world], x))
        else:
            bad += 1
        i += lanes
    if fastest > 0.0:
        wp.atomic_max(top_speed, world, wp.sqrt(fastest))
    if bad > 0:
        wp.atomic_add(nonfinite, world, bad)
    if kinetic != wp.float64(0.0) or potential != wp.float64(0.0):
        wp.atomic_add(energy, world, 0, kinetic)
        wp.atomic_add(energy, world, 1, potential)


NUMBERS, WHOLE, PLACES = wp.constant(0), wp.constant(1), wp.constant(2)  # what a field holds


@wp.struct
class Ranges:
    """What every field of a pool may hold."""

    holds: wp.array(dtype=int)
    low: wp.array(dtype=float)
    high: wp.array(dtype=float)


@wp.kernel
def audit(
    share: wp.vec3i,
    lanes: int,
    worlds: int,
    memory: Memory,
    ranges: Ranges,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    # outputs
    fault: wp.array(dtype=int),
):
    """Mark the pool where any number of any field lies outside its range or is none.

    Positions and whole numbers become addresses in the passes: what is broken among them is replaced, by the middle of
    the domain and by the least value.
    """
    place = index_of(share, wp.tid())
    lane = place % lanes
    world = (place / lanes) % worlds
    field = place / (lanes * worlds)
    width = int(memory.width[field])
    low = float(ranges.low[field])
    high = float(ranges.high[field])
    i = (world * capacity) * width + lane
    end = (world * capacity + count[world]) * width
    broken = bool(False)
    if ranges.holds[field] == WHOLE:
        numbers = wp.array(ptr=memory.address[field], shape=(end,), dtype=wp.int32)
        while i < end:
            if numbers[i] < int(low) or numbers[i] > int(high):
                broken = True
                numbers[i] = int(low)
            i += lanes
    else:
        values = wp.array(ptr=memory.address[field], shape=(end,), dtype=wp.float32)
        places = ranges.holds[field] == PLACES
        while i < end:
            x = values[i]
            if places:
                k = i % 3
                low = box.lower[k] - box.reach[k]
                high = box.upper[k] + box.reach[k]
            if not (x >= low and x <= high):
                broken = True
                if places:
                    values[i] = 0.5 * (low + high)
            i += lanes
    if broken:
        raise_fault(fault, wp.where(ranges.holds[field] == PLACES, FAULT_ASTRAY, FAULT_STATE))


SIGNS = 5  # numbers of a reading


@wp.kernel
def forget(top_speed: wp.array(dtype=float), nonfinite: wp.array(dtype=int), energy: wp.array2d(dtype=wp.float64)):
    """Begin a reading."""
    world = wp.tid()
    top_speed[world] = 0.0
    nonfinite[world] = 0
    energy[world, 0] = wp.float64(0.0)
    energy[world, 1] = wp.float64(0.0)


@wp.kernel
def sum_up(
    top_speed: wp.array(dtype=float),
    nonfinite: wp.array(dtype=int),
    energy: wp.array2d(dtype=wp.float64),
    fault: wp.array(dtype=int),
    signs: wp.array(dtype=wp.float64),
):
    """One reading of all worlds: top speed, broken particles, kinetic and potential energy, fault bits."""
    fastest, bad = float(0.0), int(0)
    kinetic, potential = wp.float64(0.0), wp.float64(0.0)
    for world in range(top_speed.shape[0]):
        fastest = wp.max(fastest, top_speed[world])
        bad += nonfinite[world]
        kinetic += energy[world, 0]
        potential += energy[world, 1]
    signs[0] = wp.float64(fastest)
    signs[1] = wp.float64(bad)
    signs[2] = kinetic
    signs[3] = potential
    signs[4] = wp.float64(fault[0])


class Health:
    """Reads the pool's vital signs, now or, from a GPU, while it goes on; makes sure that a pool holds only numbers."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        self.scene, self.pool = scene, pool
        self.memory, self.ranges = pool.memory, ranges_of(pool)  # made now: a recording would repeat it
        self.lanes = min(scene.lanes, 4096)
        with wp.ScopedDevice(scene.device):
            self.top_speed = wp.zeros(pool.worlds, dtype=float)
            self.nonfinite = wp.zeros(pool.worlds, dtype=int)
            self.energy = wp.zeros((pool.worlds, 2), dtype=wp.float64)
            self.signs = wp.zeros(SIGNS, dtype=wp.float64)
        self._boxes = []
        if not scene.device.is_cpu:
            host = [wp.empty(SIGNS, dtype=wp.float64, device="cpu", pinned=True) for _ in range(2)]
            self._boxes = [(signs, wp.Event(scene.device)) for signs in host]

    def audit(self) -> None:
        """Enqueue the test of every field of the pool against its range; it marks the pool's fault bits."""
        pool, scene = self.pool, self.scene
        scene.crew.launch(
            audit,
            len(pool.fields) * pool.worlds * self.lanes,
            [self.lanes, pool.worlds, self.memory, self.ranges, scene.box, pool.capacity, pool.count],
            [pool.fault],
        )

    def inspect(self) -> None:
        """Enqueue a reading of all worlds."""
        pool, scene = self.pool, self.scene
        sums = [self.top_speed, self.nonfinite, self.energy]
        scene.crew.launch(forget, pool.worlds, sums)
        scene.crew.launch(
            inspect,
            (pool.worlds, self.lanes),
            [self.lanes, pool.capacity, pool.count, pool.position, pool.velocity, pool.mass, scene.force],
            sums,
        )
        scene.crew.launch(sum_up, 1, [*sums, pool.fault, self.signs])

    def read(self) -> Vital:
        """What is there now; waits for the device."""
        self.scene.crew.run("inspect", self.inspect)
        return self._vital(self.signs.numpy().tolist(), self.pool.counts)

    def post(self, time: float) -> "Letter":
        """A reading of what is there when the device gets to it, which will then be `time` [s]."""
        self.scene.crew.run("inspect", self.inspect)
        self._boxes = self._boxes[::-1]  # one letter is on its way while the other is read
        signs, sent = self._boxes[0]
        wp.copy(signs, self.signs)
        sending = self.scene.device.stream  # Warp's default is the first GPU's, and refuses another's event
        return Letter(time, list(self.pool.counts), signs, sending.record_event(sent))

    def open(self, letter: "Letter") -> Vital:
        """What it says, once it is here."""
        return self._vital(letter.read(), letter.counts)

    def broken(self, bits: int | None = None) -> str | None:
        """What fault bits, by default those of the pool now, say of a run that has blown up."""
        bits = int(self.pool.fault.numpy()[0]) if bits is None else bits
        if bits & FAULT_ASTRAY:
            return f"a particle was thrown out of the domain, or faster than {self.scene.top_speed:.3g} m/s"
        if bits & FAULT_STATE:
            return "a particle's state is not finite, or beyond that of any matter"
        return None

    def _vital(self, signs: Sequence[float], counts: Sequence[int]) -> Vital:
        speed, bad, kinetic, potential, bits = signs
        broken = self.broken(int(bits))
        found = complaint(int(bad), speed, self.scene.top_speed, kinetic, self._supply(counts), broken)
        return Vital(speed, kinetic, potential, found, broken=broken, bits=int(bits))

    def _supply(self, counts: Sequence[int]) -> float:
        """Energy that bodies, nozzle, gravity and expansion can have brought to so many particles a world [J]."""
        scenarios = self.scene.scenarios
        mass = sum(n * s.material.density * s.spacing**3 for n, s in zip(counts, scenarios, strict=True))
        return 2.0 * mass * self._mass_energy

    @cached_property
    def _mass_energy(self) -> float:
        return mass_energy(self.scene.scenario, self.scene.top_wave_speed)


@dataclass
class Letter:
    """A reading on its way from a GPU, of a time [s] at which each world had so many particles."""

    time: float
    counts: list[int]
    signs: Any
    sent: Any = None

    def read(self) -> list[float]:
        """Its numbers; waits until they are here."""
        if self.sent is not None:
            wp.synchronize_event(self.sent)
            self.signs, self.sent = self.signs.numpy().tolist(), None
        return self.signs

    def copy(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {"time": self.time, "counts": self.counts, "signs": self.read()}


def ranges_of(pool: Pool) -> Ranges:
    """What a pool's fields, all of which have been added by now, may hold."""
    found = Ranges()
    kinds = {name: WHOLE if array.dtype is wp.int32 else NUMBERS for name, array in pool.fields.items()}
    kinds["position"] = PLACES
    most = 2.0**31 - 256.0  # the largest float32 that is an int32
    ranges = [
        (max(low, -most), min(high, most)) if kinds[name] == WHOLE else (low, high)
        for name, (low, high) in pool.ranges.items()
    ]
    with wp.ScopedDevice(pool.scene.device):
        found.holds = wp.array(list(kinds.values()), dtype=int)
        found.low = wp.array([low for low, _ in ranges], dtype=float)
        found.high = wp.array([high for _, high in ranges], dtype=float)
    return found
