"""A fourth method, as small as the contract allows: particles fly and stop at walls."""

from typing import Any, ClassVar

import numpy as np
import warp as wp

from fluidbench.method.contract import Config
from fluidbench.method.features import Feature
from fluidbench.method.timestep import Bound
from fluidbench.native.scene import Box, Force, force_at
from fluidbench.native.solver import Solver

wp.set_module_options({"enable_backward": False})


@wp.kernel
def fly(
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    box: Box,
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        v = velocity[i]
        if held[i] == 0:
            v += dt[world] * force_at(force[world], position[i])
        x = position[i] + dt[world] * v
        inside = wp.max(wp.min(x, box.upper), box.lower)
        if wp.length_sq(inside - x) > 0.0:
            v = wp.vec3(0.0, 0.0, 0.0)
        position[i] = inside
        velocity[i] = v


class Ballistic(Solver):
    """No interaction at all."""

    name = "ballistic"
    paradigm = "projectiles"
    features: ClassVar = frozenset(Feature)
    Config: ClassVar = Config
    passes = ("fly",)

    @classmethod
    def bounds(cls, scenario, config, speed) -> list[Bound]:
        return [Bound("advective", scenario.spacing / speed, "d / v", "one spacing")]

    def __init__(self, scene, pool, config, backend="warp", threads=1) -> None:
        self.scene, self.pool, self.config = scene, pool, config

    def substep(self) -> None:
        pool, scene = self.pool, self.scene
        inputs: list[Any] = [pool.capacity, pool.count, scene.dt, scene.force, pool.held, scene.box]
        wp.launch(fly, pool.size, [*inputs, pool.position, pool.velocity], device=scene.device)

    def harden(self, due) -> None:
        wp.copy(self.pool.phase, due)

    def densities(self) -> np.ndarray:
        return np.full(self.pool.size, self.scene.scenario.material.density)

    def footprint(self) -> dict[str, int]:
        return {}
