"""The tables of the published study, judged by measurement."""

PAPER = "Physics-based Simulation for Aerial Additive Manufacturing Using Viscoelastic Expanding Fluids"
