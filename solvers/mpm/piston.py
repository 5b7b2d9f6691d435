"""The piston of MPM: what is carried towards an outlet is pushed on at its own speed, whatever resists.

What is carried gives its nodes its momentum anew in every step, with no more than its own mass: that is a force
m (U - u) / dt, to which matter of stress sigma yields by U - u = sigma dt / (rho d). A stiff mortar held the grid at a
quarter to a half of the piston's speed so, between bursts. So the nodes within the bore, from the first row at the
exit upwards, move with the piston: with the profile that its flow has developed, sideways with the bore, and no slower
down, for what flows away faster is not held back. Only while it extrudes: what lifts does not pull at what it has laid.
A node moves what lies within half a cell of it, so those nearer than that to the rim are left alone: what flows past
the bore is not pressed down. In a bore of a body they are held, with its wall.

The piston is firm, its nodes move at its speed and not faster either, where viscosity is solved for (which faster nodes
would make another equation with every velocity; whatever pushes at them changes nothing), where nodes keep their
momenta (keeping.py), and in the bore of a body: there it drives the nodes in the wall, too, and holds what is below it
when nothing is extruded.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp

from fluidbench.native.scene import Scene

from .grid import Grid

wp.set_module_options({"enable_backward": False, "fast_math": True})

# How far below the exit the first row of nodes may lie, in cells. What is pressed from farther below comes out wider;
# where the first row lies more than the rest of a cell above it, the piston holds as little as none would.
BELOW = wp.constant(0.3)
REACHED = wp.constant(1.5)  # by the nodes of a particle [cells]
WIDE = wp.constant(2.0)  # how far the flow is tabled, as nodes in the wall of a body ask for it [radii of the bore]
FINE = wp.constant(256)  # parts of the square of that, between which speeds are linear, as a parabola is


@wp.struct
class Piston:
    """Where the bore is, and how it moves: rows of ticks (fluidbench.native.clock)."""

    on: int
    firm: int  # 1 where what is faster is held back, too
    still: int  # 1 where it is asked by how much its nodes yield to what pushes: not at all
    walled: int  # 1 where the bore is that of a body
    bore: float  # radius [m]
    reach: float  # distance from the axis within which it drives nodes [m]
    rise: float  # of its upper end, where matter is let go, over the lower [m]
    speed: wp.array(dtype=float)  # of nodes while it extrudes, at equal steps of the radius squared up to WIDE [m/s]
    row: wp.array(dtype=int)  # of the end of the tick that substeps are in
    exit: wp.array(dtype=wp.vec3)
    drift: wp.array(dtype=wp.vec3)
    feeding: wp.array(dtype=float)


def piston_of(scene: Scene, dx: Sequence[float], firm: bool = False, still: bool = False) -> Any:
    """The piston of a scene, if that is fed."""
    piston, clock = Piston(), scene.clock
    for name in ("row", "exit", "drift", "feeding"):
        setattr(piston, name, getattr(clock.hours, name))
    piston.firm, piston.still, piston.walled = int(firm), int(still), int(scene.outline is not None)
    piston.bore, piston.rise = clock.bore
    piston.reach = reach(piston.bore, dx, walled=scene.outline is not None)
    speed = np.zeros(1)
    if clock.stream is not None:
        piston.on = 1
        speed = sharpened(clock.speed_at, piston.bore, 0.5 * (dx[0] ** 2 + dx[1] ** 2))
    piston.speed = wp.array(speed.astype(np.float32), device=scene.device)
    return piston


def reach(bore: float, dx: Sequence[float], walled: bool) -> float:
    """Distance from the axis within which nodes are driven [m], in cells of `dx` [m]: up to half a cell from the rim of
    the bore, but the nodes next to the axis at least; in a body's bore all that matter in it reaches."""
    across = float(np.hypot(dx[0], dx[1]))
    return bore + REACHED * across if walled else max(bore - 0.25 * (dx[0] + dx[1]), 0.5 * across)


def sharpened(profile: Callable[[np.ndarray], np.ndarray], radius: float, square: float) -> np.ndarray:
    """Speeds of nodes, of cells of so many square metres, from which particles gather a profile of the distance from
    the axis: splines add dx^2 / 8 times its Laplacian to what they smooth, by s = r^2 that is 4 u' + 4 s u''. At equal
    steps of s, shape (FINE + 1,). Of a parabola that is U dx^2 / R^2, and no more is given back anywhere: layers
    thinner than a cell, as a yield stress leaves at the rim, are beyond what nodes can hold."""
    s = (WIDE * radius) ** 2 * np.linspace(0.0, 1.0, FINE + 1)
    u = profile(np.sqrt(s))
    slope = np.gradient(u, s)
    most = square / radius**2 * np.abs(u[s <= radius**2].mean())
    return u - np.clip(0.5 * square * (slope + s * np.gradient(slope, s)), -most, most)


@wp.func
def speed_of(piston: Piston, share: float):
    """Of nodes at a share r/R of the bore's radius [m/s]."""
    at = wp.min(share * share / (WIDE * WIDE), 1.0) * float(FINE)
    low = wp.min(int(at), FINE - 1)
    return piston.speed[low] + (at - float(low)) * (piston.speed[low + 1] - piston.speed[low])


@wp.func
def driven(piston: Piston, grid: Grid, x: wp.vec3, v: wp.vec3):
    """The velocity [m/s] of a node at x that would have v."""
    out = v
    row = piston.row[0]
    before = wp.max(row - 1, 0)
    feeding = piston.feeding[before]
    away = x - piston.exit[row]
    radius = wp.length(wp.vec2(away[0], away[1]))
    if (feeding > 0.0 or piston.walled == 1) and away[2] > -BELOW * grid.dx[2] and radius < piston.reach:
        out = piston.drift[before]
        out[2] -= feeding * speed_of(piston, radius / piston.bore)
        if piston.firm == 0:
            out[2] = wp.min(v[2], out[2])
        if piston.still == 1:
            out = wp.vec3(0.0, 0.0, 0.0)
    return out
