"""Walls on the grid of MPM: mirrors, contact of rough walls, Coulomb friction; used by kernels_warp.grid_step.

A wall lies halfway between two nodes, of which the one behind is the image of the one in front: what is scattered to it
is folded back, and it has the mirrored velocity, so that the gather sees a true mirror (zeroing it instead costs energy
at every step). Slip and friction turn the component across round, no-slip walls all three. The node in front so carries
all of the mass beside a wall, and all of its weight: a layer that shears at its foot alone is held by exactly
rho g h sin(a) there. About a node that lies on the wall and does not move, splines cannot bend as sharply, and half a
cell of the layer weighs nothing.
"""

import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from .grid import FIRST, Grid, raw_node

wp.set_module_options({"enable_backward": False, "fast_math": True})

# Mass of the first node in front of a wall over that of the next. Matter whose flat surface is g cells away from the
# wall gives (5/6 - g/2 - g^2/2 + g^3/3) / (1 - g^3/6): 0.83 at rest on it. Contact grows from g = 0.47 to 0.30. Beyond
# that, matter is caught before it has landed; nearer, disorder is taken for a gap, and what lies still is let go.
CONTACT_BEGINS, CONTACT_ENDS = wp.constant(0.53), wp.constant(0.65)
TINY = wp.constant(1.0e-30)


@wp.func
def grip(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    axis: int,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """How far, from 0 to 1, the wall nearest to a node on this axis acts on its column of nodes.

    Slip walls always act: they are symmetry planes. Rough walls act where material has arrived; otherwise a falling
    body would be stopped, and squeezed, a cell above the floor (Nairn 2013, CMES 92:271, on contact by separation
    instead of by velocity). How near it is the masses of two nodes of the column say, whatever part of the column's
    width is filled: by the filling of one node matter that stands on the floor is let go at its edge, and creeps.
    """
    front = node
    next = node
    kind = grid.lower_kind[axis]
    front[axis] = FIRST
    next[axis] = FIRST + 1
    if 2 * (node[axis] - FIRST) >= grid.cells[axis]:
        kind = grid.upper_kind[axis]
        front[axis] = FIRST + grid.cells[axis] - 1
        next[axis] = FIRST + grid.cells[axis] - 2
    hold = float(1.0)
    if kind == PERIODIC:
        hold = 0.0
    elif kind == STICK or kind == FRICTION:
        near = raw_node(grid, world, front, table, raw)[3]
        far = raw_node(grid, world, next, table, raw)[3]
        hold = wp.clamp((near - CONTACT_BEGINS * far) / wp.max((CONTACT_ENDS - CONTACT_BEGINS) * far, TINY), 0.0, 1.0)
    return hold


@wp.func
def mirror(node: int, cells: int, lower_kind: int, upper_kind: int):
    """The node in front of a wall whose image this node is; itself elsewhere."""
    inside = node
    if node < FIRST and lower_kind != PERIODIC:
        inside = 2 * FIRST - 1 - node
    if node >= FIRST + cells and upper_kind != PERIODIC:
        inside = 2 * (FIRST + cells) - 1 - node
    return inside


@wp.func
def image(node: int, cells: int, lower_kind: int, upper_kind: int):
    """The node behind a wall whose content is folded onto this one; the node itself where there is none."""
    behind = node
    if node == FIRST and lower_kind != PERIODIC:
        behind = FIRST - 1
    if node == FIRST + cells - 1 and upper_kind != PERIODIC:
        behind = FIRST + cells
    return behind


@wp.func
def flipped(v: wp.vec4, axis: int, kind: int):
    """A momentum or velocity seen in a wall: no-slip walls turn all of it round, others the component across."""
    out = v
    if kind == STICK:
        out = wp.vec4(-v[0], -v[1], -v[2], v[3])
    else:
        out[axis] = -v[axis]
    return out


@wp.func
def wall_kind(node: int, lower_kind: int, upper_kind: int, cells: int):
    """Kind of the wall nearest to a node."""
    kind = upper_kind
    if 2 * (node - FIRST) < cells:
        kind = lower_kind
    return kind


@wp.func
def seen(grid: Grid, node: wp.vec3i, inside: wp.vec3i, v: wp.vec4):
    """What a node shows that is the image of the node `inside`, which has v."""
    out = v
    for axis in range(3):
        if inside[axis] != node[axis]:
            kind = wall_kind(node[axis], grid.lower_kind[axis], grid.upper_kind[axis], grid.cells[axis])
            out = flipped(out, axis, kind)
    return out


@wp.func
def folded(
    grid: Grid, world: int, node: wp.vec3i, touching: wp.vec3i, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)
):
    """Momentum and mass of a node in front of the walls that act, with what was scattered behind them folded back."""
    total = wp.vec4(0.0, 0.0, 0.0, 0.0)
    other = node
    for axis in range(3):
        if touching[axis] == 1:
            other[axis] = image(node[axis], grid.cells[axis], grid.lower_kind[axis], grid.upper_kind[axis])
    for combination in range(8):
        at = node
        valid = bool(True)
        for axis in range(3):
            if ((combination >> axis) & 1) == 1:
                valid = valid and other[axis] != node[axis]
                at[axis] = other[axis]
        if valid:
            total += seen(grid, at, node, raw_node(grid, world, at, table, raw))
    return total


