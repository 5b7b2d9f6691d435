"""Viscosity implicit in time, in Warp: the operator on pairs, and what goes in and out of a solve (viscosity.py has the
equations, conjugate_warp.py the iterations)."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.scene import STICK, Box, Phase, is_solid
from fluidbench.native.vector_access import load_vec4, store_vec4

from .aging import rest_density
from .bind import warp_func
from .conjugate_warp import KERNELS
from .images import face_kind, image_velocity
from .pairs import Pass, floats
from .smoothing import drag_tail, drag_weight, pair_drag, shared_viscosity
from .tool import Tool, felt

wp.set_module_options({"enable_backward": False})

weight = warp_func(drag_weight, drag_tail)
dragging = warp_func(pair_drag, drag_tail)
shared = warp_func(shared_viscosity)

# Rows that neighbours are asked for: position, volume | direction, viscosity | one over the root of the
# fullness, signs of s over r.
DIRECTION = 12
EMPTIEST = wp.constant(0.125)  # a corner's fullness: what has less around it is taken to have this
vec1 = floats(1)


@wp.struct
class Viscous:
    """Numbers of the discretisation."""

    support: float  # radius within which particles drag each other [m]


@wp.struct
class Applying:
    """What the passes over pairs read and write of a particle itself."""

    dt: wp.array(dtype=float)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    volume: wp.array(dtype=float)
    rows: wp.array(dtype=wp.vec4)
    image: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.func
def near(num: Viscous, other: floats(DIRECTION), r2: float):
    """V_j w(r)"""
    return other[3] * weight(wp.sqrt(r2) / num.support, num.support)


@wp.func
def fullness_pair(num: Viscous, own: floats(DIRECTION + 4), other: floats(DIRECTION), r: wp.vec3):
    r2 = wp.dot(r, r)
    return vec1(near(num, other, r2) * r2 / 3.0)


@wp.func
def fullness_finish(num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: vec1):
    store_vec4(data.rows, 3 * i + 2, wp.vec4(1.0 / wp.sqrt(wp.max(sums[0], EMPTIEST)), 1.0, 1.0, 1.0))


@wp.func
def seen(box: Box, data: Applying, row: floats(DIRECTION), j: int, code: int):
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
        if face_kind(box, code, axis) == STICK:
            row[9 + axis] = -row[9 + axis]
    return row


@wp.func
def pull_of(num: Viscous, own: floats(DIRECTION + 4), other: floats(DIRECTION), r: wp.vec3, u: wp.vec3):
    """What j does to i while they move apart at u, twice over."""
    s = wp.vec3(other[9] * r[0], other[10] * r[1], other[11] * r[2])
    drag = own[8] * other[8] * dragging(shared(own[7], other[7]), wp.dot(r, r), num.support, other[3])
    return -drag * (wp.dot(r, u) * r + wp.dot(s, u) * s)


@wp.func
def pair(num: Viscous, own: floats(DIRECTION + 4), other: floats(DIRECTION), r: wp.vec3):
    return pull_of(num, own, other, r, wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6]))


@wp.func
def finish(num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: wp.vec3):
    image = wp.vec3(0.0, 0.0, 0.0)
    if data.held[i] == FREE:
        image = wp.vec3(own[4], own[5], own[6]) - (data.dt[world] / rest_density(data.mass, data.volume, i)) * sums
    data.image[i] = image


@wp.func
def dragged(data: Applying, world: int, i: int, x: wp.vec3, viscosity: float, thin: float, v: wp.vec3):
    """What a rigid body takes from a velocity relative to it, in a step (tool_map.py)."""
    found = felt(data.tool, x)
    rest = rest_density(data.mass, data.volume, i)
    return (10.0 * data.dt[world] * viscosity * thin * thin / rest) * (found.drag * v)


@wp.func
def tooled_fullness_finish(
    num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: vec1
):
    total = sums[0] + felt(data.tool, wp.vec3(own[0], own[1], own[2])).full
    store_vec4(data.rows, 3 * i + 2, wp.vec4(1.0 / wp.sqrt(wp.max(total, EMPTIEST)), 1.0, 1.0, 1.0))


@wp.func
def tooled_finish(
    num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: wp.vec3
):
    image = wp.vec3(0.0, 0.0, 0.0)
    if data.held[i] == FREE:
        v = wp.vec3(own[4], own[5], own[6])
        image = v - (data.dt[world] / rest_density(data.mass, data.volume, i)) * sums
        image += dragged(data, world, i, wp.vec3(own[0], own[1], own[2]), own[7], own[8], v)
    data.image[i] = image


@wp.kernel
def take_along(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    data: Applying,
    # outputs
    aim: wp.array(dtype=wp.vec3),
    driven: wp.array(dtype=wp.vec3),
):
    """What a rigid body's own velocity adds to v*."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and data.held[i] == FREE:
        row = load_vec4(data.rows, 3 * i)
        viscosity = load_vec4(data.rows, 3 * i + 1)[3]
        thin = load_vec4(data.rows, 3 * i + 2)[0]
        x = wp.vec3(row[0], row[1], row[2])
        driven[i] = dragged(data, world, i, x, viscosity, thin, data.tool.pose.velocity[0])
        aim[i] = aim[i] + driven[i]


