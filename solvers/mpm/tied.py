"""Nodes at a rigid body are tied to those in front of it: a wall that makes no energy, wherever it lies between nodes.

A velocity that obeys a wall is told by the nodes that are well in front of it. Any other, at a distance d_i of less
than 3/4 of a cell (negative behind the surface), follows those among the eight nodes j around the point as far in
front of the surface as it is behind (or 3/4 of a cell), with their trilinear weights w_ij:

    v_i - u = sum_j G_ij (v_j - u),   G_ij = w_ij d_i / sum_k w_ik d_k

So a linear shear is exact, wherever the nodes lie (u: velocity of the body). Of walls that slip that is the part along
the normal n_i; across it, G_ij = w_ij / sum_k w_ik. What particles give to i goes on by the transpose,

    M_j (v_j - u) = P_j - m_j u + sum_i G_ij^T (P_i - m_i u),   M_j = m_j + sum_i m_i G_ij^2 / s_ij

with s_ij = w_ij d_j / sum_k w_ik d_k along the normal, w_ij / sum_k w_ik across it. These add up to 1, so by Cauchy and
Schwarz M is no less than G^T m G: no transfer amplifies, stress does the work of the strain that is read, whatever its
law, and no frequency rises, so that the bounds of the step stay what they are. (What else acts on volume ratios and
places, tool.py, has no such proof; and where nodes that lead are behind a wall of the domain, less than two cells from
the body, the two are not one constraint.) And as sum_i m_i G_ij d_i / d_j is just this M, what shears linearly along a
no-slip wall is left as it is by transfers. (Masses lumped by w, as would be usual, take up to half of the velocity of
the last node in every step: a bore then resisted by a fifth too much.)

What slips along a face is free beyond its rim: tied to where it leaves, along a normal that leans, it would be held and
lifted (a strand rose by a twentieth behind the tip). So in front of rims of such walls nodes are not tied.

Images of particles behind the surface, which came before, were gathered from otherwise than they were scattered to:
that amplified by up to 1.03 a step, and only viscosity held it. Their transpose does not, but the last images end in
a void, into which the pressure leaks.
"""

from typing import Any

import numpy as np
import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Force, Scene, force_at

from ..tool import Tool, distance_to, place_of
from .grid import Grid, node_at, node_of, turns

wp.set_module_options({"enable_backward": False, "fast_math": True})

TIED = wp.constant(0.75)  # distance of nodes that are tied [cells]; with 0.5 the next ones hold a face too loosely
BEHIND = wp.constant(2.75)  # how far behind the surface nodes have mass [cells]: 1.5 sqrt(3) at most
SLANT = wp.constant(0.1)  # of a normal, from which on it belongs to a rim
REACH = 4.5  # of distances [cells]: nodes about what is in front of those
LEAST = wp.constant(1.0e-4)  # inertia over mass of a node which moves none but those on the surface
Blocks = tuple[wp.array, wp.array, wp.array]  # table, block_of and active of a grid


@wp.struct
class Tie:
    """Of a node: on whom it depends."""

    on: int
    gap: float  # its distance from the surface [m]
    normal: wp.vec3
    base: wp.vec3i  # the lowest of the eight nodes
    share: wp.vec3  # where the point between them lies [cells]
    weight: float  # sum of w
    moment: float  # sum of w d [m]


@wp.func
def place_of_node(grid: Grid, node: wp.vec3i):
    return grid.origin + wp.cw_mul(grid.dx, wp.vec3(float(node[0]), float(node[1]), float(node[2])))


@wp.func
def leaning_out(tool: Tool, x: wp.vec3, normal: wp.vec3):
    """(the direction out from the body's axis; how far its normal leans that way: -1 in a bore, 0 under a face, 1
    beside the tip, between these at its rims)"""
    away = x - place_of(tool.pose)
    out = wp.normalize(wp.vec3(away[0], away[1], 0.0))
    return out, wp.dot(out, normal)


@wp.func
def node_here(grid: Grid, block_of: wp.array(dtype=int), t: int):
    """(world, node) of the t-th of all active nodes."""
    block = block_of[t >> 6]
    world = block / grid.blocks_per_world
    return world, node_of(grid, block - world * grid.blocks_per_world, t & 63)


