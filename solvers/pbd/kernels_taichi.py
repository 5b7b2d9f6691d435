"""Position-based fluids in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from ..corrected_taichi import elastic_stress, mirrored_stress, symmetric_inverse
from ..flow_taichi import strained
from ..images import WALL_INSET
from ..neighbours_taichi import BoxT, ListsT, contained, image_velocity
from ..pairs_taichi import (
    matrix_into,
    over_pairs,
    reader,
    stressed,
    symmetric_at,
    vector_at,
    vector_into,
    writer,
)
from ..smoothing import poly6, spiky, spiky_slope
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Phases,
    Quads,
    Vectors,
    beyond,
    force_at,
    mat3,
    phase_at,
    rest_density,
    struct_of,
    taichi_func,
    ti,
    too_fast,
    vec3,
    vec4,
)
from . import laws
from .bonds_taichi import bonded
from .kernels_warp import FARTHEST, HURRIED, MOVING, PLACE, PULLING, PUSH, SLACK, SLACK_SOLID, Numbers

kernel = taichi_func(poly6)
summed = taichi_func(spiky)
gradient = taichi_func(spiky_slope)
conveyed_modulus = taichi_func(laws.conveyed_modulus, laws.largest_modulus)
NumbersT = struct_of(Numbers)
place_of, push_of, moving_of, pulling_of = (reader(n) for n in (PLACE, PUSH, MOVING, PULLING))
write_pulling = writer(PULLING)


@ti.func
def kept_inside(box, free, inset):
    """A position in front of the walls, and how far they have moved it; a periodic wrap is no motion."""
    inside = contained(box, free, inset)
    back = inside - free
    for axis in ti.static(range(3)):
        if box.lower_kind[axis] == PERIODIC:
            back[axis] = 0.0
    return inside, back


@ti.kernel
def predict(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    force: Forces,
    held: Ints,
    velocity: Vectors,
    volume: Floats,
    position: Vectors,
    motion: Vectors,
    places: Quads,
    fault: Ints,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            v = velocity[i]
            if held[i] == FREE:
                v += dt[world] * force_at(force, world, position[i])
            free = position[i] + dt[world] * v
            if too_fast(v, HURRIED * box.top_speed):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x, back = kept_inside(box, free, WALL_INSET * num.spacing)
            position[i], motion[i] = x, dt[world] * v + back
            places[i] = vec4(x[0], x[1], x[2], volume[i])


@ti.func
def sharing(num, other, r):
    """The gradient of the density that a neighbour brings, over its kernel's normalisation."""
    return other[3] * gradient(r.norm(), num.support) / ti.max(r.norm(), 1.0e-9) * r


@ti.func
def multiplier_pair(num, own, begun, other, r):
    g = num.weight * sharing(num, other, r)
    sums = ti.Vector.zero(ti.f32, 5)
    sums[0], sums[4] = other[3] * summed(r.norm(), num.support), g.norm_sqr()
    return vector_into(sums, 1, g)


constrained_by = over_pairs(PLACE, 5, multiplier_pair)


