"""Position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp.

One substep: predict, lists, then per iteration multipliers and correction, then velocity from the change of position.
What is elastic answers strain by the common law (elastic_warp.py), implicit in time as Newtonian viscosity is
(../viscosity.py). Sums over pairs are those of pairs.py.
"""

import functools
from dataclasses import replace
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import Box, Force, Phase, force_at, is_solid, too_fast
from fluidbench.native.vector_access import store_vec4

from ..images import WALL_INSET, contained, image_gradient, walled
from ..pairs import Pass, floats
from ..tool import Tool, felt, outside
from .elastic_warp import KERNELS, counted, elastic, gradient, sloping, summed
from .numbers import PLACE, PUSH, Numbers
from .walls import pushed, wall_friction

wp.set_module_options({"enable_backward": False, "fast_math": True})

vec5 = floats(5)

SLACK = wp.constant(
    2.0e-3
)  # density that is left alone, over that at rest: what the lattices of round bodies are off by
HURRIED = wp.constant(10.0)  # corrections of a crowded start are this much faster, for a substep, than any matter
FARTHEST = wp.constant(1.0e3)  # spacings beyond which no constraint wants a particle to move
CROWDED = wp.constant(0.25)  # excess of density that is pushed apart at once: limits moves, and momentum stays
NEAREST = wp.constant(0.5)  # spacings that two keep apart: density alone lets them pair
PARTED = wp.constant(0.5)  # share of what two are too near that a correction takes away
SLACK_SOLID = wp.constant(0.1)  # a solid's bulk modulus keeps its density; the constraint only keeps its parts apart
DRAWN = wp.constant(0.5)  # of a lack of density, in an iteration: the stiffest wave in a lattice goes by 1.7 of a whole


