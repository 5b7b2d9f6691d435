"""Position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp.

One substep: predict, lists, then per iteration multipliers and correction, then velocity from the change of position,
and shear sweeps that stand for viscosity and yield. There is no stress: what the material law asks for is mapped onto
velocity smoothing as far as that goes (see `smoothing_weight`).
"""

import warp as wp

from fluidbench.scene import FRICTION, PERIODIC, Box, Phase

from ..bind import warp_func
from ..neighbours import INDEX_BITS, INDEX_MASK, WALL_INSET, Lists, contained, image_position, image_velocity
from ..smoothing import poly6, spiky, spiky_slope

wp.set_module_options({"enable_backward": False, "fast_math": True})

kernel = warp_func(poly6)
summed = warp_func(spiky)
gradient = warp_func(spiky_slope)


@wp.struct
class Numbers:
    """Numbers of the discretisation."""

    support: float  # kernel radius H [m]
    spacing: float  # [m]
    weight: float  # makes the density sum exactly 1 on a lattice at rest [-]
    relaxation: float  # constraint force mixing epsilon [-]
    over_relaxation: float  # share of the Jacobi correction that is applied [-]
    sweeps: int  # shear sweeps per substep


@wp.kernel
def predict(
    num: Numbers, box: Box, capacity: int, count: wp.array(dtype=int), dt: wp.array(dtype=float),
    gravity: wp.array(dtype=wp.vec3), held: wp.array(dtype=int),
    # outputs
    position: wp.array(dtype=wp.vec3), velocity: wp.array(dtype=wp.vec3), start: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Velocity under gravity and the position it leads to."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        if held[i] == 0:
            v += h * gravity[world]
        velocity[i] = v
        x = contained(box, position[i] + h * v, WALL_INSET * num.spacing)
        start[i] = x - h * v  # so that a periodic wrap or a wall does not count as motion twice
        position[i] = x


@wp.kernel
def multipliers(
    num: Numbers, box: Box, lists: Lists, capacity: int, count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3), volume: wp.array(dtype=float),
    # outputs
    multiplier: wp.array(dtype=float), fill: wp.array(dtype=float),
):  # fmt: skip
    """Lagrange multiplier of the density constraint rho / rho0 <= 1 (eqs. 1, 8, 9 and 11 of the paper).

    Density is summed with the kernel whose slope is used, so that the constraint and its gradient agree; the paper
    sums with poly6, whose flat top lets particles pair.
    """
    i = wp.tid()
    if i % capacity < count[i / capacity]:
        x = position[i]
        dense = volume[i] * summed(0.0, num.support)
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
        multiplier[i] = -wp.max(dense - 1.0, 0.0) / ((squares + wp.dot(own, own)) * scale + num.relaxation)


@wp.kernel
def correct(
    num: Numbers, box: Box, lists: Lists, capacity: int, count: wp.array(dtype=int), held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3), volume: wp.array(dtype=float), multiplier: wp.array(dtype=float),
    # outputs
    correction: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Position correction (eq. 12), as one simultaneous Jacobi step."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and held[i] == 0:
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
    num: Numbers, box: Box, capacity: int, count: wp.array(dtype=int), held: wp.array(dtype=int),
    correction: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3), start: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Move by the correction, at most a quarter of a spacing, and stay inside the walls."""
    i = wp.tid()
    if i % capacity < count[i / capacity] and held[i] == 0:
        shift = correction[i]
        length = wp.length(shift)
        limit = 0.25 * num.spacing
        if length > limit:
            shift = shift * (limit / length)
        free = position[i] + shift
        x = contained(box, free, WALL_INSET * num.spacing)
        for axis in range(3):
            if box.lower_kind[axis] == PERIODIC and x[axis] != free[axis]:
                from_start = start[i]
                from_start[axis] = from_start[axis] + x[axis] - free[axis]
                start[i] = from_start
        position[i] = x


@wp.kernel
def velocities(
    capacity: int, count: wp.array(dtype=int), dt: wp.array(dtype=float), held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3), start: wp.array(dtype=wp.vec3), velocity: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """v = (x - x_start) / dt."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == 0:
        velocity[i] = (position[i] - start[i]) / dt[world]


@wp.func
def smoothing_weight(num: Numbers, phase: Phase, shear_rate: float, dt: float):
    """XSPH coefficient of one sweep that acts like the material's viscosity: c = 22 nu dt / (sweeps H^2), at most 1.

    The material's apparent viscosity is viscosity + plastic_viscosity rate^(n-1) + yield_stress / rate, as far as it
    has any; beyond c = 1 per sweep XSPH cannot go (validation C).
    """
    rate = wp.max(shear_rate, 1.0e-3)
    eta = phase.viscosity
    if phase.shear_modulus > 0.0:
        eta += phase.plastic_viscosity * wp.pow(rate, phase.flow_index - 1.0) + phase.yield_stress / rate
    c = 22.0 * eta / phase.density * dt / (num.support * num.support * float(num.sweeps))
    return wp.min(c, 1.0)


@wp.kernel
def shear(
    num: Numbers, box: Box, lists: Lists, capacity: int, count: wp.array(dtype=int), dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase), phase_of: wp.array(dtype=int), held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3), volume: wp.array(dtype=float), velocity: wp.array(dtype=wp.vec3),
    # outputs
    smoothed: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """One XSPH sweep (eq. 17) with a weight from the local shear rate."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world]:
        phase = phases[world, phase_of[i]]
        x = position[i]
        v = velocity[i]
        mean = wp.vec3(0.0, 0.0, 0.0)
        spin = wp.mat33()
        moment = float(0.0)
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
            u = vj - v
            mean += w * u
            spin += wp.outer(w * u, r)
            moment += w * wp.dot(r, r)
            total += w
        # least-squares velocity gradient for an isotropic neighbourhood: sum w u r^T / (sum w r^2 / 3)
        g = spin * (3.0 / wp.max(moment, 1.0e-20))
        rate = 0.5 * (g + wp.transpose(g))
        shear_rate = wp.sqrt(2.0 * wp.ddot(rate, rate))
        out = v
        if held[i] == 0:
            c = smoothing_weight(num, phase, shear_rate, dt[world])
            out = v + (c / wp.max(total, 1.0)) * mean
        smoothed[i] = out


@wp.kernel
def rub(
    box: Box, capacity: int, count: wp.array(dtype=int), dt: wp.array(dtype=float), held: wp.array(dtype=int),
    spacing: float, gravity: wp.array(dtype=wp.vec3), smoothed: wp.array(dtype=wp.vec3),
    position: wp.array(dtype=wp.vec3), velocity: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Take over the smoothed velocity; particles touching a friction wall lose tangential speed by Coulomb's law."""
    i = wp.tid()
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == 0:
        v = smoothed[i]
        for axis in range(3):
            lower = box.lower_kind[axis] == FRICTION and position[i][axis] - box.lower[axis] < spacing
            upper = box.upper_kind[axis] == FRICTION and box.upper[axis] - position[i][axis] < spacing
            if lower or upper:
                friction = box.lower_friction[axis]
                if upper:
                    friction = box.upper_friction[axis]
                normal = v[axis]
                slide = v
                slide[axis] = 0.0
                speed = wp.length(slide)
                grip = wp.min(friction * wp.abs(gravity[world][axis]) * dt[world], speed)
                v = slide * (1.0 - grip / wp.max(speed, 1.0e-12))
                v[axis] = normal
        velocity[i] = v
