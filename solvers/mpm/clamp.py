"""What a clamp holds of MPM's grid: nodes so heavy that they keep its velocity, up to one cell in front of its face.

A clamp that weighs no more than what it holds only brakes the nodes that they share: a beam falls slowly off it. A node
in its hands is still, however little of it is the clamp's, and quadratic splines bend from half a cell before their
last node that is still on. Nodes lie anywhere: those up to one cell in front of a face hold a beam by the face in the
mean, those up to the 1.5 cells that splines reach by half a cell in front of it. A rigid body (tool.py) sees of a clamp
what it sees of other matter.
"""

import warp as wp

from fluidbench.method.frame import CLAMPED
from fluidbench.native.pool import Pool
from fluidbench.native.scene import Scene

from .grid import Grid, first_node, node_at, on_grid
from .particle import weights

wp.set_module_options({"enable_backward": False})

ANCHOR = wp.constant(1.0e4)  # inertia on nodes that are held over the clamp's own
REACH = wp.constant(1.0)  # of a clamp's face [cells]


@wp.func
def within(w: wp.vec3, f: float, reach: float):
    """The weights of three nodes, without those farther than `reach` from what lies at f [cells]."""
    near = w
    for k in range(3):
        if wp.abs(float(k) - f) > reach:
            near[k] = 0.0
    return near


@wp.kernel
def hold(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    table: wp.array(dtype=int),
    # outputs
    raw: wp.array(dtype=wp.vec4),
):
    """Momentum and mass of what clamps hold to nodes. A face is half an edge of a particle in front of the last."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world] and held[p] == CLAMPED:
        base = first_node(grid, position[p])
        f, wx, wy, wz = weights(grid, position[p], base)
        edge = 0.5 * wp.pow(volume[p], 1.0 / 3.0) * grid.inv_dx
        wx = within(wx, f[0], REACH + edge[0])
        wy = within(wy, f[1], REACH + edge[1])
        wz = within(wz, f[2], REACH + edge[2])
        v = velocity[p]
        for o in range(3):
            for q in range(3):
                for r in range(3):
                    at = node_at(grid, world, on_grid(grid, base + wp.vec3i(o, q, r)), table)
                    m = ANCHOR * mass[p] * wx[o] * wy[q] * wz[r]
                    if at >= 0 and m > 0.0:
                        wp.atomic_add(raw, at, m * wp.vec4(v[0], v[1], v[2], 1.0))


class Clamps:
    """The clamps of a scene, and their launch, which is Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid) -> None:
        self.scene, self.pool, self.grid = scene, pool, grid

    def prepare(self) -> None:
        self.scene.crew.load(__name__)

    def hold(self, table: wp.array, raw: wp.array) -> None:
        """Enqueue: add what clamps hold to momenta and masses of nodes."""
        pool = self.pool
        matter = [pool.held, pool.position, pool.velocity, pool.mass, pool.volume, table]
        self.scene.crew.launch(hold, pool.size, [self.grid, pool.capacity, pool.count, *matter], [raw])
