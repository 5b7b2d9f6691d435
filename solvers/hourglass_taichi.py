"""Hourglass control in Taichi: see hourglass.py."""

from .taichi_bridge import ti


@ti.func
def off_linear_after(z, gradient, q, kept, dt):
    """z [1/m] after a step dt [s] in which the share `kept` of the deviator was kept."""
    spin = 0.5 * (gradient - gradient.transpose())
    return kept * (z + dt * (spin @ (z + 0.5 * dt * spin @ z) + q))
