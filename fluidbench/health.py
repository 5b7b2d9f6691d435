"""Is the run still sound? Non-finite state, runaway speed and unfed energy, found on the device."""

import math
from dataclasses import dataclass

import numpy as np
import warp as wp

from .particles import Pool
from .scene import Force, Scene, force_potential

wp.set_module_options({"enable_backward": False})
SPEED_FACTOR = 3.0  # matter faster than this many times (wave speed + reference speed) is no solution
ENERGY_FACTOR = 2.0  # kinetic energy beyond this many times what was ever supplied comes from the method


@wp.kernel
def inspect(
    lanes: int, capacity: int, count: wp.array(dtype=int), position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3), mass: wp.array(dtype=float), force: wp.array(dtype=Force),
    # outputs
    top_speed: wp.array(dtype=float), broken: wp.array(dtype=int), energy: wp.array2d(dtype=wp.float64),
):  # fmt: skip
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
        wp.atomic_add(broken, world, bad)
    if kinetic != wp.float64(0.0) or potential != wp.float64(0.0):
        wp.atomic_add(energy, world, 0, kinetic)
        wp.atomic_add(energy, world, 1, potential)


@dataclass(frozen=True)
class Vital:
    """One reading over all worlds: largest speed [m/s], energies summed [J], and what is wrong, if anything."""

    speed: float
    kinetic: float
    potential: float
    complaint: str | None


class Health:
    """Reads the pool's vital signs; `supplied` tracks the energy that bodies, nozzle and gravity brought in."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        self.scene, self.pool = scene, pool
        self.limit = SPEED_FACTOR * (scene.top_wave_speed + scene.scenario.reference_speed)
        self.lanes = min(scene.lanes, 4096)
        with wp.ScopedDevice(scene.device):
            self.top_speed = wp.zeros(pool.worlds, dtype=float)
            self.broken = wp.zeros(pool.worlds, dtype=int)
            self.energy = wp.zeros((pool.worlds, 2), dtype=wp.float64)

    def _mass_energy(self) -> float:
        """Most energy per unit mass that the scenario can turn into motion [J/kg]."""
        s = self.scene.scenario
        size = np.abs(np.asarray(s.domain.upper) - np.asarray(s.domain.lower))
        reach = size @ np.abs(s.acceleration) + size @ np.abs(s.gradient) @ size
        crowded = s.material.expansion is not None and s.material.expansion.kind == "spawn"
        pressed = 0.05 * self.scene.top_wave_speed**2 if crowded else 0.0  # spawned children lie over each other
        return 0.5 * s.reference_speed**2 + float(reach) + pressed

    def read(self) -> Vital:
        """Inspect all worlds; synchronises with the device."""
        for array in (self.top_speed, self.broken, self.energy):
            array.zero_()
        pool, scene = self.pool, self.scene
        wp.launch(
            inspect,
            (pool.worlds, self.lanes),
            [self.lanes, pool.capacity, pool.count, pool.position, pool.velocity, pool.mass, scene.force],
            [self.top_speed, self.broken, self.energy],
            device=scene.device,
        )
        speed = float(self.top_speed.numpy().max())
        kinetic, potential = self.energy.numpy().sum(axis=0)
        return Vital(speed, float(kinetic), float(potential), self._complaint(speed, float(kinetic)))

    def _complaint(self, speed: float, kinetic: float) -> str | None:
        bad = int(self.broken.numpy().sum())
        if bad:
            return f"{bad} particles have a non-finite position or velocity"
        if not math.isfinite(speed) or speed > self.limit:
            return f"a particle moves at {speed:.3g} m/s; more than {self.limit:.3g} m/s cannot come from the scenario"
        mass = sum(
            n * s.material.density * s.spacing**3 for n, s in zip(self.pool.counts, self.scene.scenarios, strict=True)
        )
        supply = 2.0 * mass * self._mass_energy()
        if kinetic > ENERGY_FACTOR * supply:
            return f"kinetic energy of {kinetic:.3g} J exceeds what the scenario can supply ({supply:.3g} J)"
        return None
