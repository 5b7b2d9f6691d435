"""The background grid of MPM and its walls, in Taichi: what grid.py and walls.py say, written anew.

Functions over `axis` are unrolled: it is known when they are compiled.
"""

from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from ..taichi_bridge import Ints, Quads, Vectors, ivec3, struct_of, ti, vec3, vec4
from .grid import FAULT_BLOCKS, FIRST, Grid
from .walls import CONTACT_BEGINS, CONTACT_ENDS, THIN, TINY

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
def mirrors(kind):
    """Slip and stick walls are mirrors; rough walls let material lift off."""
    return kind != FRICTION and kind != PERIODIC


@ti.func
def kind_near(grid, node, axis: ti.template()):
    """Kind of the wall nearest to a node on an axis."""
    kind = grid.upper_kind[axis]
    if 2 * (node[axis] - FIRST) < grid.cells[axis]:
        kind = grid.lower_kind[axis]
    return kind


@ti.func
def near(grid, node, axis: ti.template()):
    """Whether a node is on, one in front of, or behind a wall of this axis."""
    return node[axis] <= FIRST + 1 or node[axis] >= FIRST + grid.cells[axis] - 1


@ti.func
def near_any(grid, node):
    found = False
    for axis in ti.static(range(3)):
        if grid.lower_kind[axis] != PERIODIC and near(grid, node, axis):
            found = True
    return found


@ti.func
def in_reach(grid, node):
    """Whether a particle in front of all walls can have this node among its own: one behind a wall at most."""
    reached = True
    for axis in ti.static(range(3)):
        beyond = node[axis] < FIRST - 1 or node[axis] > FIRST + grid.cells[axis] + 1
        if grid.lower_kind[axis] != PERIODIC and beyond:
            reached = False
    return reached


@ti.func
def beyond_wall(grid, node, axis: ti.template(), cells):
    """The node of the same column that is so many cells inside the wall nearest to it; behind it where negative."""
    out = node
    out[axis] = FIRST + cells
    if 2 * (node[axis] - FIRST) >= grid.cells[axis]:
        out[axis] = FIRST + grid.cells[axis] - cells
    return out


@ti.func
def contact(grid, world, node, axis: ti.template(), table: ti.template(), raw: ti.template()):
    """Share, 0 to 1, with which the wall nearest to a node acts: all of it for mirrors, none for periodic axes, and by
    how near matter is for rough and no-slip walls: the masses of the column's first two nodes tell."""
    kind = kind_near(grid, node, axis)
    share = 1.0
    if kind == PERIODIC:
        share = 0.0
    elif kind == FRICTION or kind == STICK:
        first = content(grid, world, beyond_wall(grid, node, axis, 0), table, raw)[3]
        second = content(grid, world, beyond_wall(grid, node, axis, 1), table, raw)[3]
        span = ti.max((CONTACT_ENDS - CONTACT_BEGINS) * second, TINY)
        share = ti.math.clamp((first - CONTACT_BEGINS * second) / span, 0.0, 1.0)
    return share


@ti.func
def in_front(grid, node, axis: ti.template()):
    """Index, on one axis, of the node whose image in a mirroring wall this node is; its own where it is none."""
    i, last = node[axis], FIRST + grid.cells[axis]
    if i < FIRST and mirrors(grid.lower_kind[axis]):
        i = 2 * FIRST - i
    elif i > last and mirrors(grid.upper_kind[axis]):
        i = 2 * last - i
    return i


@ti.func
def behind(grid, node, axis: ti.template()):
    """Index, on one axis, of the ghost node that a mirroring wall folds onto this one; its own where there is none."""
    i, last = node[axis], FIRST + grid.cells[axis]
    if node[axis] == FIRST + 1 and mirrors(grid.lower_kind[axis]):
        i = FIRST - 1
    if node[axis] == last - 1 and mirrors(grid.upper_kind[axis]):
        i = last + 1
    return i


@ti.func
def seen_in_wall(value, axis: ti.template(), kind):
    """A momentum or velocity as its mirror image: slip turns the normal component round, stick all three."""
    out = value
    for a in ti.static(range(3)):
        if kind == STICK or a == axis:
            out[a] = -value[a]
    return out


@ti.func
def folded(grid, world, node, touching, table: ti.template(), raw: ti.template()):
    """Content of a node with that of its ghosts behind mirroring walls, seen in them, added."""
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
            value = content(grid, world, at, table, raw)
            for axis in ti.static(range(3)):
                if (subset >> axis) & 1 == 1:
                    value = seen_in_wall(value, axis, kind_near(grid, at, axis))
            total += value
    return total


