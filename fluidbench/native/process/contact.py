"""Contact of all particles with the collider, after every substep of whatever method.

A particle nearer than half a spacing loses the velocity with which it comes nearer, as seen from the moving collider,
slides with Coulomb friction, and is pushed out of what it has entered over a few substeps. Only velocities change:
positions follow by the method's own step.
"""

import numpy as np
import warp as wp

from ...method.frame import FREE
from ..carriage import Pose, place_of
from ..crew import index_of
from ..pool import Pool
from ..scene import Scene

wp.set_module_options({"enable_backward": False})

SKIN = wp.constant(0.5)  # distance of contact, over the spacing
RELAX = wp.constant(0.1)  # share of the depth that a substep takes back


@wp.struct
class Parts:
    """The collider on the device."""

    center: wp.array(dtype=wp.vec3)  # relative to what it is carried by, clearance included [m]
    half: wp.array(dtype=wp.vec3)
    round: wp.array(dtype=int)  # 1 for a sphere
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
    pose: Pose,
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
        base = place_of(pose)
        v = velocity[i] - pose.velocity[0]
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
            velocity[i] = v + pose.velocity[0]


class Contact:
    """Lets the collider, which is carried along the toolpath, push."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        collider, nozzle = scene.scenario.collider, scene.scenario.nozzle
        assert collider is not None and nozzle is not None and scene.carriage is not None
        self.scene, self.pool, self.pose = scene, pool, scene.carriage.pose
        lift = np.array([0.0, 0.0, collider.clearance - nozzle.rise])
        self.parts = Parts()
        self.parts.friction = collider.friction
        centers = np.array([np.asarray(part.center) + lift for part in collider.parts], np.float32)
        halves = np.array([part.half for part in collider.parts], np.float32)
        with wp.ScopedDevice(scene.device):
            self.parts.center = wp.array(centers, dtype=wp.vec3)
            self.parts.half = wp.array(halves, dtype=wp.vec3)
            self.parts.round = wp.array([int(part.kind == "sphere") for part in collider.parts], dtype=int)

    def substep(self) -> None:
        """Enqueue the contact of one substep; captured with the solver's own."""
        pool, scene = self.pool, self.scene
        inputs = [self.parts, self.pose, scene.spacing, pool.capacity, pool.count, scene.dt, pool.held, pool.position]
        scene.crew.launch(collide, pool.size, inputs, [pool.velocity])

    def footprint(self) -> dict[str, int]:
        names = ("center", "half", "round")
        return {f"collider.{name}": getattr(self.parts, name).capacity for name in names}