@wp.kernel
def hand_on(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    data: Applying,
    driven: wp.array(dtype=wp.vec3),
    impulse: int,
    # outputs
    drag: wp.array(dtype=wp.vec3),
    target: wp.array(dtype=wp.vec3),
):
    """The same, to what is handed on."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and data.held[i] == FREE:
        change = driven[i]
        drag[i] = drag[i] + change / data.dt[world]
        if impulse == 0:
            change = change / data.dt[world]
        target[i] = target[i] + change


@wp.func
def seen_growing(box: Box, data: Applying, row: floats(DIRECTION), j: int, code: int):
    for axis in range(3):
        if face_kind(box, code, axis) == STICK:
            row[9 + axis] = -row[9 + axis]
    return row


@wp.func
def growing_pair(num: Viscous, own: floats(DIRECTION + 4), other: floats(DIRECTION), r: wp.vec3):
    return pull_of(num, own, other, r, ((own[4] + other[4]) / 6.0) * r)


@wp.func
def growing_finish(
    num: Viscous, box: Box, data: Applying, world: int, i: int, own: floats(DIRECTION + 4), sums: wp.vec3
):
    if data.held[i] == FREE:
        data.image[i] = data.image[i] + (data.dt[world] / rest_density(data.mass, data.volume, i)) * sums


@wp.func
def resistance(phase: Phase, elastic: int, kept: float, h: float):
    """Newtonian viscosity and, where elastic stress is implicit, what the strain of a step h adds to it [Pa s]: the
    share of G h that flow keeps. Where nothing flows that is doubled: the stress that is known pulls by corrected
    gradients, stiffer at surfaces than pairs are, and a step holds as long as that is no more than twice as stiff as
    what is solved for. Volume that a solid resists beyond shear needs more: a third of K + 4/3 G, for pairs resist a
    change of length three times as much as shear."""
    viscosity = phase.viscosity
    if elastic == 1:
        modulus = kept * phase.shear_modulus
        if is_solid(phase):
            modulus = wp.max(modulus, (phase.bulk_modulus + 4.0 / 3.0 * phase.shear_modulus) / 3.0)
        if kept == 1.0:
            modulus *= 2.0
        viscosity += h * modulus
    return viscosity


@wp.kernel
def open_solve(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    acceleration: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    drag: wp.array(dtype=wp.vec3),
    elastic: int,
    kept: wp.array(dtype=float),
    impulse: int,
    # outputs
    aim: wp.array(dtype=wp.vec3),
    trial: wp.array(dtype=wp.vec3),
    rows: wp.array(dtype=wp.vec4),
):
    """v*, and the first guess as the first direction. Pairs of what has moved by v* dt already are as they were before:
    then v dt from there, whatever v will be, keeps angular momentum."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        x = position[i] - float(impulse) * dt[world] * velocity[i]
        given = velocity[i]
        guess = velocity[i]
        if held[i] == FREE:
            given += dt[world] * acceleration[i]
            guess = given + dt[world] * drag[i]
        aim[i] = given
        trial[i] = guess
        viscosity = resistance(phases[world, phase_of[i]], elastic, kept[i], dt[world])
        store_vec4(rows, 3 * i, wp.vec4(x[0], x[1], x[2], volume[i]))
        store_vec4(rows, 3 * i + 1, wp.vec4(guess[0], guess[1], guess[2], viscosity))


@wp.kernel
def give_growth(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    growth: wp.array(dtype=float),
    # outputs
    rows: wp.array(dtype=wp.vec4),
):
    """Rows with the rate of growth in place of the direction."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        viscosity = load_vec4(rows, 3 * i + 1)[3]
        store_vec4(rows, 3 * i + 1, wp.vec4(growth[i], 0.0, 0.0, viscosity))


@wp.kernel
def close_solve(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    aim: wp.array(dtype=wp.vec3),
    trial: wp.array(dtype=wp.vec3),
    residual: wp.array(dtype=wp.vec3),
    impulse: int,
    # outputs
    drag: wp.array(dtype=wp.vec3),
    target: wp.array(dtype=wp.vec3),
):
    """The viscous acceleration, and what it makes of accelerations or, as an impulse, of velocities. It is that of the
    forces between pairs at the velocity found, v* - (K v - v): what the residual adds keeps momentum and angular
    momentum whatever the first guess and the tolerance."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        change = trial[i] + residual[i] - aim[i]
        drag[i] = change / dt[world]
        if impulse == 0:
            change = change / dt[world]
        target[i] = target[i] + change


@cache
def passes(tooled: bool, cpu: bool) -> SimpleNamespace:
    """The kernels for one kind of device, beside a rigid body or without one."""
    name, ends = ("tooled_", (tooled_fullness_finish, tooled_finish)) if tooled else ("", (fullness_finish, finish))
    fullness = Pass(Viscous, Applying, DIRECTION, 1, fullness_pair, ends[0]).compiled(f"viscous_{name}fullness", cpu)
    image = Pass(Viscous, Applying, DIRECTION, 3, pair, ends[1], seen=seen).compiled(f"viscous_{name}image", cpu)
    growing = Pass(Viscous, Applying, DIRECTION, 3, growing_pair, growing_finish, seen=seen_growing)
    own = (open_solve, give_growth, *KERNELS, close_solve, *((take_along, hand_on) if tooled else ()))
    kernels = {kernel.key: kernel for kernel in own}
    return SimpleNamespace(fullness=fullness, image=image, growing=growing.compiled("viscous_growing", cpu), **kernels)