@ti.func
def bounded(grid, node, touching, velocity):
    """A velocity that keeps out of the walls that a node lies on: none through them, none along no-slip walls, and
    along rough ones less by up to friction times what was stopped (Coulomb)."""
    v = velocity
    for axis in ti.static(range(3)):
        low, high = node[axis] <= FIRST, node[axis] >= FIRST + grid.cells[axis]
        if touching[axis] == 1 and (low or high):
            kind, friction, outward = grid.lower_kind[axis], grid.lower_friction[axis], -1.0
            if high:
                kind, friction, outward = grid.upper_kind[axis], grid.upper_friction[axis], 1.0
            into = outward * v[axis]
            if kind == STICK:
                v = vec3(0.0)
            elif kind != FRICTION:
                v[axis] = 0.0
            elif into > 0.0:
                v[axis] = 0.0
                v *= 1.0 - ti.min(friction * into / ti.max(v.norm(), 1.0e-12), 1.0)
    return v


@ti.func
def on_wall(grid, node, axis: ti.template()):
    return node[axis] == FIRST or node[axis] == FIRST + grid.cells[axis]


@ti.func
def squeezed(grid, world, node, inside, touching, kick, result, table: ti.template(), raw: ti.template()):
    """A node's velocities, those across no-slip walls as of matter that goes as z^2: -U/3 on the wall, U beside it."""
    out = result
    for axis in ti.static(range(3)):
        free, sign = True, 1.0
        others = touching
        others[axis] = 0
        for other in ti.static(range(3)):
            if others[other] == 1 and kind_near(grid, node, other) == STICK:
                if on_wall(grid, inside, other):
                    free = False
                if inside[other] != node[other]:
                    sign = -sign
        if touching[axis] == 1 and kind_near(grid, node, axis) == STICK and free:
            middle = folded(grid, world, beyond_wall(grid, inside, axis, 0), others, table, raw)
            sides = folded(grid, world, beyond_wall(grid, inside, axis, 1), others, table, raw)
            sides += folded(grid, world, beyond_wall(grid, inside, axis, -1), others, table, raw)
            u = 0.0
            if sides[3] > 0.0:
                mass = ti.max(sides[3] - middle[3] / 3.0, THIN * sides[3])
                u = sign * ((sides[axis] - middle[axis] / 3.0) / mass + kick[axis])
            out[axis] = u
            if on_wall(grid, node, axis):
                out[axis] = -u / 3.0
    return out


@ti.func
def beside_wall(gap):
    """(u / (g dx), du/dz / g) that nodes leave out `gap` cells from a no-slip wall: see particle.py."""
    on, behind = 0.0, 0.0
    if gap < 0.5:
        on, behind = 0.75 - gap * gap, 0.5 * (0.5 - gap) ** 2
    elif gap < 1.5:
        on = 0.5 * (1.5 - gap) ** 2
    return ti.Vector([on / 3.0 - 2.0 * behind, 8.0 * (1.0 + gap) * behind - 4.0 * gap * on / 3.0])


@ti.func
def rising(grid, x, g):
    """(velocity, diagonal of its gradient) that growth at g adds to what nodes beside no-slip walls know."""
    v, c = vec3(0.0), vec3(0.0)
    if g != 0.0:
        for axis in ti.static(range(3)):
            if grid.lower_kind[axis] == STICK:
                low = beside_wall((x[axis] - grid.lower[axis]) * grid.inv_dx[axis])
                v[axis] += g * grid.dx[axis] * low[0]
                c[axis] += g * low[1]
            if grid.upper_kind[axis] == STICK:
                high = beside_wall((grid.upper[axis] - x[axis]) * grid.inv_dx[axis])
                v[axis] -= g * grid.dx[axis] * high[0]
                c[axis] += g * high[1]
    return v, c


@ti.func
def near_walls(grid, x, c):
    """The affine field that carries momentum; du/dz near a no-slip wall times (1 + 2 (z / 1.5)^2) / 3, z in cells."""
    out = c
    for axis in ti.static(range(3)):
        gap = 1.5
        if grid.lower_kind[axis] == STICK:
            gap = ti.min(gap, (x[axis] - grid.lower[axis]) * grid.inv_dx[axis])
        if grid.upper_kind[axis] == STICK:
            gap = ti.min(gap, (grid.upper[axis] - x[axis]) * grid.inv_dx[axis])
        out[axis, axis] *= (1.0 + 2.0 * (gap / 1.5) ** 2) / 3.0
    return out


@ti.func
def share_inside(grid, node):
    """Inverse of the part of a node's cell that lies inside the walls."""
    share = 1.0
    for axis in ti.static(range(3)):
        on = node[axis] == FIRST or node[axis] == FIRST + grid.cells[axis]
        if on and grid.lower_kind[axis] != PERIODIC:
            share *= 2.0
    return share


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
