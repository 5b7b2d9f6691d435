"""fluidbench: MPM, weakly compressible SPH and PBD on identical extrusion scenarios, fidelity beside cost."""

__version__ = "0.1.0"
