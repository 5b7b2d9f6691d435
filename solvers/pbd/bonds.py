"""Bonds that hold solids together in PBD: XPBD distance constraints (Macklin, Mueller & Chentanez 2016, MIG).

A particle bonds once, when it is first free to move, to the free particles around it, and for ever: lengths are taken
from that moment, in which bonds carry no stress. Central forces fix the Poisson ratio at 1/4 (see laws.bond_stiffness).
Entry k of particle i is at k * slots + i; mirror images in slip walls are bonded too, since such walls hold.
"""

from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.scene import PERIODIC, SLIP, STICK, Box, Phase, Scene, is_solid
from fluidbench.native.vector_access import joined

from ..bind import warp_func
from ..images import INDEX_BITS, INDEX_MASK, face_kind, image_code, image_position
from ..search import Lists, place_of
from . import laws

wp.set_module_options({"enable_backward": False, "fast_math": True})

bond_stiffness = warp_func(laws.bond_stiffness)

REACH = wp.constant(1.9)  # longest bond, over the spacing: the 26 nearest of a lattice
ROOM = wp.constant(48)  # bonds of a particle, at most
ANCHORED = wp.constant(0.75)  # what bonds closer than this to a stick wall is part of it, over the spacing
DAMPED = wp.constant(
    0.115
)  # share of a Jacobi step: 26 / 3 bonds pull each way, so that 3 / 26 is stable for all modes
GELLED = wp.constant(0.5)  # degree of cure from which bonds hold
FAULT_BONDS = 8
TEAM = 8  # threads of a GPU that share a particle's bonds
LOOSE, FRESH, BOUND = wp.constant(0), wp.constant(1), wp.constant(2)


@wp.struct
class Bonds:
    number: wp.array(dtype=int)
    partner: wp.array(dtype=int)  # slot in the low bits, mirror image code above, as in neighbour lists
    rest: wp.array(dtype=float)  # [m]
    multiplier: wp.array(dtype=float)  # of the present substep
    state: wp.array(dtype=int)


@wp.func
def bonded(phase: Phase):
    """Whether bonds hold the material: what never flows, and what has gelled while it cures."""
    return is_solid(phase) or (phase.cure >= GELLED and phase.shear_modulus > 0.0)


@wp.func
def youngs_between(a: Phase, b: Phase):
    """Young's modulus of a bond, the mean of both ends' E = 9 K G / (3 K + G) [Pa]: one bond, one force."""
    first = 9.0 * a.shear_modulus / (3.0 + a.shear_modulus / a.bulk_modulus)
    second = 9.0 * b.shear_modulus / (3.0 + b.shear_modulus / b.bulk_modulus)
    return 0.5 * (first + second)


def needed(scene: Scene) -> bool:
    """Whether anything is bonded, now or later."""
    return scene.solid or (scene.cures and scene.elastic)


@wp.func
def nearest_image(box: Box, r: wp.vec3):
    """A distance by the shortest way round periodic axes."""
    out = r
    for axis in range(3):
        if box.lower_kind[axis] == PERIODIC:
            length = box.upper[axis] - box.lower[axis]
            out[axis] = r[axis] - length * wp.round(r[axis] / length)
    return out


@wp.func
def mirrors_only(box: Box, code: int):
    """The code without its periodic shifts, which change when a particle wraps; -1 where a wall does not hold."""
    out = int(0)
    place = int(1)
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind == SLIP and out >= 0:
            out += place * image_code(code, axis)
        elif kind != PERIODIC:
            out = -1
        place *= 3
    return out


@wp.kernel
def awaken(
    share: wp.vec3i,
    box: Box,
    spacing: float,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    bonds: Bonds,
    # outputs
    held: wp.array(dtype=int),
    velocity: wp.array(dtype=wp.vec3),
):
    """Particles that have just come free may bond in this substep; those on a stick wall become part of it."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and bonded(phases[world, phase_of[i]]):
        state = bonds.state[i]
        if state == FRESH:
            bonds.state[i] = BOUND
        elif state == LOOSE and held[i] != CARRIED:
            bonds.state[i] = FRESH
            for axis in range(3):
                low = box.lower_kind[axis] == STICK and position[i][axis] - box.lower[axis] < ANCHORED * spacing
                high = box.upper_kind[axis] == STICK and box.upper[axis] - position[i][axis] < ANCHORED * spacing
                if (low or high) and held[i] == FREE:
                    held[i] = CLAMPED
                    velocity[i] = wp.vec3(0.0, 0.0, 0.0)


@wp.func
def add_bond(bonds: Bonds, i: int, partner: int, rest: float, fault: wp.array(dtype=int)):
    k = wp.atomic_add(bonds.number, i, 1)
    if k < ROOM:
        bonds.partner[k * bonds.number.shape[0] + i] = partner
        bonds.rest[k * bonds.number.shape[0] + i] = rest
    else:
        wp.atomic_add(bonds.number, i, -1)
        raise_fault(fault, FAULT_BONDS)


@wp.kernel
def bind(
    box: Box,
    spacing: float,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    bonds: Bonds,
    # outputs
    fault: wp.array(dtype=int),
):
    """Bond fresh particles to all that are free around them; an older partner is told."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and bonds.state[i] == FRESH:
        g = i / lists.group
        for k in range(lists.number[g]):
            entry = lists.entries[place_of(lists, g, k)]
            j = entry & INDEX_MASK
            code = mirrors_only(box, entry >> INDEX_BITS)
            if bonds.state[j] != LOOSE and code >= 0 and entry != i:
                # a list that others share may hold both a particle and its periodic image
                near = wp.length(position[i] - image_position(box, position[j], entry >> INDEX_BITS))
                if near < REACH * spacing:
                    rest = wp.length(nearest_image(box, position[i] - image_position(box, position[j], code)))
                    add_bond(bonds, i, j | (code << INDEX_BITS), rest, fault)
                    if bonds.state[j] == BOUND:
                        add_bond(bonds, j, i | (code << INDEX_BITS), rest, fault)


