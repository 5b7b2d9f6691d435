"""The background grid of MPM and its walls, in Taichi: what grid.py and walls.py say, written anew.

Functions over `axis` are unrolled: it is known when they are compiled.
"""

from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from ..taichi_bridge import Ints, Quads, Vectors, ivec3, struct_of, ti, vec3, vec4
from .grid import FAULT_BLOCKS, FIRST, Grid
from .walls import CONTACT_BEGINS, CONTACT_ENDS, TINY

GridT = struct_of(Grid)


@ti.func
def base_node(grid, x):
    """The lowest of the 27 nodes around a point, before wrapping."""
    return ti.floor((x - grid.origin) * grid.inv_dx - 0.5, ti.i32)


@ti.func
def wrapped(grid, node):
    """The same node within the periods of periodic axes."""
    out = node
    for axis in ti.static(range(3)):
        if grid.wrap[axis] > 0:
            if node[axis] < grid.first[axis]:
                out[axis] += grid.wrap[axis]
            elif node[axis] >= grid.first[axis] + grid.wrap[axis]:
                out[axis] -= grid.wrap[axis]
    return out


@ti.func
def block_at(grid, world, node):
    """Number of a node's block, over all worlds."""
    inside = ((node[0] >> 2) * grid.blocks[1] + (node[1] >> 2)) * grid.blocks[2] + (node[2] >> 2)
    return world * grid.blocks_per_world + inside


@ti.func
def address(grid, world, node, table: ti.template()):
    """Where a node's values are; negative where its block has no slot."""
    slot = table[block_at(grid, world, node)] - 1
    return slot * 64 + ((node[0] & 3) * 16 + (node[1] & 3) * 4 + (node[2] & 3))


