"""What a method's state says on the host: density and stress of every particle slot."""

from typing import Any

import numpy as np

from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .bind import rebound
from .constitutive import pressure

state = rebound(pressure, {"max": np.maximum})


def present_density(pool: Pool, volume_ratio: np.ndarray) -> np.ndarray:
    """m / (V0 J) of every slot, shape (worlds * capacity,) [kg/m^3]; 0 in slots that never held a particle."""
    return pool.mass.numpy() / np.maximum(pool.volume.numpy() * volume_ratio, 1e-30)


def pressures(scene: Scene, pool: Pool, densities: np.ndarray) -> np.ndarray:
    """Pressure of every slot by the equation of state, shape (worlds * capacity,) [Pa]; 0 in slots that never held a
    particle."""
    world = np.repeat(np.arange(pool.worlds), pool.capacity)
    table: Any = scene.phases.numpy()
    row = table[world, pool.phase.numpy()]
    rest = pool.mass.numpy() / np.maximum(pool.volume.numpy(), 1e-30)
    compression = densities.astype(float) / np.maximum(rest, 1e-30) - 1.0
    found = state(compression, row["bulk_modulus"], row["tait"], row["tension_limit"])
    return np.where(rest > 0, found, 0.0)


def shear_stress(scene: Scene, pool: Pool) -> np.ndarray | None:
    """Elastic shear stress sqrt(J2) = G |dev b| / sqrt(2) of every slot, shape (worlds * capacity,) [Pa] (Kirchhoff);
    None where nothing has shear stiffness."""
    if not scene.elastic:
        return None
    table: Any = scene.phases.numpy()
    modulus = table["shear_modulus"]
    world = np.repeat(np.arange(pool.worlds), pool.capacity)
    b, s = pool.elastic_normal.numpy().astype(float), pool.elastic_shear.numpy().astype(float)
    dev = b - b.mean(axis=1, keepdims=True)
    return modulus[world, pool.phase.numpy()] * np.sqrt(0.5 * (dev**2).sum(axis=1) + (s**2).sum(axis=1))
