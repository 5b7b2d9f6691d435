"""How MPM's pressure leaks where matter moves through the grid (docs/physics/mpm.md): one dimension, double precision.

A lattice at J = 0.95 drifts through a periodic grid at 0.25 m/s. It gains no room, so that J should stay. Prints the
share of its pressure that it loses (two minutes):

    python benchmarks/mpm_pressure_leak.py
"""

import numpy as np

PARTICLES, SPACING, DENSITY, STIFFNESS, SPEED = 48, 2e-3, 1000.0, 9810.0, 0.25  # [-], [m], [kg/m^3], [Pa], [m/s]
SQUEEZED = 0.95  # volume over that at rest


def lost(ratio: float, viscosity: float = 20.0, disorder: float = 0.0, time: float = 1.0) -> tuple[float, float]:
    """(share of the pressure that is gone after a time [s], cells crossed). Transfers as in solvers/mpm: MLS-MPM, APIC,
    quadratic splines; `viscosity` [Pa s], `disorder` of positions over the spacing."""
    cells = round(PARTICLES / ratio)
    length = PARTICLES * SPACING
    dx, volume = length / cells, SPACING / SQUEEZED
    mass, noise = DENSITY * volume, np.random.default_rng(0).standard_normal(PARTICLES)
    x = (np.arange(PARTICLES) + 0.5 + disorder * noise) * SPACING
    v, gradient, j = np.full(PARTICLES, SPEED), np.zeros(PARTICLES), np.full(PARTICLES, SQUEEZED)
    viscous = dx * dx / (4.0 * max(4.0 / 3.0 * viscosity / DENSITY, 1e-12))
    dt = 0.5 * min(dx / np.sqrt(3.0 * STIFFNESS / DENSITY), viscous)
    for _ in range(int(time / dt)):
        j = j * (1.0 + dt * gradient)
        tau = -STIFFNESS * (1.0 - j) + 4.0 / 3.0 * viscosity * gradient
        base = np.floor(x / dx - 0.5).astype(int)
        f = x / dx - base
        w = np.stack([0.5 * (1.5 - f) ** 2, 0.75 - (f - 1.0) ** 2, 0.5 * (f - 0.5) ** 2])
        nodes = (base + np.arange(3)[:, None]) % cells
        away = np.arange(3)[:, None] - f
        given = w * (mass * v + (mass * gradient * dx - 4.0 * dt * volume * tau / dx) * away)
        momentum = np.bincount(nodes.ravel(), given.ravel(), cells)
        u = momentum / np.bincount(nodes.ravel(), mass * w.ravel(), cells)
        v, gradient = (w * u[nodes]).sum(0), 4.0 / dx * (w * away * u[nodes]).sum(0)
        x = x + dt * v
    return 1.0 - (1.0 - j.mean()) / (1.0 - SQUEEZED), SPEED * time / dx


def main() -> None:
    for ratio in (1.0, 1.2, 4.0 / 3.0, 1.5, 2.0):
        shares = ", ".join(f"{100 * lost(ratio, viscosity)[0]:.1f} %" for viscosity in (0.0, 20.0, 200.0))
        loose, crossed = lost(ratio, disorder=0.3, time=0.5)
        print(f"grid ratio {ratio:.3g}: {shares} at 0, 20, 200 Pa s in {2 * crossed:.0f} cells; ", end="")
        print(f"out of order {100 * loose:.0f} % in {crossed:.0f}")


if __name__ == "__main__":
    main()