@ti.kernel
def multipliers(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    places: Quads,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    pushes: Quads,
    fill: Floats,
    correction: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            own = place_of(places, i)
            sums = constrained_by(num, box, lists, entries, number, places, held, i, own, vec4(0.0))
            dense = num.weight * (sums[0] + 0.5 * (own[3] + num.spacing**3) * summed(0.0, num.support))
            fill[i] = dense
            limit = 1.0 + (SLACK_SOLID if bonded(phase_at(phases, world, phase_of[i])) else SLACK)
            metric = (sums[4] + vector_at(sums, 1).norm_sqr()) * num.spacing * num.spacing
            pushes[2 * i] = places[i]
            pushes[2 * i + 1] = vec4(-ti.max(dense - limit, 0.0) / (metric + num.relaxation), 0.0, 0.0, 0.0)


@ti.func
def correct_pair(num, own, begun, other, r):
    return (own[4] + other[4]) * num.weight * sharing(num, other, r)


corrected_by = over_pairs(PUSH, 3, correct_pair)


@ti.kernel
def correct(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    pushes: Quads,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    pushed: Quads,
    fill: Floats,
    correction: Vectors,
):
    for i in range(held.shape[0]):
        if i % capacity < count[i // capacity] and held[i] == FREE:
            own = push_of(pushes, i)
            shift = corrected_by(num, box, lists, entries, number, pushes, held, i, own, vec4(0.0))
            correction[i] = num.over_relaxation * num.spacing * num.spacing * shift


@ti.kernel
def apply(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    held: Ints,
    correction: Vectors,
    volume: Floats,
    position: Vectors,
    motion: Vectors,
    places: Quads,
    fault: Ints,
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity] and held[i] == FREE:
            shift = correction[i]
            limit = 0.25 * num.spacing
            wanted = shift.norm()
            if shift.norm() > limit:
                shift *= limit / shift.norm()
            free = position[i] + shift
            if beyond(wanted, FARTHEST * num.spacing):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
            x, back = kept_inside(box, free, WALL_INSET * num.spacing)
            position[i] = x
            motion[i] += shift + back
            places[i] = vec4(x[0], x[1], x[2], volume[i])


@ti.kernel
def velocities(capacity: int, count: Ints, dt: Floats, held: Ints, motion: Vectors, velocity: Vectors):
    for i in range(velocity.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            velocity[i] = motion[i] / dt[world]


@ti.kernel
def follow(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    velocity: Vectors,
    motion: Vectors,
    position: Vectors,
):
    for i in range(velocity.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            free = position[i] + (dt[world] * velocity[i] - motion[i])
            position[i] = contained(box, free, WALL_INSET * num.spacing)


@ti.kernel
def pack(capacity: int, count: Ints, position: Vectors, volume: Floats, velocity: Vectors, moving: Quads):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity]:
            x, v = position[i], velocity[i]
            moving[2 * i] = vec4(x[0], x[1], x[2], volume[i])
            moving[2 * i + 1] = vec4(v[0], v[1], v[2], 0.0)


@ti.kernel
def settle(capacity: int, count: Ints, smoothed: Vectors, velocity: Vectors, moving: Quads):
    for i in range(velocity.shape[0]):
        if i % capacity < count[i // capacity]:
            v = smoothed[i]
            velocity[i] = v
            moving[2 * i + 1] = vec4(v[0], v[1], v[2], 0.0)


@ti.func
def moving_seen(box, extra: ti.template(), row, j, code):
    return vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))


@ti.func
def pulling_seen(box, extra: ti.template(), row, j, code):
    moved = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
    return matrix_into(moved, 7, mirrored_stress(box, stressed(row, 7), code))


@ti.func
def strain_pair(num, own, begun, other, r):
    g = sharing(num, other, r)
    square = -g.outer_product(r)
    sums = matrix_into(ti.Vector.zero(ti.f32, 15), 0, -(vector_at(own, 4) - vector_at(other, 4)).outer_product(g))
    sums = vector_into(sums, 9, vec3(square[0, 0], square[1, 1], square[2, 2]))
    return vector_into(sums, 12, vec3(square[0, 1], square[0, 2], square[1, 2]))


strained_by = over_pairs(MOVING, 15, strain_pair, moving_seen)


@ti.kernel
def strain(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    volume: Floats,
    elastic_normal: Vectors,
    elastic_shear: Vectors,
    pulling: Quads,
    smoothed: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            phase = phase_at(phases, world, phase_of[i])
            own = moving_of(rows, i)
            carried = mat3(0.0)
            if not bonded(phase):
                sums = strained_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                correction = symmetric_inverse(symmetric_at(sums, 9))
                rest = rest_density(mass, volume, i)
                modulus = conveyed_modulus(phase.shear_modulus, num.stiffness, rest, num.spacing, dt[world])
                b, s = elastic_normal[i], elastic_shear[i]
                if held[i] != CARRIED:
                    b, s, _ = strained(phase, modulus, stressed(sums, 0) @ correction, b, s, dt[world])
                    elastic_normal[i], elastic_shear[i] = b, s
                carried = elastic_stress(modulus, b, s, 0.0) @ correction
            row = ti.Vector.zero(ti.f32, PULLING)
            for c in ti.static(range(7)):
                row[c] = own[c]
            write_pulling(pulling, i, matrix_into(row, 7, carried))


@ti.func
def pull_pair(num, own, begun, other, r):
    a = (stressed(own, 7) + stressed(other, 7)) @ sharing(num, other, r)
    u = vector_at(own, 4) - vector_at(other, 4)
    w = other[3] * num.weight * kernel(r.norm_sqr(), num.support)
    damping = -w * u.dot(r) / ti.max(r.norm_sqr(), 1.0e-18) * r
    return vector_into(vector_into(ti.Vector.zero(ti.f32, 6), 0, a), 3, damping)


pulled_by = over_pairs(PULLING, 6, pull_pair, pulling_seen)


@ti.kernel
def pull(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    rows: Quads,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    mass: Floats,
    volume: Floats,
    elastic_normal: Vectors,
    elastic_shear: Vectors,
    pulling: Quads,
    smoothed: Vectors,
):
    for i in range(held.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            own = pulling_of(rows, i)
            v = vector_at(own, 4)
            if held[i] == FREE:
                sums = pulled_by(num, box, lists, entries, number, rows, held, i, own, vec4(0.0))
                v += dt[world] / rest_density(mass, volume, i) * vector_at(sums, 0) + num.calm * vector_at(sums, 3)
            smoothed[i] = v


@ti.func
def wall_friction_acts(kind, gap, spacing, solid):
    """Whether a particle this far from a face feels its friction."""
    return gap < spacing and (kind == FRICTION or (kind == STICK and solid))


@ti.kernel
def wall_friction(
    box: BoxT,
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    spacing: float,
    phases: Phases,
    phase_of: Ints,
    force: Forces,
    position: Vectors,
    velocity: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            v, x = velocity[i], position[i]
            solid = bonded(phase_at(phases, world, phase_of[i]))
            weight = force_at(force, world, x)
            for axis in ti.static(range(3)):
                low = wall_friction_acts(box.lower_kind[axis], x[axis] - box.lower[axis], spacing, solid)
                high = wall_friction_acts(box.upper_kind[axis], box.upper[axis] - x[axis], spacing, solid)
                if low or high:
                    kind, friction = box.lower_kind[axis], box.lower_friction[axis]
                    if high:
                        kind, friction = box.upper_kind[axis], box.upper_friction[axis]
                    slide = v
                    slide[axis] = 0.0
                    speed = slide.norm()
                    lost = speed
                    if kind == FRICTION:
                        lost = ti.min(friction * ti.abs(weight[axis]) * dt[world], speed)
                    slide *= 1.0 - lost / ti.max(speed, 1.0e-12)
                    slide[axis] = v[axis]
                    v = slide
            velocity[i] = v


PASSES = SimpleNamespace(
    predict=predict,
    multipliers=multipliers,
    correct=correct,
    apply=apply,
    velocities=velocities,
    follow=follow,
    pack=pack,
    settle=settle,
    strain=strain,
    pull=pull,
    wall_friction=wall_friction,
)
