"""Position-based dynamics."""

from .solver import SolverPBD

__all__ = ["SolverPBD"]
