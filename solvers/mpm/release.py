"""With what volume ratio MPM lets go of what is carried to an outlet.

What is carried goes on at its own speed U whatever the grid does, what is free goes with the grid, by u: where they
meet matter is crowded by U / u, which no velocity gradient shows. Flux is the same on both sides, so what passes the
outlet has J = u / U, each particle by the grid there where it passes: at a rim, where nodes hardly move that lie beyond
the bore, a tenth less than at its middle, or a quarter. Matter is let go in discs a spacing apart, and u beats with
them: how far one is from the next the mean of u tells since the one before was let go, so J is that, over the last
spacing of its way.
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
    hours: Hours,
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    moving: wp.array(dtype=wp.vec4),
    # outputs
    volume_ratio: wp.array(dtype=float),
):
    """J of what is carried within a spacing [m] of the outlet: the mean of u / U there, since it was as far from it."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and held[p] == CARRIED:
        row = hours.row[0]
        outlet = position[p]
        outlet[2] = hours.exit[row][2]
        above = position[p][2] - outlet[2]
        drift = hours.drift[wp.max(row - 1, 0)][2]
        fed = drift - velocity[p][2]
        if fed > 0.0 and above < spacing:
            passing = (drift - rising(grid, world, outlet, table, moving)) / fed
            share_of_way = fed * dt[world] / wp.max(spacing - above, fed * dt[world])
            j = volume_ratio[p]
            volume_ratio[p] = j + share_of_way * (wp.clamp(passing, 1.0 / PACKED, PACKED) - j)


class Release:
    """Its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid) -> None:
        self.scene, self.pool, self.grid = scene, pool, grid

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def go_on(self, table: wp.array, moving: wp.array) -> None:
        """Enqueue, once nodes have their velocities, in every substep."""
        scene, pool = self.scene, self.pool
        some = [self.grid, pool.capacity, pool.count, scene.dt, scene.spacing, scene.clock.hours]
        matter = [pool.held, pool.position, pool.velocity]
        scene.crew.launch(crowd, pool.size, [*some, *matter, table, moving], [pool.volume_ratio])
