"""Weakly compressible SPH."""

from .solver import SolverSPH

__all__ = ["SolverSPH"]
