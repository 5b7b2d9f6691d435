"""What elastic stress adds to position-based dynamics beside its kernels (elastic_warp.py)."""

import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from ..constitutive import STRETCHED
from ..flow import plastic_strains
from .elastic_warp import Straining
from .numbers import MOVING, PULLING


class Elasticity:
    """What elastic stress adds to a pool, and what its passes take."""

    def __init__(self, scene: Scene, pool: Pool) -> None:
        within = (1.0 / STRETCHED, STRETCHED)
        self.kept = pool.add_field("kept", float, 1.0)
        self.straining = data = Straining()
        data.volume_ratio = pool.add_field("volume_ratio", float, 1.0, within=within)
        data.elastic_normal = pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0), within=within)
        data.elastic_shear = pool.add_field("elastic_shear", wp.vec3)
        data.off_linear = pool.add_field("off_linear", wp.vec3)
        data.plastic = plastic_strains(scene, pool)
        data.enclosure = pool.add_field("enclosure", float)
        data.overread, data.bias = pool.add_field("overread", float), pool.add_field("bias", float)
        data.fabric_normal = pool.add_field("fabric_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0))
        data.fabric_shear = pool.add_field("fabric_shear", wp.vec3)
        data.kept, data.pulled = self.kept, pool.add_field("pulled", wp.vec3)
        with wp.ScopedDevice(scene.device):
            self.moving = wp.zeros(pool.size * MOVING // 4, dtype=wp.vec4)
            self.pulling = wp.zeros(pool.size * PULLING // 4, dtype=wp.vec4)
        data.dt, data.phases, data.phase_of, data.held = scene.dt, scene.phases, pool.phase, pool.held
        data.mass, data.volume, data.pulling = pool.mass, pool.volume, self.pulling

    def footprint(self) -> dict[str, int]:
        return {name: getattr(self, name).capacity for name in ("moving", "pulling")}
