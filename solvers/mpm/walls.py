"""Walls on the grid of MPM: mirrors, contact of rough walls, Coulomb friction; used by kernels_warp.grid_step."""

import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from .grid import FIRST, Grid, raw_node

wp.set_module_options({"enable_backward": False, "fast_math": True})

# Mass of a wall's node over that of the next one. Matter whose flat surface is g cells away from the wall gives
# (1/2 - 3 g/4 + g^3/3) / (1 - (g + 1/2)^3/6): 0.51 at rest on it. Contact grows from g = 0.36 to 0.21.
CONTACT_BEGINS, CONTACT_ENDS = wp.constant(0.28), wp.constant(0.37)
TINY = wp.constant(1.0e-30)
# Least mass that moves across a no-slip wall over that of the nodes beside it: 0.83 in bulk, 0.67 for a row half a cell
# away. A row nearer than that has next to none, and would break the bound on dt of an isolated particle.
THIN = wp.constant(0.6)


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
    body would be stopped, and squeezed, up to 1.5 dx above the floor (Nairn 2013, CMES 92:271, on contact by separation
    instead of by velocity). How near it is the masses of two nodes of the column say, whatever part of the column's
    width is filled: by the filling of one node matter that stands on the floor is let go at its edge, and creeps.
    """
    plane = node
    above = node
    kind = grid.lower_kind[axis]
    plane[axis] = FIRST
    above[axis] = FIRST + 1
    if 2 * (node[axis] - FIRST) >= grid.cells[axis]:
        kind = grid.upper_kind[axis]
        plane[axis] = FIRST + grid.cells[axis]
        above[axis] = FIRST + grid.cells[axis] - 1
    hold = float(1.0)
    if kind == PERIODIC:
        hold = 0.0
    elif kind == STICK or kind == FRICTION:
        near = raw_node(grid, world, plane, table, raw)[3]
        far = raw_node(grid, world, above, table, raw)[3]
        hold = wp.clamp((near - CONTACT_BEGINS * far) / wp.max((CONTACT_ENDS - CONTACT_BEGINS) * far, TINY), 0.0, 1.0)
    return hold


@wp.func
def mirror(node: int, cells: int, lower_kind: int, upper_kind: int):
    """The node in front of a mirroring wall (slip, stick) whose image this node is; itself elsewhere."""
    inside = node
    if node < FIRST and lower_kind != FRICTION and lower_kind != PERIODIC:
        inside = 2 * FIRST - node
    if node > FIRST + cells and upper_kind != FRICTION and upper_kind != PERIODIC:
        inside = 2 * (FIRST + cells) - node
    return inside


@wp.func
def image(node: int, cells: int, lower_kind: int, upper_kind: int):
    """The ghost node whose content a mirroring wall folds onto this one; the node itself where there is none."""
    behind = node
    if node == FIRST + 1 and lower_kind != FRICTION and lower_kind != PERIODIC:
        behind = FIRST - 1
    if node == FIRST + cells - 1 and upper_kind != FRICTION and upper_kind != PERIODIC:
        behind = FIRST + cells + 1
    return behind


@wp.func
def flipped(v: wp.vec4, axis: int, kind: int):
    """A momentum or velocity seen in a wall: slip mirrors the normal component, stick turns all of them round."""
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
def sticks(grid: Grid, node: wp.vec3i, axis: int):
    """Whether the wall nearest to a node on this axis is a no-slip wall."""
    return wall_kind(node[axis], grid.lower_kind[axis], grid.upper_kind[axis], grid.cells[axis]) == STICK


@wp.func
def wall_friction(v: wp.vec3, axis: int, outward: float, friction: float):
    """Unilateral contact with Coulomb friction: no motion into the wall, tangential loss up to friction times that."""
    out = v
    into = outward * v[axis]
    if into > 0.0:
        out[axis] = 0.0
        slide = wp.length(out)
        out = out * (1.0 - wp.min(friction * into / wp.max(slide, 1.0e-12), 1.0))
    return out


@wp.func
def wall_velocity(grid: Grid, node: wp.vec3i, touching: wp.vec3i, v: wp.vec3):
    """Impose the walls on the velocity of a node on, or behind, them."""
    out = v
    for axis in range(3):
        i, last = node[axis], FIRST + grid.cells[axis]
        lower, upper = grid.lower_kind[axis], grid.upper_kind[axis]
        if touching[axis] == 1 and (i <= FIRST or i >= last):
            kind = lower
            friction = grid.lower_friction[axis]
            outward = float(-1.0)
            if i >= last:
                kind = upper
                friction = grid.upper_friction[axis]
                outward = 1.0
            if kind == STICK:
                out = wp.vec3(0.0, 0.0, 0.0)
            elif kind == FRICTION:
                out = wall_friction(out, axis, outward, friction)
            else:
                out[axis] = 0.0
    return out


@wp.func
def folded(
    grid: Grid, world: int, node: wp.vec3i, touching: wp.vec3i, table: wp.array(dtype=int), raw: wp.array(dtype=wp.vec4)
):
    """Momentum and mass of a node in front of mirroring walls, with what was scattered behind them folded back."""
    total = wp.vec4(0.0, 0.0, 0.0, 0.0)
    other = wp.vec3i(0, 0, 0)
    for axis in range(3):
        other[axis] = node[axis]
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
            value = raw_node(grid, world, at, table, raw)
            for axis in range(3):
                if ((combination >> axis) & 1) == 1:
                    kind = wall_kind(at[axis], grid.lower_kind[axis], grid.upper_kind[axis], grid.cells[axis])
                    value = flipped(value, axis, kind)
            total += value
    return total


@wp.func
def near_wall(grid: Grid, node: wp.vec3i):
    """Whether a node is within one cell of a wall, in front or behind."""
    near = bool(False)
    for axis in range(3):
        walled = grid.lower_kind[axis] != PERIODIC
        if walled and (node[axis] <= FIRST + 1 or node[axis] >= FIRST + grid.cells[axis] - 1):
            near = True
    return near


@wp.func
def in_reach(grid: Grid, node: wp.vec3i):
    """Whether any particle in front of the walls can ask for a node: one behind a wall at most."""
    reached = bool(True)
    for axis in range(3):
        walled = grid.lower_kind[axis] != PERIODIC
        if walled and (node[axis] < FIRST - 1 or node[axis] > FIRST + grid.cells[axis] + 1):
            reached = False
    return reached


@wp.func
def plane_share(grid: Grid, node: wp.vec3i):
    """What the mass of a node on a wall must be multiplied by: only half (a quarter, ...) of its cell is inside."""
    share = float(1.0)
    for axis in range(3):
        walled = grid.lower_kind[axis] != PERIODIC
        if walled and (node[axis] == FIRST or node[axis] == FIRST + grid.cells[axis]):
            share *= 2.0
    return share


@wp.func
def beside(
    grid: Grid,
    world: int,
    node: wp.vec3i,
    inside: wp.vec3i,
    touching: wp.vec3i,
    kick: wp.vec3,
    result: wp.vec4,
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
):
    """Velocities of a node, those across no-slip walls put right.

    Where matter sticks it cannot be squeezed out along a wall, so it comes no nearer: both u and du/dz are zero there,
    u = 4/3 U z^2 in the nearest half cell. The node on the wall has -U/3, its neighbours on both sides U, momentum and
    mass of all three are gathered in that proportion. A mirror (-U, 0, U) lets matter down on the floor, where its
    volume ratio does not see it crowd.
    """
    out = result
    for axis in range(3):
        wall, step = int(FIRST), int(1)
        if 2 * (node[axis] - FIRST) >= grid.cells[axis]:
            wall = FIRST + grid.cells[axis]
            step = -1
        others = touching
        others[axis] = 0
        held, turned = bool(False), float(1.0)  # on another no-slip wall; behind one
        for other in range(3):
            if others[other] == 1 and sticks(grid, node, other):
                held = held or inside[other] == FIRST or inside[other] == FIRST + grid.cells[other]
                if inside[other] != node[other]:
                    turned = -turned
        if touching[axis] == 1 and sticks(grid, node, axis) and not held:
            place = inside
            place[axis] = wall
            on = folded(grid, world, place, others, table, raw)
            place[axis] = wall + step
            near = folded(grid, world, place, others, table, raw)
            place[axis] = wall - step
            near += folded(grid, world, place, others, table, raw)
            u = float(0.0)
            if near[3] > 0.0:
                mass = wp.max(near[3] - on[3] / 3.0, THIN * near[3])
                u = turned * ((near[axis] - on[axis] / 3.0) / mass + kick[axis])
            out[axis] = wp.where(node[axis] == wall, -u / 3.0, u)
    return out


@wp.func
def unbound(raw: wp.vec4, gain: wp.vec3, density: float):
    """A node's velocity and density where no wall acts."""
    free = wp.vec4(0.0, 0.0, 0.0, density)
    if raw[3] > 0.0:
        free = wp.vec4(raw[0] / raw[3] + gain[0], raw[1] / raw[3] + gain[1], raw[2] / raw[3] + gain[2], density)
    return free
