"""Position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp.

One substep: predict, lists, then per iteration multipliers and correction, then velocity from the change of position.
Shear strength of what flows is a compliant constraint (XPBD, Macklin et al. 2016) whose multiplier is bounded by the
yield stress: one Jacobi step a substep, `strain` and `pull`. Solids are held by bonds instead (bonds.py). Newtonian
viscosity is mapped onto velocity smoothing (laws.smoothing_weight).
"""

from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import Box, Force, Phase, force_at, too_fast

from .. import constitutive
from ..aging import rest_density
from ..bind import warp_func
from ..corrected import elastic_stress, mirrored_stress, symmetric_inverse
from ..neighbours import INDEX_BITS, INDEX_MASK, WALL_INSET, Lists, contained, image_position, image_velocity
from ..smoothing import poly6, spiky, spiky_slope
from . import laws
from .bonds import bonded
from .walls import pushed, wall_friction

wp.set_module_options({"enable_backward": False, "fast_math": True})

kernel = warp_func(poly6)
summed = warp_func(spiky)
gradient = warp_func(spiky_slope)
strain_and_flow = warp_func(constitutive.strain_and_flow, constitutive.flow_stress)
smoothing_weight = warp_func(laws.smoothing_weight, laws.largest_viscosity)
conveyed_modulus = warp_func(laws.conveyed_modulus, laws.largest_modulus)

SLACK = wp.constant(
    2.0e-3
)  # density that is left alone, over that at rest: what the lattices of round bodies are off by
HURRIED = wp.constant(10.0)  # corrections of a crowded start are this much faster, for a substep, than any matter
FARTHEST = wp.constant(1.0e3)  # spacings beyond which no constraint wants a particle to move
SLACK_SOLID = wp.constant(0.1)  # a solid's bonds keep its density; the constraint only keeps its parts apart


@wp.struct
class Numbers:
    """Numbers of the discretisation."""

    support: float  # kernel radius H [m]
    spacing: float  # [m]
    weight: float  # makes the density sum exactly 1 on a lattice at rest [-]
    relaxation: float  # constraint force mixing epsilon [-]
    over_relaxation: float  # share of the Jacobi correction that is applied [-]
    sweeps: int  # shear sweeps per substep
    calm: float  # share of the approach of neighbours that is damped in a substep, in pastes [-]
    stiffness: float  # largest shear modulus that one Jacobi step conveys, over rho (d / dt)^2 [-]


@wp.kernel
def predict(
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    velocity: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
):
    """Position under the present velocity and gravity. `motion` carries the displacement of the substep by itself: as a
    difference of float32 positions it would lose the velocity at small dt."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        if held[i] == FREE:
            v += h * force_at(force[world], position[i])
        free = position[i] + h * v
        if too_fast(v, HURRIED * box.top_speed):
            wp.atomic_or(fault, 0, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * num.spacing)
        motion[i] = h * v + pushed(box, free, x)
        position[i] = x


@wp.kernel
def multipliers(
    num: Numbers,
    box: Box,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    # outputs
    multiplier: wp.array(dtype=float),
    fill: wp.array(dtype=float),
):
    """Lagrange multiplier of the density constraint rho / rho0 <= 1 (eqs. 1, 8, 9 and 11 of the paper).

    Density is summed with the kernel whose slope is used, so that the constraint and its gradient agree; the paper
    sums with poly6, whose flat top lets particles pair.
    """
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        x = position[i]
        # Its own term counts the particle's volume by half: a lattice stretched by a percent then sums as before.
        dense = 0.5 * (volume[i] + num.spacing * num.spacing * num.spacing) * summed(0.0, num.support)
        own = wp.vec3(0.0, 0.0, 0.0)
        squares = float(0.0)
        for k in range(lists.number[i]):
            entry = lists.entries[i * lists.row + k * lists.column]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            xj = position[j]
            if code > 0:
                xj = image_position(box, xj, code)
            r = x - xj
            r2 = wp.dot(r, r)
            distance = wp.sqrt(r2)
            dense += volume[j] * summed(distance, num.support)
            g = (volume[j] * num.weight * gradient(distance, num.support) / wp.max(distance, 1.0e-9)) * r
            own += g
            squares += wp.dot(g, g)
        dense *= num.weight
        fill[i] = dense
        # One-sided: a surface must not be pulled together. Lengths are scaled by the spacing to make epsilon a number.
        scale = num.spacing * num.spacing
        limit = 1.0 + wp.where(bonded(phases[world, phase_of[i]]), SLACK_SOLID, SLACK)
        multiplier[i] = -wp.max(dense - limit, 0.0) / ((squares + wp.dot(own, own)) * scale + num.relaxation)


@wp.kernel
def correct(
    num: Numbers,
    box: Box,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    multiplier: wp.array(dtype=float),
    # outputs
    correction: wp.array(dtype=wp.vec3),
):
    """Position correction (eq. 12), as one simultaneous Jacobi step."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and held[i] == FREE:
        x = position[i]
        shift = wp.vec3(0.0, 0.0, 0.0)
        for k in range(lists.number[i]):
            entry = lists.entries[i * lists.row + k * lists.column]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            xj = position[j]
            if code > 0:
                xj = image_position(box, xj, code)
            r = x - xj
            distance = wp.length(r)
            g = volume[j] * num.weight * gradient(distance, num.support) / wp.max(distance, 1.0e-9)
            shift += ((multiplier[i] + multiplier[j]) * g) * r
        correction[i] = (num.over_relaxation * num.spacing * num.spacing) * shift


