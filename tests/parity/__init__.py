"""Warp and Taichi against each other, pass by pass."""
