"""Position-based fluids in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same
equations."""

from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import FRICTION, PERIODIC, STICK

from ..corrected_taichi import elastic_stress, mirrored_stress, symmetric_inverse
from ..flow_taichi import strained
from ..neighbours import INDEX_BITS, INDEX_MASK, WALL_INSET
from ..neighbours_taichi import BoxT, ListsT, contained, image_position, image_velocity
from ..smoothing import poly6, spiky, spiky_slope
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Matrices,
    Phases,
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
)
from . import laws
from .bonds_taichi import bonded
from .kernels_warp import FARTHEST, HURRIED, SLACK, SLACK_SOLID, Numbers

kernel = taichi_func(poly6)
summed = taichi_func(spiky)
gradient = taichi_func(spiky_slope)
smoothing_weight = taichi_func(laws.smoothing_weight, laws.largest_viscosity)
conveyed_modulus = taichi_func(laws.conveyed_modulus, laws.largest_modulus)
NumbersT = struct_of(Numbers)


@ti.func
def kept_inside(box, free, inset):
    """A position in front of the walls, and how far they have moved it; a periodic wrap is no motion."""
    inside = contained(box, free, inset)
    back = inside - free
    for axis in ti.static(range(3)):
        if box.lower_kind[axis] == PERIODIC:
            back[axis] = 0.0
    return inside, back


@ti.func
def seen(box, position: ti.template(), entry):
    """Where the neighbour of a list's entry is, as it is seen in the walls."""
    x, code = position[entry & INDEX_MASK], entry >> INDEX_BITS
    if code > 0:
        x = image_position(box, x, code)
    return x


@ti.func
def seen_moving(box, velocity: ti.template(), entry):
    """The neighbour's velocity, likewise."""
    v, code = velocity[entry & INDEX_MASK], entry >> INDEX_BITS
    if code > 0:
        v = image_velocity(box, v, code)
    return v


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
    position: Vectors,
    motion: Vectors,
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