@wp.kernel
def apply(
    num: Numbers,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    held: wp.array(dtype=int),
    correction: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
):
    """Move by the correction, at most a quarter of a spacing, and stay inside the walls."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and held[i] == FREE:
        shift = correction[i]
        length = wp.length(shift)
        limit = 0.25 * num.spacing
        if length > limit:
            shift = shift * (limit / length)
        free = position[i] + shift
        if not (length <= FARTHEST * num.spacing):
            wp.atomic_or(fault, 0, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * num.spacing)
        motion[i] = motion[i] + shift + pushed(box, free, x)
        position[i] = x


@wp.kernel
def velocities(
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    motion: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
):
    """v = displacement / dt."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        velocity[i] = motion[i] / dt[world]


@wp.kernel
def strain(
    num: Numbers,
    box: Box,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    velocity: wp.array(dtype=wp.vec3),
    # outputs
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    stress: wp.array(dtype=wp.mat33),
):
    """Strain of the substep by the common material law, and the elastic deviator that answers it. There is no isotropic
    tension: density constraints only push."""
    i = wp.tid()
    world = i / capacity
    phase = phases[world, phase_of[i]]
    if i - world * capacity < count[world] and bonded(phase):
        stress[i] = wp.mat33()
    elif i - world * capacity < count[world]:
        x = position[i]
        v = velocity[i]
        slope = wp.mat33()
        moment = wp.mat33()
        for k in range(lists.number[i]):
            entry = lists.entries[i * lists.row + k * lists.column]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            xj = position[j]
            vj = velocity[j]
            if code > 0:
                xj = image_position(box, xj, code)
                vj = image_velocity(box, vj, code)
            r = x - xj
            distance = wp.length(r)
            g = volume[j] * gradient(distance, num.support) / wp.max(distance, 1.0e-9)
            slope -= wp.outer(g * (v - vj), r)
            moment -= wp.outer(g * r, r)
        correction = symmetric_inverse(moment)
        slope = slope * correction
        rest = rest_density(mass, volume, i)
        modulus = conveyed_modulus(phase.shear_modulus, num.stiffness, rest, num.spacing, dt[world])
        b = elastic_normal[i]
        s = elastic_shear[i]
        if held[i] != CARRIED:
            b_xx, b_yy, b_zz, b_xy, b_xz, b_yz = strain_and_flow(
                slope[0, 0],
                slope[0, 1],
                slope[0, 2],
                slope[1, 0],
                slope[1, 1],
                slope[1, 2],
                slope[2, 0],
                slope[2, 1],
                slope[2, 2],
                b[0],
                b[1],
                b[2],
                s[0],
                s[1],
                s[2],
                modulus,
                phase.yield_stress,
                phase.plastic_viscosity,
                phase.flow_index,
                phase.relaxation_rate,
                dt[world],
            )
            b = wp.vec3(b_xx, b_yy, b_zz)
            s = wp.vec3(b_xy, b_xz, b_yz)
            elastic_normal[i] = b
            elastic_shear[i] = s
        stress[i] = elastic_stress(modulus, b, s, 0.0) * correction


@wp.kernel
def pull(
    num: Numbers,
    box: Box,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    stress: wp.array(dtype=wp.mat33),
    velocity: wp.array(dtype=wp.vec3),
    # outputs
    smoothed: wp.array(dtype=wp.vec3),
):
    """Velocity under the stress of the particle and its neighbours, and damping along their lines of centres."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        x = position[i]
        v = velocity[i]
        own = stress[i]
        a = wp.vec3(0.0, 0.0, 0.0)
        damping = wp.vec3(0.0, 0.0, 0.0)
        for k in range(lists.number[i]):
            entry = lists.entries[i * lists.row + k * lists.column]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            xj = position[j]
            vj = velocity[j]
            other = stress[j]
            if code > 0:
                xj = image_position(box, xj, code)
                vj = image_velocity(box, vj, code)
                other = mirrored_stress(box, other, code)
            r = x - xj
            distance = wp.length(r)
            g = volume[j] * gradient(distance, num.support) / wp.max(distance, 1.0e-9)
            a += (own + other) * (g * r)
            w = volume[j] * num.weight * kernel(distance * distance, num.support)
            damping -= (w * wp.dot(v - vj, r) / wp.max(distance * distance, 1.0e-18)) * r
        if held[i] == FREE:
            v += (dt[world] / rest_density(mass, volume, i)) * a + num.calm * damping
        smoothed[i] = v


@wp.kernel
def shear(
    num: Numbers,
    box: Box,
    lists: Lists,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    velocity: wp.array(dtype=wp.vec3),
    # outputs
    smoothed: wp.array(dtype=wp.vec3),
):
    """One XSPH sweep (eq. 17)."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        phase = phases[world, phase_of[i]]
        x = position[i]
        v = velocity[i]
        mean = wp.vec3(0.0, 0.0, 0.0)
        total = volume[i] * num.weight * kernel(0.0, num.support)
        for k in range(lists.number[i]):
            entry = lists.entries[i * lists.row + k * lists.column]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            xj = position[j]
            vj = velocity[j]
            if code > 0:
                xj = image_position(box, xj, code)
                vj = image_velocity(box, vj, code)
            r = xj - x
            w = volume[j] * num.weight * kernel(wp.dot(r, r), num.support)
            mean += w * (vj - v)
            total += w
        out = v
        if held[i] == FREE:
            rest = rest_density(mass, volume, i)
            c = smoothing_weight(phase.viscosity, rest, dt[world], num.support, float(num.sweeps))
            out = v + (c / wp.max(total, 1.0)) * mean
        smoothed[i] = out


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