@wp.kernel
def stretch(
    share: wp.vec3i,
    threads: int,
    box: Box,
    spacing: float,
    sweep: int,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    bonds: Bonds,
    # outputs
    correction: wp.array(dtype=wp.vec3),
):
    """One damped Jacobi sweep over all bonds (eq. 18 of the paper); both ends of a bond compute the same multiplier.
    On a GPU `threads` share a particle."""
    thread = index_of(share, wp.tid())
    i = thread / threads
    member = thread - i * threads
    world = i / capacity
    active = i - world * capacity < count[world]
    shift = wp.vec3(0.0, 0.0, 0.0)
    if active:
        phase = phases[world, phase_of[i]]
        h = dt[world]
        own = float(0.0)
        if held[i] == FREE:
            own = 1.0 / mass[i]
        x = position[i]
        slots = bonds.number.shape[0]
        for k in range(member, bonds.number[i], threads):
            at = k * slots + i
            entry = bonds.partner[at]
            j = entry & INDEX_MASK
            other = float(0.0)
            if held[j] == FREE:
                other = 1.0 / mass[j]
            r = nearest_image(box, x - image_position(box, position[j], entry >> INDEX_BITS))
            length = wp.length(r)
            rest = bonds.rest[at]
            youngs = youngs_between(phase, phases[world, phase_of[j]])
            compliance = 1.0 / (bond_stiffness(youngs, spacing, rest) * h * h)
            before = float(0.0)
            if sweep > 0:
                before = bonds.multiplier[at]
            step = -DAMPED * (length - rest + compliance * before) / (own + other + compliance)
            bonds.multiplier[at] = before + step
            shift += (own * step / wp.max(length, 1.0e-9)) * r
    for axis in range(3):
        shift[axis] = joined(shift[axis], threads)
    if active and member == 0:
        correction[i] = shift


@wp.kernel
def relieve(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    box: Box,
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    due: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    bonds: Bonds,
):
    """Bonds of what stiffens keep their force: the rest length moves towards the present one as k / k'."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        for k in range(bonds.number[i]):
            at = k * bonds.number.shape[0] + i
            entry = bonds.partner[at]
            j = entry & INDEX_MASK
            if due[i] != phase_of[i] or due[j] != phase_of[j]:
                before = youngs_between(phases[world, phase_of[i]], phases[world, phase_of[j]])
                after = youngs_between(phases[world, due[i]], phases[world, due[j]])
                r = position[i] - image_position(box, position[j], entry >> INDEX_BITS)
                length = wp.length(nearest_image(box, r))
                bonds.rest[at] = length - (before / after) * (length - bonds.rest[at])


@wp.kernel
def yield_bonds(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    box: Box,
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    bonds: Bonds,
):
    """Perfect plasticity: a bond stretched or shortened beyond the yield strain takes on the length that it has, but
    for that strain. In uniaxial stress it is sqrt(3) tau_y / E."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        for k in range(bonds.number[i]):
            at = k * bonds.number.shape[0] + i
            entry = bonds.partner[at]
            j = entry & INDEX_MASK
            own, other = phases[world, phase_of[i]], phases[world, phase_of[j]]
            stress = 0.5 * (own.yield_stress + other.yield_stress)
            limit = wp.sqrt(3.0) * stress / youngs_between(own, other)
            r = position[i] - image_position(box, position[j], entry >> INDEX_BITS)
            length = wp.length(nearest_image(box, r))
            bonds.rest[at] = wp.clamp(bonds.rest[at], length / (1.0 + limit), length / wp.max(1.0 - limit, 0.1))


PASSES = SimpleNamespace(awaken=awaken, bind=bind, stretch=stretch, yield_bonds=yield_bonds)