@wp.func
def leader(grid: Grid, tool: Tool, edge: float, world: int, tie: Tie, corner: int, table: wp.array(dtype=int)):
    """(where a node that another one follows lies among nodes, -1 where it is tied itself or there is none; w; d)"""
    up = wp.vec3i(corner >> 2, (corner >> 1) & 1, corner & 1)
    w = float(1.0)
    for axis in range(3):
        w *= wp.where(up[axis] == 1, tie.share[axis], 1.0 - tie.share[axis])
    at, gap = int(-1), float(0.0)
    if w > 0.0:
        node = tie.base + up
        at = node_at(grid, world, node, table)
        gap, _normal = distance_to(tool, place_of_node(grid, node))
        if gap < TIED * edge:
            at = -1
    return at, w, gap


@wp.func
def tie_of(grid: Grid, tool: Tool, edge: float, world: int, node: wp.vec3i, table: wp.array(dtype=int)):
    """How a node is tied, if it is."""
    tie = Tie()
    x = place_of_node(grid, node)
    gap, normal = distance_to(tool, x)
    tie.gap = gap
    tie.normal = normal
    _out, leaning = leaning_out(tool, x, normal)
    at_rim = tool.slips == 1 and gap > 0.0 and normal[2] < -SLANT and wp.abs(leaning) > SLANT
    if tie.gap < TIED * edge and tie.gap > -BEHIND * edge and not at_rim:
        tie.on = 1
        front = wp.max(wp.abs(tie.gap), TIED * edge)
        y = wp.cw_mul(x + (front - tie.gap) * tie.normal - grid.origin, grid.inv_dx)
        tie.base = wp.vec3i(int(wp.floor(y[0])), int(wp.floor(y[1])), int(wp.floor(y[2])))
        tie.share = y - wp.vec3(float(tie.base[0]), float(tie.base[1]), float(tie.base[2]))
        for corner in range(8):
            at, w, ahead = leader(grid, tool, edge, world, tie, int(corner), table)
            if at >= 0:
                tie.weight += w
                tie.moment += w * ahead
    return tie


@wp.func
def share_in_front(tool: Tool, edge: float, x: wp.vec3, gap: float, normal: wp.vec3):
    """The share of a node's spline that is in front of the surface: what there is of it up to a plane, at the distance
    at which a surface as bent is in the mean, as splines reach by 1/2 of a cell (standard deviation) to all sides."""
    out, leaning = leaning_out(tool, x, normal)
    radius = wp.dot(out, x - place_of(tool.pose)) - gap * leaning  # of the surface there
    d = gap / edge + 0.125 * leaning * edge / wp.max(radius, edge)
    a = wp.min(wp.abs(d), 1.5)
    beyond = 1.5 - a
    half = wp.where(a < 0.5, 0.75 * a - a * a * a / 3.0, 0.5 - beyond * beyond * beyond / 6.0)
    return 0.5 + wp.sign(d) * half