@wp.func
def pressed(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    touching: wp.vec3i,
    axis: int,
    kick: float,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """How fast matter in front of a friction wall would go into it if it were not there [m/s]: its momentum across and
    that of what is behind, less what the mirrored motion leaves them, over their mass. Negative where it lifts off."""
    others = touching
    others[axis] = 0
    ghost = node
    ghost[axis] = image(node[axis], grid.cells[axis], grid.lower_kind[axis], grid.upper_kind[axis])
    front = folded(grid, world, node, others, table, raw)
    behind = folded(grid, world, ghost, others, table, raw)
    mass = wp.max(front[3] + behind[3], TINY)
    across = (front[axis] - behind[axis]) / mass + kick
    lost = (front[axis] + behind[axis]) / mass + kick - across * (front[3] - behind[3]) / mass
    return wp.where(ghost[axis] < node[axis], -lost, lost)


@wp.func
def rubbed(v: wp.vec3, axis: int, into: float, friction: float):
    """A velocity beside a friction wall that `into` is pressed against: its part along the wall is less by up to
    friction times that (Coulomb)."""
    across = v[axis]
    along = v
    along[axis] = 0.0
    out = along * (1.0 - wp.min(friction * into / wp.max(wp.length(along), 1.0e-12), 1.0))
    out[axis] = across
    return out


@wp.func
def friction_of(grid: Grid, node: wp.vec3i, axis: int):
    """Coulomb's coefficient of the wall nearest to a node on this axis; negative where it is of another kind."""
    kind = grid.upper_kind[axis]
    friction = grid.upper_friction[axis]
    if 2 * (node[axis] - FIRST) < grid.cells[axis]:
        kind = grid.lower_kind[axis]
        friction = grid.lower_friction[axis]
    if kind != FRICTION:
        friction = -1.0
    return friction


@wp.func
def near_wall(grid: Grid, node: wp.vec3i, axis: int):
    """Whether a node is the first in front of a wall of this axis, or behind it."""
    walled = grid.lower_kind[axis] != PERIODIC
    return walled and (node[axis] <= FIRST or node[axis] >= FIRST + grid.cells[axis] - 1)


@wp.func
def near_any(grid: Grid, node: wp.vec3i):
    """Whether a node is the first in front of a wall, or behind one."""
    return near_wall(grid, node, 0) or near_wall(grid, node, 1) or near_wall(grid, node, 2)


@wp.func
def in_reach(grid: Grid, node: wp.vec3i):
    """Whether any particle in front of the walls can ask for a node: one behind a wall at most."""
    reached = bool(True)
    for axis in range(3):
        walled = grid.lower_kind[axis] != PERIODIC
        if walled and (node[axis] < FIRST - 1 or node[axis] > FIRST + grid.cells[axis]):
            reached = False
    return reached


@wp.func
def in_front(grid: Grid, node: wp.vec3i):
    """The node in front of all walls whose image a node is; itself elsewhere."""
    inside = node
    for axis in range(3):
        inside[axis] = mirror(node[axis], grid.cells[axis], grid.lower_kind[axis], grid.upper_kind[axis])
    return inside


@wp.func
def facing(grid: Grid, node: wp.vec3i, touching: wp.vec3i):
    """The node in front of the walls that act whose image a node is; itself elsewhere."""
    inside = in_front(grid, node)
    for axis in range(3):
        if touching[axis] == 0:
            inside[axis] = node[axis]
    return inside


@wp.func
def touched(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    kick: wp.vec3,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """(per axis 1 where a wall acts on a node; how far they act, from 0 to 1; how fast friction walls are pressed
    against [m/s]). `kick` is what forces add to velocities in this step."""
    touching = wp.vec3i(0, 0, 0)
    hold = float(1.0)
    for axis in range(3):
        held = grip(grid, world, node, axis, table, raw)
        if near_wall(grid, node, axis) and held > 0.0:
            hold = wp.min(hold, held)
            touching[axis] = 1
    into = wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        if touching[axis] == 1 and friction_of(grid, node, axis) >= 0.0:
            into[axis] = pressed(grid, world, facing(grid, node, touching), touching, axis, kick[axis], table, raw)
            if into[axis] <= 0.0:
                touching[axis] = 0
    return touching, hold, into


@wp.func
def rubbed_by_walls(grid: Grid, node: wp.vec3i, into: wp.vec3, v: wp.vec3):
    """A node's velocity after the friction walls that it is pressed against."""
    out = v
    for axis in range(3):
        if into[axis] > 0.0:
            out = rubbed(out, axis, into[axis], friction_of(grid, node, axis))
    return out


@wp.func
def unbound(raw: wp.vec4, gain: wp.vec3, density: float):
    """A node's velocity and density where no wall acts."""
    free = wp.vec4(0.0, 0.0, 0.0, density)
    if raw[3] > 0.0:
        free = wp.vec4(raw[0] / raw[3] + gain[0], raw[1] / raw[3] + gain[1], raw[2] / raw[3] + gain[2], density)
    return free
