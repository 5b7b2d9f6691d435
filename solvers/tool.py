"""A rigid body that matter flows along, as particles feel it: the tables of tool_map.py, where it is now."""

from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.carriage import Pose, place_of
from fluidbench.native.crew import index_of
from fluidbench.native.scene import Scene

from .tool_map import QUADS, Weights, tool_map

wp.set_module_options({"enable_backward": False})

FOURS = wp.constant(QUADS)
NEAREST = 0.25  # spacings in front of the surface, nearer than which nothing is taken to be for its velocity
FAR = wp.constant(1.0e9)  # [m]
INSET = 0.2  # closest approach to it [spacings]; at rest the first layer is at 0.5


@wp.struct
class Tool:
    """A body on the device."""

    pose: Pose
    table: wp.array(dtype=wp.vec4)
    rows: int
    columns: int
    low: float  # height of the first row [m]
    per_pitch: float  # [1/m]
    nearest: float  # [m]
    inset: float  # [m]
    slips: int


@wp.struct
class Felt:
    """What a particle finds of it. Moments `own` are those that go with its velocity relative to the body."""

    on: int
    gap: float  # distance from the surface [m]
    normal: wp.vec3
    velocity: wp.vec3  # of the body [m/s]
    first: wp.vec3  # sum s r
    own: wp.vec3
    second: wp.mat33  # sum s r r
    zeroth: float  # sum s
    drag: wp.mat33  # sum w r r
    level: float  # sum l
    squares: float  # sum (s r)^2 spacing^3
    full: float  # sum f


def tool_of(scene: Scene, reach: float, weights: Weights | None = None) -> Tool:
    """The scene's body, for kernels of a method that reaches so far [m]; without weights they find no moments."""
    outline, carriage = scene.outline, scene.carriage
    assert outline is not None and carriage is not None
    found = tool_map(outline, scene.spacing, reach, weights)
    tool = Tool()
    tool.pose = carriage.pose
    tool.rows, tool.columns = found.table.shape[:2]
    tool.low, tool.per_pitch = found.low, 1.0 / found.pitch
    tool.nearest, tool.inset = NEAREST * scene.spacing, INSET * scene.spacing
    tool.slips = int(outline.slips)
    tool.table = wp.array(found.table.reshape(-1, 4), dtype=wp.vec4, device=scene.device)
    return tool


def table_of(tool: Any) -> dict[str, int]:
    """Bytes that a body takes on the device, if there is one."""
    return {} if tool is None else {"tool.table": tool.table.capacity}


@wp.func
def entry(tool: Tool, at: int, f: float, g: float, quad: int):
    """Four floats between four entries."""
    beside, above = at + FOURS, at + tool.columns * FOURS
    lower = (1.0 - f) * tool.table[at + quad] + f * tool.table[beside + quad]
    upper = (1.0 - f) * tool.table[above + quad] + f * tool.table[above + FOURS + quad]
    return (1.0 - g) * lower + g * upper


@wp.func
def turned(m: wp.vec4, out: wp.vec3, around: wp.vec3):
    """The tensor with parts rr, tt, zz, rz."""
    up = wp.vec3(0.0, 0.0, 1.0)
    tensor = m[0] * wp.outer(out, out) + m[1] * wp.outer(around, around) + m[2] * wp.outer(up, up)
    return tensor + m[3] * (wp.outer(out, up) + wp.outer(up, out))


@wp.func
def cell_of_table(tool: Tool, x: wp.vec3):
    """(first float four of the entry below and inside a point, shares of the next ones; the direction out)"""
    away = x - place_of(tool.pose)
    radius = wp.sqrt(away[0] * away[0] + away[1] * away[1])
    out = wp.vec3(1.0, 0.0, 0.0)
    if radius > 0.0:
        out = wp.vec3(away[0] / radius, away[1] / radius, 0.0)
    across = radius * tool.per_pitch
    up = wp.min((away[2] - tool.low) * tool.per_pitch, float(tool.rows) - 1.001)
    at = int(-1)
    if across < float(tool.columns) - 1.001 and up >= 0.0:
        at = (int(up) * tool.columns + int(across)) * FOURS
    return at, across - wp.floor(across), up - wp.floor(up), out


@wp.func
def felt(tool: Tool, x: wp.vec3):
    """All of it at a point."""
    found = Felt()
    at, f, g, out = cell_of_table(tool, x)
    if at >= 0:
        around, up = wp.vec3(-out[1], out[0], 0.0), wp.vec3(0.0, 0.0, 1.0)
        place = entry(tool, at, f, g, 0)
        first = entry(tool, at, f, g, 1)
        last = entry(tool, at, f, g, 5)
        found.on = 1
        found.gap = place[0]
        found.normal = wp.normalize(place[1] * out + place[2] * up)
        found.velocity = tool.pose.velocity[0]
        bent = 1.0 / wp.max(place[0], tool.nearest)
        found.first = first[0] * out + first[1] * up
        found.own = found.first + bent * (first[2] * out + first[3] * up)
        found.zeroth = place[3] + bent * last[0]
        found.second = turned(entry(tool, at, f, g, 2), out, around)
        found.drag = turned(entry(tool, at, f, g, 3) + bent * entry(tool, at, f, g, 4), out, around)
        if tool.slips == 1:
            found.drag = wp.mat33()
        found.level = last[1]
        found.squares = last[2]
        found.full = last[3]
    return found


@wp.func
def seen_by_tool(tool: Tool, found: Felt, v: wp.vec3):
    """The velocity relative to the body that it mirrors: of a surface that lets slip, its part along the normal."""
    u = v - found.velocity
    if tool.slips == 1:
        u = wp.dot(u, found.normal) * found.normal
    return u


@wp.func
def distance_to(tool: Tool, x: wp.vec3):
    """(distance of a point in front of the surface [m], FAR where the table ends; the normal)"""
    gap, normal = FAR, wp.vec3(0.0, 0.0, 1.0)
    at, f, g, out = cell_of_table(tool, x)
    if at >= 0:
        place = entry(tool, at, f, g, 0)
        gap = place[0]
        normal = wp.normalize(place[1] * out + place[2] * wp.vec3(0.0, 0.0, 1.0))
    return gap, normal


@wp.func
def outside(tool: Tool, x: wp.vec3):
    """A position, kept in front of the surface."""
    gap, normal = distance_to(tool, x)
    return x + wp.max(tool.inset - gap, 0.0) * normal


@wp.kernel
def keep_out(
    share: wp.vec3i,
    tool: Tool,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3),
):
    """What would enter the body stays in front of it."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        position[i] = outside(tool, position[i])