@wp.kernel
def give(
    grid: Grid,
    tool: Tool,
    edge: float,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    raw: wp.array(dtype=wp.vec4),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    # outputs
    gain: wp.array(dtype=wp.vec4),
    inertia: wp.array(dtype=wp.mat33),
    space: wp.array(dtype=float),
):
    """What nodes that are tied have goes on to those that they follow: momentum relative to the body and mass; inertia;
    the share of their splines that is in front."""
    t, end, step = turns(wp.tid(), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        world, node = node_here(grid, block_of, t)
        tie = tie_of(grid, tool, edge, world, node, table)
        if tie.on == 1 and tie.weight > 0.0:
            m = raw[t][3]
            x = place_of_node(grid, node)
            open = share_in_front(tool, edge, x, tie.gap, tie.normal)
            kick = dt[world] * force_at(force[world], x)
            p = wp.vec3(raw[t][0], raw[t][1], raw[t][2]) + m * (kick - tool.pose.velocity[0])
            along = wp.outer(tie.normal, tie.normal)
            rest = wp.identity(n=3, dtype=float) - along
            for corner in range(8):
                at, w, gap = leader(grid, tool, edge, world, tie, int(corner), table)
                if at >= 0:
                    mean = w / tie.weight
                    wp.atomic_add(space, at, mean * open)
                    if m > 0.0:
                        g = w * tie.gap / tie.moment
                        heavy = m * g * tie.gap / gap
                        given, weighs = g * p, heavy * (along + rest)
                        if tool.slips == 1:
                            given = g * (along * p) + mean * (rest * p)
                            weighs = heavy * along + (mean * m) * rest
                        wp.atomic_add(gain, at, wp.vec4(given[0], given[1], given[2], mean * m))
                        wp.atomic_add(inertia, at, weighs)
        t += step


@wp.kernel
def take(
    share: wp.vec3i,
    grid: Grid,
    tool: Tool,
    edge: float,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    # outputs
    raw: wp.array(dtype=wp.vec4),
    gain: wp.array(dtype=wp.vec4),
    inertia: wp.array(dtype=wp.mat33),
    space: wp.array(dtype=float),
):
    """Nodes that are followed: their velocity, but for forces, as momentum, over a mass that makes their density that
    of the space in front. What was given to them is empty then."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, raw.shape[0]))
    while t < end:
        world, node = node_here(grid, block_of, t)
        x = place_of_node(grid, node)
        gap, normal = distance_to(tool, x)
        if gap >= TIED * edge and gap < REACH * edge:
            row, given = raw[t], gain[t]
            mass = row[3] + given[3]
            if mass > 0.0:
                u = tool.pose.velocity[0]
                kick = dt[world] * force_at(force[world], x)
                p = wp.vec3(row[0] + given[0], row[1] + given[1], row[2] + given[2]) + row[3] * (kick - u)
                own = (row[3] + LEAST * given[3]) / mass
                v = u - kick + wp.inverse(inertia[t] / mass + own * wp.identity(n=3, dtype=float)) * (p / mass)
                mass /= wp.max(share_in_front(tool, edge, x, gap, normal) + space[t], 0.5)
                raw[t] = wp.vec4(mass * v[0], mass * v[1], mass * v[2], mass)
            gain[t] = wp.vec4()
            inertia[t] = wp.mat33()
            space[t] = 0.0
        t += step


@wp.kernel
def trail(
    share: wp.vec3i,
    grid: Grid,
    tool: Tool,
    edge: float,
    lanes: int,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    # outputs
    moving: wp.array(dtype=wp.vec4),
):
    """Velocity and density of nodes that are tied; with the body where there is none to follow."""
    t, end, step = turns(index_of(share, wp.tid()), lanes, wp.min(active[0] * 64, moving.shape[0]))
    while t < end:
        world, node = node_here(grid, block_of, t)
        tie = tie_of(grid, tool, edge, world, node, table)
        if tie.on == 1:
            u = tool.pose.velocity[0]
            along, mean = wp.vec3(), wp.vec4()
            if tie.weight > 0.0:
                for corner in range(8):
                    at, w, _gap = leader(grid, tool, edge, world, tie, int(corner), table)
                    if at >= 0:
                        v = moving[at]
                        mean += (w / tie.weight) * v
                        along += (w * tie.gap / tie.moment) * (wp.vec3(v[0], v[1], v[2]) - u)
                if tool.slips == 1:
                    beside = wp.vec3(mean[0], mean[1], mean[2]) - u
                    along = beside + wp.dot(along - beside, tie.normal) * tie.normal
            moving[t] = wp.vec4(u[0] + along[0], u[1] + along[1], u[2] + along[2], mean[3])
        t += step


class Tied:
    """The nodes that a body ties, and their launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, grid: Grid, tool: Any, slots: int, lanes: int) -> None:
        """`slots` are the blocks of the grid that can be active, `lanes` the threads that go through their nodes."""
        self.scene = scene
        self.body = [grid, tool, float(np.cbrt(1.0 / grid.inv_volume)), lanes]
        with wp.ScopedDevice(scene.device):
            self.gain = wp.zeros(64 * slots, dtype=wp.vec4)
            self.inertia = wp.zeros(64 * slots, dtype=wp.mat33)
            self.space = wp.zeros(64 * slots, dtype=float)

    def give(self, dt: wp.array, blocks: Blocks, raw: wp.array) -> None:
        """Enqueue: momenta and masses of nodes that are followed, in which gravity acts on those that follow, too."""
        table, block_of, active = blocks
        launch, kick = self.scene.crew.launch, [dt, self.scene.force]
        told = [self.gain, self.inertia, self.space]
        launch(give, self.body[-1], [*self.body, active, block_of, table, raw, *kick], told)
        launch(take, self.body[-1], [*self.body, active, block_of, *kick], [raw, *told])

    def trail(self, blocks: Blocks, moving: wp.array) -> None:
        """Enqueue: velocities and densities of nodes that follow."""
        table, block_of, active = blocks
        self.scene.crew.launch(trail, self.body[-1], [*self.body, active, block_of, table], [moving])

    def footprint(self) -> dict[str, int]:
        return {f"tied.{name}": getattr(self, name).capacity for name in ("gain", "inertia", "space")}
