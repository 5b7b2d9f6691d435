"""Bonds of solids in PBD, in Taichi: the passes of bonds.py with the same arguments, written anew."""

from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.scene import PERIODIC, SLIP, STICK

from ..images import INDEX_BITS, INDEX_MASK
from ..neighbours_taichi import BoxT, ListsT, digit, face_kind, image_position
from ..taichi_bridge import Floats, Ints, Phases, Vectors, is_solid, phase_at, taichi_func, ti, vec3
from . import laws
from .bonds import ANCHORED, BOUND, DAMPED, FAULT_BONDS, FRESH, GELLED, LOOSE, REACH, ROOM

bond_stiffness = taichi_func(laws.bond_stiffness)


@ti.func
def bonded(phase):
    """Whether bonds hold the material: what never flows, and what has gelled while it cures."""
    return is_solid(phase) or (phase.cure >= GELLED and phase.shear_modulus > 0.0)


@ti.func
def youngs_between(a, b):
    """Young's modulus of a bond [Pa]: the mean of both ends' E = 9 K G / (3 K + G)."""
    first = 9.0 * a.shear_modulus / (3.0 + a.shear_modulus / a.bulk_modulus)
    second = 9.0 * b.shear_modulus / (3.0 + b.shear_modulus / b.bulk_modulus)
    return 0.5 * (first + second)


@ti.func
def way_between(box, x, other, code):
    """From the image of the other end to x [m], by the shortest way round periodic axes."""
    r = x - image_position(box, other, code)
    for axis in ti.static(range(3)):
        if box.lower_kind[axis] == PERIODIC:
            length = box.upper[axis] - box.lower[axis]
            r[axis] -= length * ti.round(r[axis] / length)
    return r


@ti.func
def holding(box, code):
    """The code's images in slip walls alone; -1 where it names a wall that does not hold."""
    out, valid = 0, True
    for axis in ti.static(range(3)):
        kind = face_kind(box, code, axis)
        if kind == SLIP:
            out += 3**axis * digit(code, axis)
        elif kind != PERIODIC:
            valid = False
    return out if valid else -1


@ti.kernel
def awaken(
    box: BoxT,
    spacing: float,
    capacity: int,
    count: Ints,
    phases: Phases,
    phase_of: Ints,
    position: Vectors,
    number: Ints,
    partner: Ints,
    rest: Floats,
    multiplier: Floats,
    state: Ints,
    held: Ints,
    velocity: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            if bonded(phase_at(phases, world, phase_of[i])):
                if state[i] == FRESH:
                    state[i] = BOUND
                elif state[i] == LOOSE and held[i] != CARRIED:
                    state[i] = FRESH
                    stuck = False
                    for axis in ti.static(range(3)):
                        above, below = position[i][axis] - box.lower[axis], box.upper[axis] - position[i][axis]
                        if box.lower_kind[axis] == STICK and above < ANCHORED * spacing:
                            stuck = True
                        if box.upper_kind[axis] == STICK and below < ANCHORED * spacing:
                            stuck = True
                    if stuck and held[i] == FREE:
                        held[i], velocity[i] = CLAMPED, vec3(0.0)


@ti.func
def add_bond(
    i, other, length, number: ti.template(), partner: ti.template(), rest: ti.template(), fault: ti.template()
):
    k = ti.atomic_add(number[i], 1)
    if k < ROOM:
        partner[k * number.shape[0] + i] = other
        rest[k * number.shape[0] + i] = length
    else:
        ti.atomic_add(number[i], -1)
        ti.atomic_or(fault[0], FAULT_BONDS)


@ti.kernel
def bind(
    box: BoxT,
    spacing: float,
    lists: ListsT,
    entries: Ints,
    listed: Ints,
    inside: Ints,
    capacity: int,
    count: Ints,
    position: Vectors,
    number: Ints,
    partner: Ints,
    rest: Floats,
    multiplier: Floats,
    state: Ints,
    fault: Ints,
):
    for i in range(position.shape[0]):
        if i % capacity < count[i // capacity] and state[i] == FRESH:
            for k in range(listed[i]):
                entry = entries[i * lists.row + k * lists.column]
                j, code = entry & INDEX_MASK, holding(box, entry >> INDEX_BITS)
                if state[j] != LOOSE and code >= 0 and entry != i:
                    length = way_between(box, position[i], position[j], code).norm()
                    if length < REACH * spacing:
                        add_bond(i, j | (code << INDEX_BITS), length, number, partner, rest, fault)
                        if state[j] == BOUND:
                            add_bond(j, i | (code << INDEX_BITS), length, number, partner, rest, fault)


@ti.kernel
def stretch(
    threads: int,
    box: BoxT,
    spacing: float,
    sweep: int,
    capacity: int,
    count: Ints,
    dt: Floats,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    position: Vectors,
    mass: Floats,
    number: Ints,
    partner: Ints,
    rest: Floats,
    multiplier: Floats,
    state: Ints,
    correction: Vectors,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            phase = phase_at(phases, world, phase_of[i])
            own = 1.0 / mass[i] if held[i] == FREE else 0.0
            shift = vec3(0.0)
            for k in range(number[i]):
                at = k * number.shape[0] + i
                j = partner[at] & INDEX_MASK
                other = 1.0 / mass[j] if held[j] == FREE else 0.0
                r = way_between(box, position[i], position[j], partner[at] >> INDEX_BITS)
                youngs = youngs_between(phase, phase_at(phases, world, phase_of[j]))
                compliance = 1.0 / (bond_stiffness(youngs, spacing, rest[at]) * dt[world] * dt[world])
                before = multiplier[at] if sweep > 0 else 0.0
                length = r.norm()
                step = -DAMPED * (length - rest[at] + compliance * before) / (own + other + compliance)
                multiplier[at] = before + step
                shift += own * step / ti.max(length, 1.0e-9) * r
            correction[i] = shift


@ti.kernel
def yield_bonds(
    capacity: int,
    count: Ints,
    box: BoxT,
    phases: Phases,
    phase_of: Ints,
    position: Vectors,
    number: Ints,
    partner: Ints,
    rest: Floats,
    multiplier: Floats,
    state: Ints,
):
    for i in range(position.shape[0]):
        world = i // capacity
        if i - world * capacity < count[world]:
            own = phase_at(phases, world, phase_of[i])
            for k in range(number[i]):
                at = k * number.shape[0] + i
                j = partner[at] & INDEX_MASK
                other = phase_at(phases, world, phase_of[j])
                stress = 0.5 * (own.yield_stress + other.yield_stress)
                strain = ti.sqrt(3.0) * stress / youngs_between(own, other)
                length = way_between(box, position[i], position[j], partner[at] >> INDEX_BITS).norm()
                longest = length / ti.max(1.0 - strain, 0.1)
                rest[at] = ti.min(ti.max(rest[at], length / (1.0 + strain)), longest)


PASSES = SimpleNamespace(awaken=awaken, bind=bind, stretch=stretch, yield_bonds=yield_bonds)
