"""What a method's state says on the host: density and stress of every particle slot."""

import numpy as np

from fluidbench.particles import Pool
from fluidbench.scene import Scene


def present_density(pool: Pool, volume_ratio: np.ndarray) -> np.ndarray:
    """m / (V0 J) of every slot, shape (worlds * capacity,) [kg/m^3]; 0 in slots that never held a particle."""
    return pool.mass.numpy() / np.maximum(pool.volume.numpy() * volume_ratio, 1e-30)


def shear_stress(scene: Scene, pool: Pool) -> np.ndarray | None:
    """Elastic shear stress sqrt(J2) = G |dev b| / sqrt(2) of every slot, shape (worlds * capacity,) [Pa] (Kirchhoff);
    None where nothing has shear stiffness."""
    if not scene.elastic:
        return None
    modulus = scene.phases.numpy()["shear_modulus"]
    world = np.repeat(np.arange(pool.worlds), pool.capacity)
    b, s = pool.elastic_normal.numpy().astype(float), pool.elastic_shear.numpy().astype(float)
    dev = b - b.mean(axis=1, keepdims=True)
    return modulus[world, pool.phase.numpy()] * np.sqrt(0.5 * (dev**2).sum(axis=1) + (s**2).sum(axis=1))
