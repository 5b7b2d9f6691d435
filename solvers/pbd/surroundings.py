"""What PBD keeps of how matter lies about its particles, beside the kernels (surroundings_warp.py)."""

from typing import Any

import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .numbers import MOVING
from .surroundings_warp import Surrounding


class Surroundings:
    """What the tension of matter adds to a pool, and what its passes take."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        self.data = data = Surrounding()
        data.enclosure = pool.add_field("enclosure", float)
        data.overread, data.bias = pool.add_field("overread", float), pool.add_field("bias", float)
        data.fabric_normal = pool.add_field("fabric_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0))
        data.fabric_shear = pool.add_field("fabric_shear", wp.vec3)
        self.lack = pool.add_field("lack", float)
        with wp.ScopedDevice(scene.device):
            self.moving = wp.zeros(pool.size * MOVING // 4, dtype=wp.vec4)

    def hand_to(self, data: Any) -> None:
        """Let the passes of another structure read and write it, too."""
        for name in ("enclosure", "bias", "fabric_normal", "fabric_shear"):
            setattr(data, name, getattr(self.data, name))

    def footprint(self) -> dict[str, int]:
        return {"moving": self.moving.capacity}
