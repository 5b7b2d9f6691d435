"""fluid methods, one folder each; reached through the entry-point group `fluidbench.solvers`."""
