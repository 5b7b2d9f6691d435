"""Steady flow along a round bore that matter sticks to: its profile, and the pressure that it takes.

A Herschel-Bulkley fluid flows where the shear stress tau_w r / R exceeds its yield stress,
tau = tau_y + k (du/dr)^n; a Newtonian one has tau_y = 0 and n = 1 (Hagen and Poiseuille), a Bingham one n = 1
(Buckingham and Reiner: Q = pi R^4 dp / (8 k L) (1 - 4/3 phi + phi^4 / 3), phi = tau_y / tau_w).
"""

from dataclasses import dataclass

import numpy as np

from .material import Material

FINE = 2001  # radii between which speeds are integrated
PLASTIC = 1e-6  # viscous share of the stress at the wall below which a paste moves as a plug


@dataclass(frozen=True)
class Bore:
    """Flow at a mean speed U [m/s] along a bore of diameter D [m]."""

    material: Material
    diameter: float
    speed: float

    @property
    def _law(self) -> tuple[float, float, float]:
        """(tau_y [Pa], k [Pa s^n], n) of the flowing matter."""
        m = self.material
        if m.yield_stress is None or m.youngs_modulus is None:
            return 0.0, m.steady_viscosity, 1.0
        return m.yield_stress, m.plastic_viscosity + (m.viscosity if m.flow_index == 1.0 else 0.0), m.flow_index

    @property
    def wall_stress(self) -> float:
        """Shear stress at the wall tau_w [Pa]; the pressure gradient is 4 tau_w / D."""
        from scipy.optimize import brentq

        threshold, k, n = self._law
        viscous = k * (8.0 * self.speed / self.diameter) ** n
        if viscous <= PLASTIC * threshold:
            return threshold
        over = brentq(lambda over: self._mean(over * viscous) / self.speed - 1.0, 1e-9, 1e3)
        return threshold + over * viscous

    def pressure_drop(self, length: float) -> float:
        """Over a length [m] of the bore [Pa]."""
        return 4.0 * self.wall_stress * length / self.diameter

    def profile(self, radius: np.ndarray) -> np.ndarray:
        """Speed over its mean at radii [m] from the axis [-]; beyond the wall as its formula goes on."""
        threshold = self._law[0]
        over = self.wall_stress - threshold
        if over <= PLASTIC * threshold or over <= 0.0:
            return np.ones_like(radius)
        return self._speed(2.0 * radius / self.diameter, over) / self.speed

    def _speed(self, share: np.ndarray, over: float) -> np.ndarray:
        """At r / R, for a stress at the wall that exceeds the yield stress by `over` [m/s]."""
        threshold, k, n = self._law
        m = 1.0 + 1.0 / n
        wall = threshold + over
        flowing = np.maximum(wall * share - threshold, 0.0)
        return 0.5 * self.diameter / (wall * k ** (1.0 / n) * m) * (over**m - flowing**m)

    def _mean(self, over: float) -> float:
        share = np.linspace(0.0, 1.0, FINE)
        return float(np.trapezoid(2.0 * share * self._speed(share, over), share))
