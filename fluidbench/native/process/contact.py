"""Contact of all particles with the collider, after every substep of whatever method.

A particle nearer than half a spacing loses the velocity with which it comes nearer, as seen from the moving collider,
slides with Coulomb friction, and is pushed out of what it has entered over a few substeps. Only velocities change:
positions follow by the method's own step.
"""

import numpy as np
import warp as wp

from ...method.frame import FREE
from ..clock import Hours
from ..crew import index_of
from ..pool import Pool
from ..scene import Scene

wp.set_module_options({"enable_backward": False})

SKIN = wp.constant(0.5)  # distance of contact, over the spacing
RELAX = wp.constant(0.1)  # share of the depth that a substep takes back


@wp.struct
class Parts:
    """The collider on the device; the pose is that at the start of the tick."""

    center: wp.array(dtype=wp.vec3)  # relative to the nozzle exit, clearance included [m]
    half: wp.array(dtype=wp.vec3)
    round: wp.array(dtype=int)  # 1 for a sphere
    exit: wp.array(dtype=wp.vec3)  # [m]
    velocity: wp.array(dtype=wp.vec3)  # [m/s]
    elapsed: wp.array(dtype=float)  # since the start of the tick [s]
    friction: float


@wp.func
def surface(parts: Parts, k: int, r: wp.vec3):
    """(signed distance [m], outward normal) of part k at r, relative to its centre."""
    half = parts.half[k]
    distance = wp.length(r) - half[0]
    normal = r / wp.max(wp.length(r), 1.0e-9)
    if parts.round[k] == 0:
        gap = wp.vec3(wp.abs(r[0]) - half[0], wp.abs(r[1]) - half[1], wp.abs(r[2]) - half[2])
        outside = wp.vec3(wp.max(gap[0], 0.0), wp.max(gap[1], 0.0), wp.max(gap[2], 0.0))
        deep = wp.max(gap[0], wp.max(gap[1], gap[2]))
        distance = wp.length(outside) + wp.min(deep, 0.0)
        normal = wp.vec3(0.0, 0.0, 0.0)
        for axis in range(3):
            if deep > 0.0:
                normal[axis] = outside[axis] * wp.sign(r[axis])
            elif gap[axis] == deep:
                normal[axis] = wp.sign(r[axis])
        normal = wp.normalize(normal)
    return distance, normal


@wp.kernel
def collide(
    share: wp.vec3i,
    parts: Parts,
    spacing: float,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
):
    """Take the approach out of every touching particle's velocity, and friction out of its sliding."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        h = dt[world]
        base = parts.exit[0] + parts.elapsed[0] * parts.velocity[0]
        v = velocity[i] - parts.velocity[0]
        touched = int(0)
        for k in range(parts.half.shape[0]):
            distance, normal = surface(parts, k, position[i] - base - parts.center[k])
            gap = distance - SKIN * spacing
            approach = wp.dot(v, normal)
            away = wp.min(-RELAX * gap / h, 0.1 * spacing / h)
            if gap < 0.0 and approach < away:
                slide = v - approach * normal
                speed = wp.length(slide)
                grip = wp.min(parts.friction * (away - approach), speed)
                v = slide * (1.0 - grip / wp.max(speed, 1.0e-9)) + away * normal
                touched = 1
        if touched == 1:
            velocity[i] = v + parts.velocity[0]


@wp.kernel
def pose(hours: Hours, parts: Parts):
    """The collider goes with the nozzle."""
    row = hours.row[0]
    parts.exit[0] = hours.exit[row]
    parts.velocity[0] = hours.drift[row]
    parts.elapsed[0] = 0.0


@wp.kernel
def pass_time(dt: wp.array(dtype=float), elapsed: wp.array(dtype=float)):
    """The collider moves on by a substep."""
    elapsed[0] = elapsed[0] + dt[0]


class Contact:
    """Carries the collider along the toolpath and lets it push."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        collider = scene.scenario.collider
        assert collider is not None
        self.scene, self.pool = scene, pool
        lift = np.array([0.0, 0.0, collider.clearance])
        self.parts = Parts()
        self.parts.friction = collider.friction
        centers = np.array([np.asarray(part.center) + lift for part in collider.parts], np.float32)
        halves = np.array([part.half for part in collider.parts], np.float32)
        with wp.ScopedDevice(scene.device):
            self.parts.center = wp.array(centers, dtype=wp.vec3)
            self.parts.half = wp.array(halves, dtype=wp.vec3)
            self.parts.round = wp.array([int(part.kind == "sphere") for part in collider.parts], dtype=int)
            self.parts.exit, self.parts.velocity = wp.zeros(1, dtype=wp.vec3), wp.zeros(1, dtype=wp.vec3)
            self.parts.elapsed = wp.zeros(1, dtype=float)

    def follow(self) -> None:
        """Enqueue: put it where the nozzle is, moving to where it will be a tick later."""
        self.scene.crew.launch(pose, 1, [self.scene.clock.hours, self.parts])

    def advance(self, now: float, tick: float) -> None:
        """The same at any time `now` [s], for a tick of any length [s]."""
        self.scene.clock.set(now, tick)
        self.follow()

    def substep(self) -> None:
        """Enqueue the contact of one substep; captured with the solver's own."""
        pool, launch = self.pool, self.scene.crew.launch
        launch(pass_time, 1, [self.scene.dt], [self.parts.elapsed])
        launch(
            collide,
            pool.size,
            [self.parts, self.scene.spacing, pool.capacity, pool.count, self.scene.dt, pool.held, pool.position],
            [pool.velocity],
        )

    def footprint(self) -> dict[str, int]:
        names = ("center", "half", "round", "exit", "velocity", "elapsed")
        return {f"collider.{name}": getattr(self.parts, name).capacity for name in names}
