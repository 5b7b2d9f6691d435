"""Continuous extrusion: the same stream of particles for every method, exact in mass whatever the time step.

The stream is a column of discs one spacing apart. A disc enters the nozzle a few spacings above the exit, is held
there (it moves as the piston pushes it, whatever the forces), and is released with the nozzle's velocity plus the exit
velocity when it reaches the exit. Discs inside the nozzle give the outlet a full neighbourhood and keep the flow rate
when the bead pushes back. Everything is a function of the scenario and of the tick, never of a method's substep.
"""

import numpy as np
import warp as wp

from ...method.frame import CARRIED, FREE
from ...scenario.stream import Stream
from ..pool import Pool
from ..scene import Scene

wp.set_module_options({"enable_backward": False})


@wp.struct
class Pipe:
    """The stream on the device; disc and point of a particle follow from its number in the stream."""

    first_origin: int
    points: int
    exit_speed: float
    volume: float
    offsets: wp.array(dtype=wp.vec2)
    extruding: wp.array(dtype=float)
    release_time: wp.array(dtype=float)
    release_point: wp.array(dtype=wp.vec3)
    release_velocity: wp.array(dtype=wp.vec3)


@wp.func
def inside_nozzle(pipe: Pipe, number: int, exit_point: wp.vec3, extruded: float):
    """Where particle `number` of the stream is while the nozzle exit is at `exit_point`."""
    offset = pipe.offsets[number % pipe.points]
    rise = pipe.exit_speed * (pipe.extruding[number / pipe.points] - extruded)
    return exit_point + wp.vec3(offset[0], offset[1], rise)


@wp.kernel
def insert(
    pipe: Pipe,
    first: int,
    exit_point: wp.vec3,
    extruded: float,
    densities: wp.array2d(dtype=float),
    capacity: int,
    count: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    birth_time: wp.array(dtype=float),
    origin: wp.array(dtype=int),
):
    """Put the stream's particles first, first + 1, ... into the nozzle of each world."""
    world, i = wp.tid()
    number = first + i
    slot = world * capacity + count[world] + i
    position[slot] = inside_nozzle(pipe, number, exit_point, extruded)
    volume[slot] = pipe.volume
    mass[slot] = pipe.volume * densities[world, 0]
    held[slot] = CARRIED
    birth_time[slot] = pipe.release_time[number / pipe.points]
    origin[slot] = pipe.first_origin + number


@wp.kernel
def push(
    pipe: Pipe,
    now: float,
    tick: float,
    next_exit: wp.vec3,
    next_extruded: float,
    capacity: int,
    count: wp.array(dtype=int),
    origin: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    held: wp.array(dtype=int),
):
    """Release the particles whose time has come and move the others on to their place at the next tick."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and held[i] == CARRIED:
        number = origin[i] - pipe.first_origin
        layer = number / pipe.points
        offset = pipe.offsets[number % pipe.points]
        late = now - pipe.release_time[layer]
        if late >= 0.0:
            held[i] = FREE
            velocity[i] = pipe.release_velocity[layer]
            position[i] = pipe.release_point[layer] + wp.vec3(offset[0], offset[1], 0.0) + late * velocity[i]
        else:
            velocity[i] = (inside_nozzle(pipe, number, next_exit, next_extruded) - position[i]) / tick


class Emission:
    """Feeds the pool from a scenario's nozzle, once a tick."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        self.scene, self.pool, self.stream = scene, pool, Stream(scene.scenario)
        self.inserted = self.released = 0
        stream, track, nozzle = self.stream, scene.scenario.track, scene.scenario.nozzle
        assert track is not None and nozzle is not None
        self.pipe = Pipe()
        self.pipe.first_origin, self.pipe.points = pool.counts[0], len(stream.offsets)
        self.pipe.exit_speed, self.pipe.volume = nozzle.speed, stream.volume
        columns = {
            "offsets": (stream.offsets, wp.vec2),
            "extruding": (stream.extruding, float),
            "release_time": (stream.release_time, float),
            "release_point": (track.at(stream.release_time), wp.vec3),
            "release_velocity": (stream.velocity, wp.vec3),
        }
        for name, (values, dtype) in columns.items():
            setattr(self.pipe, name, wp.array(np.asarray(values, np.float32), dtype=dtype, device=scene.device))
        densities = [[s.material.density] for s in scene.scenarios]
        self.densities = wp.array(densities, dtype=float, ndim=2, device=scene.device)

    def progress(self) -> list[int]:
        """How many particles are in the nozzle or beyond, and how many discs have left it."""
        return [self.inserted, self.released]

    def go_on(self, progress: list[int]) -> None:
        """From where another one came to."""
        self.inserted, self.released = progress

    def advance(self, now: float, tick: float) -> None:
        """Bring the nozzle's content to time `now` [s] and set it moving towards its place one tick later."""
        pool, stream, track = self.pool, self.stream, self.scene.scenario.track
        assert track is not None
        fresh = stream.entered(now) * len(stream.offsets) - self.inserted
        if fresh > 0:
            for world in range(pool.worlds):
                pool.need(world, fresh)
            wp.launch(
                insert,
                (pool.worlds, fresh),
                [
                    self.pipe,
                    self.inserted,
                    wp.vec3(*track.at(now)),
                    float(track.extruded(now)),
                    self.densities,
                    pool.capacity,
                    pool.count,
                ],
                [pool.position, pool.mass, pool.volume, pool.held, pool.birth_time, pool.origin],
                device=self.scene.device,
            )
            self.inserted += fresh
            for world in range(pool.worlds):
                pool.set_count(world, pool.counts[world] + fresh)
        gone = stream.released(now)
        pool.stale |= gone > self.released
        if self.released < len(stream.extruding):
            self.released = gone
            wp.launch(
                push,
                pool.size,
                [
                    self.pipe,
                    now,
                    tick,
                    wp.vec3(*track.at(now + tick)),
                    float(track.extruded(now + tick)),
                    pool.capacity,
                    pool.count,
                    pool.origin,
                ],
                [pool.position, pool.velocity, pool.held],
                device=self.scene.device,
            )