@wp.kernel
def predict(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    velocity: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    pulled: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Position under the present velocity, gravity and elastic stress. `motion` carries the displacement of the substep
    by itself: as a difference of float32 positions it would lose the velocity at small dt."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        if held[i] == FREE:
            v += h * (force_at(force[world], position[i]) + pulled[i])
        free = position[i] + h * v
        if too_fast(v, HURRIED * box.top_speed):
            raise_fault(fault, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * num.spacing)
        motion[i] = h * v + pushed(box, free, x)
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@wp.struct
class Constraining:
    """What the constraints read and write of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    motion: wp.array(dtype=wp.vec3)
    pushes: wp.array(dtype=wp.vec4)
    fill: wp.array(dtype=float)
    bias: wp.array(dtype=float)  # of the density, by disorder: elastic_warp.py; one zero where nothing is elastic
    enclosure: wp.array(dtype=float)
    correction: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.func
def multiplier_pair(num: Numbers, own: floats(PLACE + 4), other: floats(PLACE), r: wp.vec3):
    dense = other[3] * summed(wp.length(r), num.support)
    g = num.slope_weight * sloping(num, other[3], r)
    return vec5(dense, g[0], g[1], g[2], wp.dot(g, g))


@wp.func
def multiplier_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PLACE + 4), sums: vec5
):
    dense = num.weight * (sums[0] + counted(num, own[3]) * summed(0.0, num.support))
    together = wp.vec3(sums[1], sums[2], sums[3])
    phase = data.phases[world, data.phase_of[i]]
    flows = phase.shear_modulus > 0.0 and not is_solid(phase)
    if flows:
        dense /= 1.0 + data.bias[i]
    data.fill[i] = dense
    limit = 1.0 + wp.where(is_solid(phase), SLACK_SOLID, SLACK)
    # Lengths are scaled by the spacing to make epsilon a number.
    slopes = (sums[4] + wp.dot(together, together)) * num.spacing * num.spacing
    metric = num.response * slopes + num.relaxation
    multiplier = -wp.clamp(dense - limit, 0.0, CROWDED) / metric
    if flows:
        # A surface must not be drawn together: what lies within matter is denser than its face, and has others all
        # round.
        within = wp.clamp(2.0 * (dense - num.face) / (1.0 - num.face), 0.0, 1.0)
        lack = data.enclosure[i] * within * wp.max(1.0 - SLACK - dense, 0.0)
        # Tension of bulk modulus K: it moves by dt^2 K lack grad W / rho in a substep, however short.
        wave = data.dt[world] / num.spacing
        compliance = num.iterations * data.mass[i] / (own[3] * phase.bulk_modulus * wave * wave)
        multiplier += DRAWN * lack / (metric + compliance)
    store_vec4(data.pushes, 3 * i, wp.vec4(own[0], own[1], own[2], own[3]))
    heft, moved = data.mass[i] / (own[3] * phase.density), data.motion[i]
    store_vec4(data.pushes, 3 * i + 1, wp.vec4(multiplier, heft, 0.0, 0.0))
    store_vec4(data.pushes, 3 * i + 2, wp.vec4(moved[0], moved[1], moved[2], 0.0))


@wp.func
def tooled_multiplier_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PLACE + 4), sums: vec5
):
    found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
    together = num.slope_weight * found.first
    squares = num.slope_weight * num.slope_weight * found.squares
    sums += vec5(found.level, together[0], together[1], together[2], squares)
    multiplier_finish(num, box, data, world, i, own, sums)


multipliers = Pass(Numbers, Constraining, PLACE, 5, multiplier_pair, multiplier_finish)
"""Lagrange multiplier of the density constraint rho / rho0 <= 1 (eqs. 1, 8, 9 and 11 of the paper). What has strength
and flows is drawn together, too.

The paper sums density with poly6 and moves along the slope of the spiky kernel. Poly6 has a flat top, under which
particles pair; the spiky kernel itself reads matter in disorder 8 % too dense, which then swells. `cusp` is between
them: 2 to 5 %. Sums: density, gradient of the own place (3), squares of the others'.
"""


@wp.func
def seen_pushing(box: Box, data: Constraining, row: floats(PUSH), j: int, code: int):
    moved = image_gradient(box, wp.vec3(row[8], row[9], row[10]), code)
    for axis in range(3):
        row[8 + axis] = moved[axis]
    return row


@wp.func
def correct_pair(num: Numbers, own: floats(PUSH + 4), other: floats(PUSH), r: wp.vec3):
    distance = wp.length(r)
    share = 2.0 * other[5] / (own[5] + other[5])
    push = (share * (own[4] + other[4]) * num.slope_weight) * other[3] * gradient(distance, num.support)
    lap = wp.max(NEAREST * num.spacing - distance, 0.0)
    mass = other[3] * other[5]
    push += PARTED * lap * mass / ((own[3] * own[5] + mass) * num.spacing * num.spacing)
    before = r - wp.vec3(own[8] - other[8], own[9] - other[9], own[10] - other[10])
    return (push / wp.max(wp.length(before), 1.0e-9)) * before


@wp.func
def correct_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PUSH + 4), sums: wp.vec3
):
    if data.held[i] == FREE:
        data.correction[i] = (num.over_relaxation * num.spacing * num.spacing) * sums


@wp.func
def tooled_correct_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PUSH + 4), sums: wp.vec3
):
    found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
    correct_finish(num, box, data, world, i, own, sums + (2.0 * own[4] * num.slope_weight) * found.first)


correct = Pass(Numbers, Constraining, PUSH, 3, correct_pair, correct_finish, seen=seen_pushing)
"""Position correction (eq. 12), and of pairs that are too near (Mueller et al. 2007, J. Vis. Commun. Image R. 18:109),
as one simultaneous Jacobi step. Of two the lighter moves more, such that momentum stays: V_i rho_i dx_i = - V_j rho_j
dx_j. They part along the line between them as the substep began, as bonds do in SHAKE (Ryckaert et al. 1977): with v =
(x - x0) / dt, m x cross v is m x0 cross v, and stays. Sums over spacing squared."""


@wp.kernel
def apply(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    correction: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Move by the correction, at most a spacing, and stay inside the walls."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        shift = correction[i]
        length = wp.length(shift)
        limit = num.spacing
        if length > limit:
            shift = shift * (limit / length)
        free = position[i] + shift
        if not (length <= FARTHEST * num.spacing):
            raise_fault(fault, FAULT_ASTRAY)
        x = walled(box, free, WALL_INSET * num.spacing)
        motion[i] = motion[i] + shift + pushed(box, free, x)
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@wp.kernel
def velocities(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    motion: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
):
    """v = displacement / dt."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        velocity[i] = motion[i] / dt[world]


@wp.kernel
def follow(
    share: wp.vec3i,
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    drag: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
):
    """Viscosity holds back what gravity and constraints have moved in the substep, too, by drag dt^2: matter goes where
    its velocity takes it after the solve."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        free = position[i] + (dt[world] * dt[world]) * drag[i]
        position[i] = walled(box, free, WALL_INSET * num.spacing)


@wp.kernel
def keep_out(
    share: wp.vec3i,
    tool: Tool,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    volume: wp.array(dtype=float),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
):
    """What would enter a rigid body stays in front of it."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        x = outside(tool, position[i])
        motion[i] = motion[i] + x - position[i]
        position[i] = x
        store_vec4(places, i, wp.vec4(x[0], x[1], x[2], volume[i]))


@functools.cache
def passes(tooled: bool, cpu: bool) -> SimpleNamespace:
    """The passes for one kind of device, beside a rigid body or without one."""
    over_pairs = {"multipliers": multipliers, "correct": correct}
    if tooled:
        over_pairs = {
            "multipliers": replace(multipliers, finish=tooled_multiplier_finish),
            "correct": replace(correct, finish=tooled_correct_finish),
        }
    over_pairs |= elastic(tooled)
    name = "tooled_" * tooled
    return SimpleNamespace(
        predict=predict,
        apply=apply,
        velocities=velocities,
        follow=follow,
        wall_friction=wall_friction,
        **({"keep_out": keep_out} if tooled else {}),
        **{kernel.key: kernel for kernel in KERNELS},
        **{key: one.compiled(name + key, cpu) for key, one in over_pairs.items()},
    )
