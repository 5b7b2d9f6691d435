"""What elastic stress adds to position-based dynamics beside its kernels (elastic_warp.py)."""

import warp as wp

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from ..constitutive import STRETCHED
from ..flow import plastic_strains
from .elastic_warp import Straining
from .numbers import PULLING
from .surroundings import Surroundings


class Elasticity:
    """What elastic stress adds to a pool, and what its passes take."""

    def __init__(self, scene: Scene, pool: Pool, around: Surroundings) -> None:
        within = (1.0 / STRETCHED, STRETCHED)
        self.kept = pool.add_field("kept", float, 1.0)
        self.straining = data = Straining()
        data.volume_ratio = pool.add_field("volume_ratio", float, 1.0, within=within)
        data.elastic_normal = pool.add_field("elastic_normal", wp.vec3, wp.vec3(1.0, 1.0, 1.0), within=within)
        data.elastic_shear = pool.add_field("elastic_shear", wp.vec3)
        data.off_linear = pool.add_field("off_linear", wp.vec3)
        data.plastic = plastic_strains(scene, pool)
        around.hand_to(data)
        data.overread = around.data.overread
        data.kept, data.pulled = self.kept, pool.add_field("pulled", wp.vec3)
        with wp.ScopedDevice(scene.device):
            self.pulling = wp.zeros(pool.size * PULLING // 4, dtype=wp.vec4)
        data.dt, data.phases, data.phase_of, data.held = scene.dt, scene.phases, pool.phase, pool.held
        data.mass, data.volume, data.pulling = pool.mass, pool.volume, self.pulling

    def footprint(self) -> dict[str, int]:
        return {"pulling": self.pulling.capacity}