@ti.func
def node_at(grid, block, local):
    """The node from its block's number within the world and its place within the block."""
    across = block // grid.blocks[2]
    corner = 4 * ivec3(across // grid.blocks[1], across % grid.blocks[1], block % grid.blocks[2])
    return corner + ivec3(local // 16, (local // 4) % 4, local % 4)


@ti.func
def claim(
    grid, world, base, table: ti.template(), block_of: ti.template(), active: ti.template(), fault: ti.template()
):
    """List the blocks of a stencil that have no slot yet and mark them -1; `number_blocks` gives them their slots."""
    for corner in range(8):
        node = wrapped(grid, base + 2 * ivec3(corner // 4, (corner // 2) % 2, corner % 2))
        block = block_at(grid, world, node)
        if table[block] == 0:
            if ti.atomic_min(table[block], -1) == 0:
                slot = ti.atomic_add(active[0], 1)
                if slot < block_of.shape[0]:
                    block_of[slot] = block
                else:
                    ti.atomic_or(fault[0], FAULT_BLOCKS)


@ti.func
def slots_in_use(active: ti.template(), block_of: ti.template()):
    return ti.min(active[0], block_of.shape[0])


@ti.func
def content(grid, world, node, table: ti.template(), raw: ti.template()):
    """What was scattered to a node; zero where no block is active."""
    at = address(grid, world, node, table)
    value = vec4(0.0)
    if at >= 0:
        value = raw[at]
    return value


@ti.func
def lower_nearer(grid, node, axis: ti.template()):
    return 2 * (node[axis] - FIRST) < grid.cells[axis]


@ti.func
def kind_near(grid, node, axis: ti.template()):
    """Kind of the wall nearest to a node on an axis."""
    kind = grid.upper_kind[axis]
    if lower_nearer(grid, node, axis):
        kind = grid.lower_kind[axis]
    return kind


@ti.func
def near(grid, node, axis: ti.template()):
    """Whether a node is the first in front of a wall of this axis, or behind it."""
    walled = grid.lower_kind[axis] != PERIODIC
    return walled and (node[axis] <= FIRST or node[axis] >= FIRST + grid.cells[axis] - 1)


@ti.func
def near_any(grid, node):
    found = False
    for axis in ti.static(range(3)):
        if near(grid, node, axis):
            found = True
    return found


@ti.func
def in_reach(grid, node):
    """Whether a particle in front of all walls can have this node among its own: one behind a wall at most."""
    reached = True
    for axis in ti.static(range(3)):
        beyond = node[axis] < FIRST - 1 or node[axis] > FIRST + grid.cells[axis]
        if grid.lower_kind[axis] != PERIODIC and beyond:
            reached = False
    return reached


@ti.func
def before_wall(grid, node, axis: ti.template(), number):
    """The node of the same column that is the first (number 0), second, ... in front of the wall nearest to it."""
    out = node
    out[axis] = FIRST + number
    if not lower_nearer(grid, node, axis):
        out[axis] = FIRST + grid.cells[axis] - 1 - number
    return out


@ti.func
def contact(grid, world, node, axis: ti.template(), table: ti.template(), raw: ti.template()):
    """Share, 0 to 1, with which the wall nearest to a node acts: all of it for slip, none for periodic axes, and by
    how near matter is for rough and no-slip walls: the masses of the column's first two nodes tell."""
    kind = kind_near(grid, node, axis)
    share = 1.0
    if kind == PERIODIC:
        share = 0.0
    elif kind == FRICTION or kind == STICK:
        first = content(grid, world, before_wall(grid, node, axis, 0), table, raw)[3]
        second = content(grid, world, before_wall(grid, node, axis, 1), table, raw)[3]
        span = ti.max((CONTACT_ENDS - CONTACT_BEGINS) * second, TINY)
        share = ti.math.clamp((first - CONTACT_BEGINS * second) / span, 0.0, 1.0)
    return share


@ti.func
def in_front(grid, node):
    """The node in front of all walls whose image a node is; itself elsewhere."""
    out = node
    for axis in ti.static(range(3)):
        if grid.lower_kind[axis] != PERIODIC:
            if node[axis] < FIRST:
                out[axis] = 2 * FIRST - 1 - node[axis]
            elif node[axis] >= FIRST + grid.cells[axis]:
                out[axis] = 2 * (FIRST + grid.cells[axis]) - 1 - node[axis]
    return out


@ti.func
def behind(grid, node, axis: ti.template()):
    """Index, on one axis, of the node behind a wall that is folded onto this one; its own where there is none."""
    i = node[axis]
    if grid.lower_kind[axis] != PERIODIC:
        if node[axis] == FIRST:
            i = FIRST - 1
        if node[axis] == FIRST + grid.cells[axis] - 1:
            i = FIRST + grid.cells[axis]
    return i


@ti.func
def seen(grid, node, inside, value):
    """What a node shows that is the image of the node inside: no-slip walls turn a vector round, others the component
    across alone."""
    out = value
    for axis in ti.static(range(3)):
        if inside[axis] != node[axis]:
            kind = kind_near(grid, node, axis)
            for a in ti.static(range(3)):
                if kind == STICK or a == axis:
                    out[a] = -out[a]
    return out


@ti.func
def folded(grid, world, node, touching, table: ti.template(), raw: ti.template()):
    """Content of a node with that of its images behind the walls that act, seen in them, added."""
    ghost = node
    for axis in ti.static(range(3)):
        if touching[axis] == 1:
            ghost[axis] = behind(grid, node, axis)
    total = vec4(0.0)
    for subset in range(8):
        exists = True
        at = node
        for axis in ti.static(range(3)):
            if (subset >> axis) & 1 == 1:
                exists = exists and ghost[axis] != node[axis]
                at[axis] = ghost[axis]
        if exists:
            total += seen(grid, at, node, content(grid, world, at, table, raw))
    return total


@ti.func
def pressed(grid, world, node, touching, axis: ti.template(), kick, table: ti.template(), raw: ti.template()):
    """How fast matter in front of a friction wall would go into it if it were not there: see walls.py."""
    others, ghost = touching, node
    others[axis] = 0
    ghost[axis] = behind(grid, node, axis)
    front = folded(grid, world, node, others, table, raw)
    back = folded(grid, world, ghost, others, table, raw)
    mass = ti.max(front[3] + back[3], TINY)
    across = (front[axis] - back[axis]) / mass + kick
    lost = (front[axis] + back[axis]) / mass + kick - across * (front[3] - back[3]) / mass
    if ghost[axis] < node[axis]:
        lost = -lost
    return lost


@ti.func
def facing(grid, node, touching):
    """The node in front of the walls that act whose image a node is; itself elsewhere."""
    inside = in_front(grid, node)
    for axis in ti.static(range(3)):
        if touching[axis] == 0:
            inside[axis] = node[axis]
    return inside


@ti.func
def touched(grid, world, node, kick, table: ti.template(), raw: ti.template()):
    """(per axis 1 where a wall acts on a node; how far they act; how fast friction walls are pressed against)."""
    touching, hold, into = ivec3(0), 1.0, vec3(0.0)
    for axis in ti.static(range(3)):
        share = contact(grid, world, node, axis, table, raw)
        if near(grid, node, axis) and share > 0.0:
            hold = ti.min(hold, share)
            touching[axis] = 1
    for axis in ti.static(range(3)):
        if touching[axis] == 1 and kind_near(grid, node, axis) == FRICTION:
            into[axis] = pressed(grid, world, facing(grid, node, touching), touching, axis, kick[axis], table, raw)
            if into[axis] <= 0.0:
                touching[axis] = 0
    return touching, hold, into


@ti.func
def rubbed(grid, node, into, velocity):
    """A velocity after the friction walls that a node is pressed against: less along them by up to friction times what
    they stop (Coulomb)."""
    v = velocity
    for axis in ti.static(range(3)):
        if into[axis] > 0.0:
            friction = grid.upper_friction[axis]
            if lower_nearer(grid, node, axis):
                friction = grid.lower_friction[axis]
            across = v[axis]
            v[axis] = 0.0
            v *= 1.0 - ti.min(friction * into[axis] / ti.max(v.norm(), 1.0e-12), 1.0)
            v[axis] = across
    return v


@ti.func
def contained(grid, x):
    """A position wrapped along periodic axes and kept in front of walls."""
    out = x
    for axis in ti.static(range(3)):
        low, high = grid.lower[axis], grid.upper[axis]
        if grid.wrap[axis] > 0:
            if x[axis] < low:
                out[axis] += high - low
            elif x[axis] >= high:
                out[axis] -= high - low
        else:
            skin = 1.0e-3 * grid.dx[axis]
            out[axis] = ti.math.clamp(x[axis], low + skin, high - skin)
    return out


@ti.kernel
def reset_blocks(table: Ints, block_of: Ints, active: Ints, lanes: int):
    for slot in range(slots_in_use(active, block_of)):
        table[block_of[slot]] = 0


@ti.kernel
def find_blocks(
    grid: GridT,
    capacity: int,
    count: Ints,
    position: Vectors,
    table: Ints,
    block_of: Ints,
    active: Ints,
    fault: Ints,
):
    known = slots_in_use(active, block_of)
    for p in range(position.shape[0]):
        world = p // capacity
        if p - world * capacity < count[world]:
            claim(grid, world, base_node(grid, position[p]), table, block_of, active, fault)
    for slot in range(known, slots_in_use(active, block_of)):
        table[block_of[slot]] = slot + 1


@ti.kernel
def clear_grid(active: Ints, lanes: int, raw: Quads):
    for node in range(ti.min(active[0] * 64, raw.shape[0])):
        raw[node] = vec4(0.0)
