"""Viscosity implicit in time, in Taichi: the kernels of viscosity_warp.py with the same arguments, written anew from
the same equations (viscosity.py)."""

from types import SimpleNamespace

from fluidbench.method.frame import FREE
from fluidbench.native.scene import STICK

from .conjugate_taichi import KERNELS
from .neighbours_taichi import BoxT, ListsT, face_kind, image_velocity
from .pairs_taichi import over_pairs, reader, vector_at, vector_into
from .smoothing import drag_tail, drag_weight, pair_drag, shared_viscosity
from .taichi_bridge import (
    Floats,
    Ints,
    Phases,
    Quads,
    Vectors,
    is_solid,
    phase_at,
    rest_density,
    struct_of,
    taichi_func,
    ti,
    vec3,
    vec4,
)
from .viscosity_warp import DIRECTION, EMPTIEST, Viscous

ViscousT = struct_of(Viscous)
weight = taichi_func(drag_weight, drag_tail)
dragging, shared = taichi_func(pair_drag, drag_tail), taichi_func(shared_viscosity)
direction_at = reader(DIRECTION)


@ti.func
def near(num, other, r2):
    return other[3] * weight(ti.sqrt(r2) / num.support, num.support)


@ti.func
def fullness_pair(num, own, begun, other, r):
    r2 = r.norm_sqr()
    return ti.Vector([near(num, other, r2) * r2 / 3.0])


@ti.func
def seen(box, extra: ti.template(), row, j, code):
    out = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
    for axis in ti.static(range(3)):
        if face_kind(box, code, axis) == STICK:
            out[9 + axis] = -out[9 + axis]
    return out


@ti.func
def seen_growing(box, extra: ti.template(), row, j, code):
    out = row
    for axis in ti.static(range(3)):
        if face_kind(box, code, axis) == STICK:
            out[9 + axis] = -out[9 + axis]
    return out


@ti.func
def pull_of(num, own, other, r, u):
    """What j does to i while they move apart at u, twice over."""
    s = vector_at(other, 9) * r
    drag = own[8] * other[8] * dragging(shared(own[7], other[7]), r.norm_sqr(), num.support, other[3])
    return -drag * (r.dot(u) * r + s.dot(u) * s)


@ti.func
def pair(num, own, begun, other, r):
    return pull_of(num, own, other, r, vector_at(own, 4) - vector_at(other, 4))


@ti.func
def growing_pair(num, own, begun, other, r):
    return pull_of(num, own, other, r, (own[4] + other[4]) / 6.0 * r)


summed_over = over_pairs(DIRECTION, 3, pair, seen)
growing_over = over_pairs(DIRECTION, 3, growing_pair, seen_growing)
fullness_over = over_pairs(DIRECTION, 1, fullness_pair)


@ti.kernel
def fullness(
    num: ViscousT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    held: Ints,
    mass: Floats,
    volume: Floats,
    written: Quads,
    found: Vectors,
):
    for i in range(held.shape[0]):
        if i % capacity < count[i // capacity]:
            own = direction_at(rows, i)
            sums = fullness_over(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
            written[3 * i + 2] = vec4(1.0 / ti.sqrt(ti.max(sums[0], EMPTIEST)), 1.0, 1.0, 1.0)


@ti.kernel
def image(
    num: ViscousT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    held: Ints,
    mass: Floats,
    volume: Floats,
    written: Quads,
    found: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            out = vec3(0.0)
            if held[i] == FREE:
                own = direction_at(rows, i)
                sums = summed_over(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                out = vector_at(own, 4) - dt[world] / rest_density(mass, volume, i) * sums
            found[i] = out


@ti.kernel
def growing(
    num: ViscousT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    held: Ints,
    mass: Floats,
    volume: Floats,
    written: Quads,
    found: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            own = direction_at(rows, i)
            sums = growing_over(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
            found[i] += dt[world] / rest_density(mass, volume, i) * sums


@ti.func
def resistance(phase, elastic, kept, h):
    """See viscosity_warp.py."""
    modulus = kept * phase.shear_modulus
    if is_solid(phase):
        modulus = ti.max(modulus, (phase.bulk_modulus + 4.0 / 3.0 * phase.shear_modulus) / 3.0)
    if kept == 1.0:
        modulus *= 2.0
    return phase.viscosity + ti.select(elastic == 1, h * modulus, 0.0)


@ti.kernel
def open_solve(
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    position: Vectors,
    velocity: Vectors,
    acceleration: Vectors,
    volume: Floats,
    drag: Vectors,
    elastic: int,
    kept: Floats,
    impulse: int,
    aim: Vectors,
    trial: Vectors,
    rows: Quads,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            x, given, guess = position[i] - impulse * dt[world] * velocity[i], velocity[i], velocity[i]
            if held[i] == FREE:
                given += dt[world] * acceleration[i]
                guess = given + dt[world] * drag[i]
            aim[i], trial[i] = given, guess
            viscosity = resistance(phase_at(phases, world, phase_of[i]), elastic, kept[i], dt[world])
            rows[3 * i] = vec4(x[0], x[1], x[2], volume[i])
            rows[3 * i + 1] = vec4(guess[0], guess[1], guess[2], viscosity)


@ti.kernel
def give_growth(capacity: int, count: Ints, growth: Floats, rows: Quads):
    for i in range(growth.shape[0]):
        if i % capacity < count[i // capacity]:
            rows[3 * i + 1] = vec4(growth[i], 0.0, 0.0, rows[3 * i + 1][3])


@ti.kernel
def close_solve(
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    aim: Vectors,
    trial: Vectors,
    residual: Vectors,
    impulse: int,
    drag: Vectors,
    target: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            change = trial[i] + residual[i] - aim[i]
            drag[i] = change / dt[world]
            if impulse == 0:
                change /= dt[world]
            target[i] += change


PASSES = SimpleNamespace(
    fullness=fullness,
    image=image,
    growing=growing,
    open_solve=open_solve,
    give_growth=give_growth,
    **KERNELS,
    close_solve=close_solve,
)
