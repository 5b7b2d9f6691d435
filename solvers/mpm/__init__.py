"""MLS-MPM with APIC transfers."""

from .solver import SolverMPM

__all__ = ["SolverMPM"]
