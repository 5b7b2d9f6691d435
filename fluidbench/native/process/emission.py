"""Continuous extrusion: the same stream of particles for every method, exact in mass whatever the time step.

The stream is a column of discs one spacing apart. A disc enters the nozzle a few spacings above the exit, is held
there (it moves as the piston pushes it, whatever the forces), and is released with the nozzle's velocity plus the exit
velocity when it reaches the exit. Discs inside the nozzle give the outlet a full neighbourhood and keep the flow rate
when the bead pushes back. Everything is a function of the scenario and of the tick, never of a method's substep.
"""

import numpy as np
import warp as wp

from ...method.frame import CARRIED, FREE
from ..clock import Hours
from ..crew import index_of
from ..pool import Pool
from ..scene import Scene

wp.set_module_options({"enable_backward": False})


@wp.struct
class Pipe:
    """The stream on the device; a particle's row follows from its number in the stream."""

    first_origin: int
    points: int  # of a row
    volume: float
    offsets: wp.array(dtype=wp.vec2)  # of each particle about the axis
    speed: wp.array(dtype=float)  # [m/s]
    extruding: wp.array(dtype=float)
    release_time: wp.array(dtype=float)
    birth_time: wp.array(dtype=float)
    release_point: wp.array(dtype=wp.vec3)
    release_velocity: wp.array(dtype=wp.vec3)


@wp.func
def inside_nozzle(pipe: Pipe, number: int, hours: Hours, row: int):
    """Where particle `number` of the stream is at the hour of a row."""
    offset = pipe.offsets[number]
    line = number / pipe.points
    rise = pipe.speed[line] * (pipe.extruding[line] - hours.extruded[row])
    return hours.exit[row] + wp.vec3(offset[0], offset[1], rise)


@wp.kernel
def feed(
    share: wp.vec3i,
    hours: Hours,
    pipe: Pipe,
    inserted: wp.array(dtype=int),
    densities: wp.array2d(dtype=float),
    capacity: int,
    count: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    birth_time: wp.array(dtype=float),
    origin: wp.array(dtype=int),
):
    """Put what the stream feeds now into the nozzle of each world, behind all that is there; release the particles
    whose time has come and move the others on to their place at the next tick."""
    i = index_of(share, wp.tid())
    world = i / capacity
    row = hours.row[0]
    fresh = i - world * capacity - count[world]  # that it is among those put in now, if not negative
    if fresh >= 0 and fresh < hours.entered[row] - inserted[0]:
        number = inserted[0] + fresh
        position[i] = inside_nozzle(pipe, number, hours, row)
        volume[i] = pipe.volume
        mass[i] = pipe.volume * densities[world, 0]
        held[i] = CARRIED
        birth_time[i] = pipe.birth_time[number / pipe.points]
        origin[i] = pipe.first_origin + number
    if fresh < wp.max(hours.entered[row] - inserted[0], 0) and held[i] == CARRIED:
        number = origin[i] - pipe.first_origin
        layer = number / pipe.points
        offset = pipe.offsets[number]
        late = hours.time[row] - pipe.release_time[layer]
        if late >= 0.0:
            held[i] = FREE
            velocity[i] = pipe.release_velocity[layer]
            position[i] = pipe.release_point[layer] + wp.vec3(offset[0], offset[1], 0.0) + late * velocity[i]
        else:
            velocity[i] = (inside_nozzle(pipe, number, hours, row + 1) - position[i]) / hours.tick


@wp.kernel
def admit(hours: Hours, inserted: wp.array(dtype=int), count: wp.array(dtype=int)):
    """What was put in counts from now on."""
    entered = hours.entered[hours.row[0]]
    for world in range(count.shape[0]):
        count[world] = count[world] + wp.max(entered - inserted[0], 0)
    inserted[0] = wp.max(entered, inserted[0])


class Emission:
    """Feeds the pool from a scenario's nozzle, once a tick."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        stream = scene.clock.stream
        assert stream is not None
        self.scene, self.pool, self.stream = scene, pool, stream
        self.inserted = self.released = 0
        self.pipe = Pipe()
        self.pipe.first_origin, self.pipe.points, self.pipe.volume = pool.counts[0], stream.points, stream.volume
        columns = {
            "offsets": (stream.offset, wp.vec2),
            "speed": (stream.nozzle.speed * stream.pace, float),
            "extruding": (stream.extruding, float),
            "release_time": (stream.release_time, float),
            "birth_time": (stream.birth_time, float),
            "release_point": (stream.release_point, wp.vec3),
            "release_velocity": (stream.velocity, wp.vec3),
        }
        for name, (values, dtype) in columns.items():
            setattr(self.pipe, name, wp.array(np.asarray(values, np.float32), dtype=dtype, device=scene.device))
        densities = [[s.material.density] for s in scene.scenarios]
        with wp.ScopedDevice(scene.device):
            self.densities = wp.array(densities, dtype=float, ndim=2)
            self._inserted = wp.zeros(1, dtype=int)

    def progress(self) -> list[int]:
        """How many particles are in the nozzle or beyond, and how many rows were let go."""
        return [self.inserted, self.released]

    def go_on(self, progress: list[int]) -> None:
        """From where another one came to."""
        self.inserted, self.released = progress
        self._inserted.fill_(self.inserted)

    def expect(self) -> bool:
        """What the present hour brings, as far as the host must know it; whether the nozzle still holds anything that
        is to be moved. Raises OutOfCapacity."""
        pool, clock = self.pool, self.scene.clock
        fresh = clock.entered - self.inserted
        if fresh > 0:
            for world in range(pool.worlds):
                pool.need(world, fresh)
                pool.counts[world] += fresh
            self.inserted += fresh
        before, self.released = self.released, clock.released
        pool.stale |= fresh > 0 or self.released > before
        return before < len(self.pipe.extruding)

    def feed(self) -> None:
        """Enqueue what the hour of the clock brings: insert, release, and move what is in the nozzle on its way to its
        place one tick later."""
        pool, launch, hours = self.pool, self.scene.crew.launch, self.scene.clock.hours
        launch(
            feed,
            pool.size,
            [hours, self.pipe, self._inserted, self.densities, pool.capacity, pool.count],
            [
                pool.position,
                pool.velocity,
                pool.mass,
                pool.volume,
                pool.held,
                pool.birth_time,
                pool.origin,
            ],
        )
        launch(admit, 1, [hours, self._inserted, pool.count])

    def advance(self, now: float, tick: float) -> None:
        """All of it at any time `now` [s], for a tick of any length [s]."""
        self.scene.clock.set(now, tick)
        if self.expect():
            self.feed()
