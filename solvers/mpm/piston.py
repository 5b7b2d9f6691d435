"""The piston of MPM: what is carried towards an outlet is pushed on at its own speed, whatever resists.

What is carried gives its nodes its momentum anew in every step, with no more than its own mass: that is a force
m (U - u) / dt, to which matter of stress sigma yields by U - u = sigma dt / (rho d). A stiff mortar held the grid at a
quarter to a half of the piston's speed so, between bursts. So the nodes within the bore, from the first row at the
exit upwards, move with the piston: no slower down, for what flows away faster is not held back, and sideways with the
bore. Only while it extrudes: what lifts does not pull at what it has laid. And only of a plug: where a profile has
developed, matter at the rim hardly moves. Where viscosity is solved for, the piston is firm: its nodes move at its
speed, not faster either (which would make of it another equation with every velocity), and whatever pushes at them
changes nothing.
"""

from typing import Any

import warp as wp

from fluidbench.native.scene import Scene

from .grid import Grid

wp.set_module_options({"enable_backward": False, "fast_math": True})

# How far below the exit the first row of nodes may lie, in cells. What is pressed from farther below comes out wider;
# where the first row lies more than the rest of a cell above it, the piston holds as little as none would.
BELOW = wp.constant(0.3)


@wp.struct
class Piston:
    """Where the bore is, and how it moves: rows of ticks (fluidbench.native.clock)."""

    on: int
    firm: int  # 1 where what is faster is held back, too
    still: int  # 1 where it is asked by how much its nodes yield to what pushes: not at all
    bore: float  # radius squared [m^2]
    speed: float  # of what leaves it while it extrudes [m/s]
    row: wp.array(dtype=int)  # of the end of the tick that substeps are in
    exit: wp.array(dtype=wp.vec3)
    drift: wp.array(dtype=wp.vec3)
    feeding: wp.array(dtype=float)


def piston_of(scene: Scene, acts: bool, firm: bool = False, still: bool = False) -> Any:
    """The piston of a scene that is fed, if it `acts`."""
    piston, hours = Piston(), scene.clock.hours
    radius, speed = scene.clock.bore
    for name in ("row", "exit", "drift", "feeding"):
        setattr(piston, name, getattr(hours, name))
    piston.firm, piston.still = int(firm), int(still)
    if acts and radius > 0.0:
        piston.on, piston.bore, piston.speed = 1, radius * radius, speed
    return piston


@wp.func
def driven(piston: Piston, grid: Grid, x: wp.vec3, v: wp.vec3):
    """The velocity [m/s] of a node at x that would have v."""
    out = v
    row = piston.row[0]
    before = wp.max(row - 1, 0)
    feeding = piston.feeding[before]
    away = x - piston.exit[row]
    if feeding > 0.0 and away[2] > -BELOW * grid.dx[2] and away[0] * away[0] + away[1] * away[1] < piston.bore:
        out = piston.drift[before]
        out[2] -= feeding * piston.speed
        if piston.firm == 0:
            out[2] = wp.min(v[2], out[2])
        if piston.still == 1:
            out = wp.vec3(0.0, 0.0, 0.0)
    return out