@ti.kernel
def multipliers(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    capacity: int,
    count: Ints,
    phases: Phases,
    phase_of: Ints,
    position: Vectors,
    volume: Floats,
    multiplier: Floats,
    fill: Floats,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            dense = 0.5 * (volume[i] + num.spacing**3) * summed(0.0, num.support)
            total, squares = vec3(0.0), 0.0
            for k in range(number[i]):
                entry = entries[i * lists.row + k * lists.column]
                share = volume[entry & INDEX_MASK]
                r = position[i] - seen(box, position, entry)
                distance = r.norm()
                dense += share * summed(distance, num.support)
                g = share * num.weight * gradient(distance, num.support) / ti.max(distance, 1.0e-9) * r
                total += g
                squares += g.norm_sqr()
            fill[i] = num.weight * dense
            limit = 1.0 + (SLACK_SOLID if bonded(phase_at(phases, world, phase_of[i])) else SLACK)
            metric = (squares + total.norm_sqr()) * num.spacing * num.spacing
            multiplier[i] = -ti.max(num.weight * dense - limit, 0.0) / (metric + num.relaxation)


@ti.kernel
def correct(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    capacity: int,
    count: Ints,
    held: Ints,
    position: Vectors,
    volume: Floats,
    multiplier: Floats,
    correction: Vectors,
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity] and held[i] == FREE:
            shift = vec3(0.0)
            for k in range(number[i]):
                entry = entries[i * lists.row + k * lists.column]
                j = entry & INDEX_MASK
                r = position[i] - seen(box, position, entry)
                g = volume[j] * num.weight * gradient(r.norm(), num.support) / ti.max(r.norm(), 1.0e-9)
                shift += (multiplier[i] + multiplier[j]) * g * r
            correction[i] = num.over_relaxation * num.spacing * num.spacing * shift


@ti.kernel
def apply(
    num: NumbersT,
    box: BoxT,
    capacity: int,
    count: Ints,
    held: Ints,
    correction: Vectors,
    position: Vectors,
    motion: Vectors,
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


@ti.kernel
def velocities(capacity: int, count: Ints, dt: Floats, held: Ints, motion: Vectors, velocity: Vectors):
    for i in range(velocity.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world] and held[i] == FREE:
            velocity[i] = motion[i] / dt[world]


@ti.kernel
def strain(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    position: Vectors,
    mass: Floats,
    volume: Floats,
    velocity: Vectors,
    elastic_normal: Vectors,
    elastic_shear: Vectors,
    stress: Matrices,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            phase = phase_at(phases, world, phase_of[i])
            carried = mat3(0.0)
            if not bonded(phase):
                l, moment = mat3(0.0), mat3(0.0)
                for k in range(number[i]):
                    entry = entries[i * lists.row + k * lists.column]
                    r = position[i] - seen(box, position, entry)
                    u = velocity[i] - seen_moving(box, velocity, entry)
                    g = volume[entry & INDEX_MASK] * gradient(r.norm(), num.support) / ti.max(r.norm(), 1.0e-9)
                    l -= g * u.outer_product(r)
                    moment -= g * r.outer_product(r)
                correction = symmetric_inverse(moment)
                l = l @ correction
                rest = rest_density(mass, volume, i)
                modulus = conveyed_modulus(phase.shear_modulus, num.stiffness, rest, num.spacing, dt[world])
                b, s = elastic_normal[i], elastic_shear[i]
                if held[i] != CARRIED:
                    b, s = strained(phase, modulus, l, b, s, dt[world])
                    elastic_normal[i], elastic_shear[i] = b, s
                carried = elastic_stress(modulus, b, s, 0.0) @ correction
            stress[i] = carried


@ti.kernel
def pull(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    capacity: int,
    count: Ints,
    dt: Floats,
    held: Ints,
    position: Vectors,
    mass: Floats,
    volume: Floats,
    stress: Matrices,
    velocity: Vectors,
    smoothed: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            v = velocity[i]
            a, damping = vec3(0.0), vec3(0.0)
            for k in range(number[i]):
                entry = entries[i * lists.row + k * lists.column]
                j, code = entry & INDEX_MASK, entry >> INDEX_BITS
                other = stress[j]
                if code > 0:
                    other = mirrored_stress(box, other, code)
                r = position[i] - seen(box, position, entry)
                u = v - seen_moving(box, velocity, entry)
                g = volume[j] * gradient(r.norm(), num.support) / ti.max(r.norm(), 1.0e-9)
                a += g * ((stress[i] + other) @ r)
                w = volume[j] * num.weight * kernel(r.norm_sqr(), num.support)
                damping -= w * u.dot(r) / ti.max(r.norm_sqr(), 1.0e-18) * r
            if held[i] == FREE:
                v += dt[world] / rest_density(mass, volume, i) * a + num.calm * damping
            smoothed[i] = v


@ti.kernel
def shear(
    num: NumbersT,
    box: BoxT,
    lists: ListsT,
    entries: Ints,
    number: Ints,
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    position: Vectors,
    mass: Floats,
    volume: Floats,
    velocity: Vectors,
    smoothed: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            v = velocity[i]
            if held[i] == FREE:
                difference, total = vec3(0.0), volume[i] * num.weight * kernel(0.0, num.support)
                for k in range(number[i]):
                    entry = entries[i * lists.row + k * lists.column]
                    r2 = (position[i] - seen(box, position, entry)).norm_sqr()
                    w = volume[entry & INDEX_MASK] * num.weight * kernel(r2, num.support)
                    difference += w * (seen_moving(box, velocity, entry) - v)
                    total += w
                viscosity = phase_at(phases, world, phase_of[i]).viscosity
                rest = rest_density(mass, volume, i)
                c = smoothing_weight(viscosity, rest, dt[world], num.support, ti.cast(num.sweeps, ti.f32))
                v += c / ti.max(total, 1.0) * difference
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
    strain=strain,
    pull=pull,
    shear=shear,
    wall_friction=wall_friction,
)
