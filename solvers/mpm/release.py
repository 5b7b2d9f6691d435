"""With what volume ratio MPM lets go of what is carried to an outlet.

What is carried goes on at its own speed U whatever the grid does, what is free goes with the grid, by u: where they
meet matter is crowded by U / u, which no velocity gradient shows. Flux is the same on both sides, so what passes the
outlet has J = u / U, each particle by the grid there where it passes: at a rim, where nodes hardly move that lie beyond
the bore, a tenth less than at its middle, or a quarter. Matter is let go in discs a spacing apart, and u beats with
them: how far one is from the next the mean of u tells since the one before was let go, so J is that, over the last
spacing of its way.

A disc is let go as a whole, half of it before it has passed, and a stiff mortar that was told at once burst: by c times
the crowding, a hundred times as fast as it was fed, into gaps that its strength held open. What is let go owes that
ratio therefore, and comes to it while the other half passes, a spacing / (4 U) on average.
"""

import warp as wp

from fluidbench.method.frame import CARRIED
from fluidbench.native.clock import Hours
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene
from fluidbench.native.vector_access import load_vec4

from .grid import Grid, first_node, node_parts, slot_of, slots_of
from .particle import PACKED, weights

wp.set_module_options({"enable_backward": False})

PAID = wp.constant(1.0e-4)  # of ln J
LAG = 0.25  # of the time in which a spacing passes: from when a disc is let go to when its rest passes, on average


@wp.func
def rising(grid: Grid, world: int, x: wp.vec3, table: wp.array(dtype=int), moving: wp.array(dtype=wp.vec4)):
    """The grid's velocity along z at x [m/s]; nodes without matter stand still."""
    base = first_node(grid, x)
    _f, wx, wy, wz = weights(grid, x, base)
    bx, by, bz, lx, ly, lz = node_parts(grid, base)
    s0, s1, s2, s3, s4, s5, s6, s7 = slots_of(table, world * grid.blocks_per_world, bx, by, bz)
    u = float(0.0)
    for o in range(3):
        for q in range(3):
            for r in range(3):
                slot = slot_of(bx[o] == bx[0], by[q] == by[0], bz[r] == bz[0], s0, s1, s2, s3, s4, s5, s6, s7)
                node = load_vec4(moving, wp.max(slot, 0) * 64 + lx[o] + ly[q] + lz[r])
                u += wp.where(slot >= 0, wx[o] * wy[q] * wz[r] * node[2], 0.0)
    return u


@wp.kernel
def crowd(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    spacing: float,
    rate: float,
    hours: Hours,
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    owed: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
):
    """ln J that is owed by what is carried within a spacing [m] of the outlet: of the mean of u / U there, since it was
    as far from it. What is free comes to it at a `rate` [1/s]."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world]:
        if held[p] == CARRIED:
            row = hours.row[0]
            outlet = position[p]
            outlet[2] = hours.exit[row][2]
            above = position[p][2] - outlet[2]
            drift = hours.drift[wp.max(row - 1, 0)][2]
            fed = drift - velocity[p][2]
            if fed > 0.0 and above < spacing:
                passing = (drift - rising(grid, world, outlet, table, moving)) / fed
                part = fed * dt[world] / wp.max(spacing - above, fed * dt[world])
                mean = wp.exp(owed[p]) * (1.0 - part) + part * wp.clamp(passing, 1.0 / PACKED, PACKED)
                owed[p] = wp.log(mean)
        elif owed[p] != 0.0:
            left = owed[p] * wp.exp(-rate * dt[world])
            if wp.abs(left) < PAID:
                left = 0.0
            volume_ratio[p] = volume_ratio[p] * wp.exp(owed[p] - left)
            owed[p] = left


class Release:
    """Its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid) -> None:
        self.scene, self.pool, self.grid = scene, pool, grid
        pool.add_field("owed", float)
        self.rate = scene.clock.mean_speed / (LAG * scene.spacing)

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def go_on(self, table: wp.array, moving: wp.array) -> None:
        """Enqueue, once nodes have their velocities, in every substep."""
        scene, pool = self.scene, self.pool
        some = [self.grid, pool.capacity, pool.count, scene.dt, scene.spacing, self.rate, scene.clock.hours]
        matter = [pool.held, pool.position, pool.velocity]
        scene.crew.launch(crowd, pool.size, [*some, *matter, table, moving], [pool.owed, pool.volume_ratio])
