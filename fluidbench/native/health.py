"""Is the run still sound? Broken state, runaway speed and unfed energy, found on the device.

Methods test each motion before walls act on it (FAULT_ASTRAY of the pool's fault bits), and SPH its density before its
floor (FAULT_STATE): a clamp is never all that stands between a blow-up and a result. `audit` tests everything that
particles carry, once a tick; `read` reads what method/vitals.py judges.
"""

from typing import Any

import warp as wp

from ..method.vitals import Vital, complaint, mass_energy
from .crew import raise_fault
from .pool import FAULT_ASTRAY, FAULT_STATE, Pool
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
class Fields:
    """Every field of a pool, as memory: what an audit needs to know of it."""

    address: wp.array(dtype=wp.uint64)
    holds: wp.array(dtype=int)
    width: wp.array(dtype=int)  # numbers a particle
    low: wp.array(dtype=float)
    high: wp.array(dtype=float)


@wp.kernel
def audit(
    lanes: int,
    fields: Fields,
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
    field, world, lane = wp.tid()
    width = int(fields.width[field])
    low = float(fields.low[field])
    high = float(fields.high[field])
    i = (world * capacity) * width + lane
    end = (world * capacity + count[world]) * width
    broken = bool(False)
    if fields.holds[field] == WHOLE:
        numbers = wp.array(ptr=fields.address[field], shape=(end,), dtype=wp.int32)
        while i < end:
            if numbers[i] < int(low) or numbers[i] > int(high):
                broken = True
                numbers[i] = int(low)
            i += lanes
    else:
        values = wp.array(ptr=fields.address[field], shape=(end,), dtype=wp.float32)
        places = fields.holds[field] == PLACES
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
        raise_fault(fault, wp.where(fields.holds[field] == PLACES, FAULT_ASTRAY, FAULT_STATE))


class Health:
    """Reads the pool's vital signs; `supplied` tracks the energy that bodies, nozzle and gravity brought in."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        self.scene, self.pool = scene, pool
        self._audit: Any = None
        self.lanes = min(scene.lanes, 4096)
        with wp.ScopedDevice(scene.device):
            self.top_speed = wp.zeros(pool.worlds, dtype=float)
            self.nonfinite = wp.zeros(pool.worlds, dtype=int)
            self.energy = wp.zeros((pool.worlds, 2), dtype=wp.float64)

    def audit(self) -> None:
        """Enqueue the test of every field of the pool against its range; it marks the pool's fault bits."""
        if self._audit is None:
            pool, scene, self._fields = self.pool, self.scene, self._described()
            with wp.ScopedCapture(device=scene.device) as capture:  # replayed: arguments cost more than the test itself
                wp.launch(
                    audit,
                    (len(pool.fields), pool.worlds, self.lanes),
                    [self.lanes, self._fields, scene.box, pool.capacity, pool.count],
                    [pool.fault],
                    device=scene.device,
                )
            self._audit = capture.graph
        wp.capture_launch(self._audit)

    def _described(self) -> Fields:
        """The pool's fields, all of which have been added by now."""
        fields, pool = Fields(), self.pool
        kinds = {name: WHOLE if array.dtype is wp.int32 else NUMBERS for name, array in pool.fields.items()}
        kinds["position"] = PLACES
        most = 2.0**31 - 256.0  # the largest float32 that is an int32
        ranges = [
            (max(low, -most), min(high, most)) if kinds[name] == WHOLE else (low, high)
            for name, (low, high) in pool.ranges.items()
        ]
        with wp.ScopedDevice(self.scene.device):
            fields.address = wp.array([array.ptr for array in pool.fields.values()], dtype=wp.uint64)
            fields.holds = wp.array(list(kinds.values()), dtype=int)
            sizes = [wp.types.type_size_in_bytes(array.dtype) // 4 for array in pool.fields.values()]
            fields.width = wp.array(sizes, dtype=int)
            fields.low = wp.array([low for low, _ in ranges], dtype=float)
            fields.high = wp.array([high for _, high in ranges], dtype=float)
        return fields

    def broken(self) -> str | None:
        """What a fault bit says of a run that has blown up; synchronises with the device."""
        bits = int(self.pool.fault.numpy()[0])
        if bits & FAULT_ASTRAY:
            return f"a particle was thrown out of the domain, or faster than {self.scene.top_speed:.3g} m/s"
        if bits & FAULT_STATE:
            return "a particle's state is not finite, or beyond that of any matter"
        return None

    def read(self) -> Vital:
        """Inspect all worlds; synchronises with the device."""
        for array in (self.top_speed, self.nonfinite, self.energy):
            array.zero_()
        pool, scene = self.pool, self.scene
        wp.launch(
            inspect,
            (pool.worlds, self.lanes),
            [self.lanes, pool.capacity, pool.count, pool.position, pool.velocity, pool.mass, scene.force],
            [self.top_speed, self.nonfinite, self.energy],
            device=scene.device,
        )
        speed = float(self.top_speed.numpy().max())
        kinetic, potential = self.energy.numpy().sum(axis=0)
        broken = self.broken()
        found = self._complaint(speed, float(kinetic), broken)
        return Vital(speed, float(kinetic), float(potential), found, broken=broken)

    def _complaint(self, speed: float, kinetic: float, broken: str | None) -> str | None:
        scene = self.scene
        mass = sum(
            n * s.material.density * s.spacing**3 for n, s in zip(self.pool.counts, scene.scenarios, strict=True)
        )
        supply = 2.0 * mass * mass_energy(scene.scenario, scene.top_wave_speed)
        return complaint(int(self.nonfinite.numpy().sum()), speed, scene.top_speed, kinetic, supply, broken)
