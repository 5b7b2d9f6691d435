"""Position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp.

One substep: predict, lists, then per iteration multipliers and correction, then velocity from the change of position.
Shear strength of what flows is a compliant constraint (XPBD, Macklin et al. 2016) whose multiplier is bounded by the
yield stress: one Jacobi step a substep, `strain` and `pull`. Solids are held by bonds instead (bonds.py). Newtonian
viscosity is implicit (../viscosity.py). Sums over pairs are those of pairs.py.
"""

import functools
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import Box, Force, Phase, force_at, too_fast
from fluidbench.native.vector_access import store_vec4

from ..aging import rest_density
from ..bind import warp_func
from ..corrected import elastic_stress, mirrored_stress, symmetric_inverse
from ..flow import strained
from ..images import WALL_INSET, contained, image_velocity
from ..pairs import Pass, floats
from ..smoothing import poly6, spiky, spiky_slope
from . import laws
from .bonds import bonded
from .walls import pushed, wall_friction

wp.set_module_options({"enable_backward": False, "fast_math": True})

kernel = warp_func(poly6)
summed = warp_func(spiky)
gradient = warp_func(spiky_slope)
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
    calm: float  # share of the approach of neighbours that is damped in a substep, in pastes [-]
    stiffness: float  # largest shear modulus that one Jacobi step conveys, over rho (d / dt)^2 [-]


# Rows that neighbours are asked for. Of density: position, volume. Of its constraints: the same | multiplier. Of
# velocities: the same | velocity. Of stress: the same | velocity, stress (9).
PLACE, PUSH, MOVING, PULLING = 4, 8, 8, 16
vec5, vec6, vec15 = floats(5), floats(6), floats(15)


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
    # outputs
    position: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    places: wp.array(dtype=wp.vec4),
    fault: wp.array(dtype=int),
):
    """Position under the present velocity and gravity. `motion` carries the displacement of the substep by itself: as a
    difference of float32 positions it would lose the velocity at small dt."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        if held[i] == FREE:
            v += h * force_at(force[world], position[i])
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

    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    pushes: wp.array(dtype=wp.vec4)
    fill: wp.array(dtype=float)
    correction: wp.array(dtype=wp.vec3)


@wp.func
def multiplier_pair(num: Numbers, own: floats(PLACE + 4), other: floats(PLACE), r: wp.vec3):
    distance = wp.length(r)
    dense = other[3] * summed(distance, num.support)
    g = (other[3] * num.weight * gradient(distance, num.support) / wp.max(distance, 1.0e-9)) * r
    return vec5(dense, g[0], g[1], g[2], wp.dot(g, g))


@wp.func
def multiplier_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PLACE + 4), sums: vec5
):
    # Its own term counts the particle's volume by half: a lattice stretched by a percent then sums as before.
    dense = sums[0] + 0.5 * (own[3] + num.spacing * num.spacing * num.spacing) * summed(0.0, num.support)
    dense *= num.weight
    data.fill[i] = dense
    together = wp.vec3(sums[1], sums[2], sums[3])
    # One-sided: a surface must not be pulled together. Lengths are scaled by the spacing to make epsilon a number.
    scale = num.spacing * num.spacing
    limit = 1.0 + wp.where(bonded(data.phases[world, data.phase_of[i]]), SLACK_SOLID, SLACK)
    multiplier = -wp.max(dense - limit, 0.0) / ((sums[4] + wp.dot(together, together)) * scale + num.relaxation)
    store_vec4(data.pushes, 2 * i, wp.vec4(own[0], own[1], own[2], own[3]))
    store_vec4(data.pushes, 2 * i + 1, wp.vec4(multiplier, 0.0, 0.0, 0.0))


multipliers = Pass(Numbers, Constraining, PLACE, 5, multiplier_pair, multiplier_finish)
"""Lagrange multiplier of the density constraint rho / rho0 <= 1 (eqs. 1, 8, 9 and 11 of the paper).

Density is summed with the kernel whose slope is used, so that the constraint and its gradient agree; the paper sums
with poly6, whose flat top lets particles pair. Sums: density, its own gradient (3), squares of the others'.
"""


@wp.func
def correct_pair(num: Numbers, own: floats(PUSH + 4), other: floats(PUSH), r: wp.vec3):
    distance = wp.length(r)
    g = other[3] * num.weight * gradient(distance, num.support) / wp.max(distance, 1.0e-9)
    return ((own[4] + other[4]) * g) * r


@wp.func
def correct_finish(
    num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PUSH + 4), sums: wp.vec3
):
    if data.held[i] == FREE:
        data.correction[i] = (num.over_relaxation * num.spacing * num.spacing) * sums


correct = Pass(Numbers, Constraining, PUSH, 3, correct_pair, correct_finish)
"""Position correction (eq. 12), as one simultaneous Jacobi step."""


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
    """Move by the correction, at most a quarter of a spacing, and stay inside the walls."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity] and held[i] == FREE:
        shift = correction[i]
        length = wp.length(shift)
        limit = 0.25 * num.spacing
        if length > limit:
            shift = shift * (limit / length)
        free = position[i] + shift
        if not (length <= FARTHEST * num.spacing):
            raise_fault(fault, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * num.spacing)
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
    velocity: wp.array(dtype=wp.vec3),
    motion: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
):
    """Matter goes where its velocity takes it after viscosity has acted, which holds back what gravity and constraints
    would move in a substep, too."""
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world] and held[i] == FREE:
        free = position[i] + (dt[world] * velocity[i] - motion[i])
        position[i] = contained(box, free, WALL_INSET * num.spacing)


@wp.kernel
def pack(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    velocity: wp.array(dtype=wp.vec3),
    # outputs
    moving: wp.array(dtype=wp.vec4),
):
    """Rows of velocities."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        x, v = position[i], velocity[i]
        store_vec4(moving, 2 * i, wp.vec4(x[0], x[1], x[2], volume[i]))
        store_vec4(moving, 2 * i + 1, wp.vec4(v[0], v[1], v[2], 0.0))


@wp.kernel
def settle(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    smoothed: wp.array(dtype=wp.vec3),
    # outputs
    velocity: wp.array(dtype=wp.vec3),
    moving: wp.array(dtype=wp.vec4),
):
    """Velocities that a sum over pairs has found, in place of those it was taken of."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        v = smoothed[i]
        velocity[i] = v
        store_vec4(moving, 2 * i + 1, wp.vec4(v[0], v[1], v[2], 0.0))


@wp.struct
class Shearing:
    """What the passes over velocities read and write of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    volume: wp.array(dtype=float)
    elastic_normal: wp.array(dtype=wp.vec3)
    elastic_shear: wp.array(dtype=wp.vec3)
    pulling: wp.array(dtype=wp.vec4)
    smoothed: wp.array(dtype=wp.vec3)


@wp.func
def seen_moving(box: Box, data: Shearing, row: floats(MOVING), j: int, code: int):
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
    return row


@wp.func
def strain_pair(num: Numbers, own: floats(MOVING + 4), other: floats(MOVING), r: wp.vec3):
    distance = wp.length(r)
    g = (other[3] * gradient(distance, num.support) / wp.max(distance, 1.0e-9)) * r
    u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
    return vec15(
        -u[0] * g[0], -u[0] * g[1], -u[0] * g[2],
        -u[1] * g[0], -u[1] * g[1], -u[1] * g[2],
        -u[2] * g[0], -u[2] * g[1], -u[2] * g[2],
        -g[0] * r[0], -g[1] * r[1], -g[2] * r[2], -g[0] * r[1], -g[0] * r[2], -g[1] * r[2],
    )  # fmt: skip


@wp.func
def strain_finish(num: Numbers, box: Box, data: Shearing, world: int, i: int, own: floats(MOVING + 4), sums: vec15):
    phase = data.phases[world, data.phase_of[i]]
    h = data.dt[world]
    stress = wp.mat33()
    if not bonded(phase):
        moment = wp.mat33(
            sums[9], sums[12], sums[13], sums[12], sums[10], sums[14], sums[13], sums[14], sums[11]
        )  # fmt: skip
        correction = symmetric_inverse(moment)
        slope = wp.mat33(
            sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8]
        )  # fmt: skip
        slope = slope * correction
        rest = rest_density(data.mass, data.volume, i)
        modulus = conveyed_modulus(phase.shear_modulus, num.stiffness, rest, num.spacing, h)
        b = data.elastic_normal[i]
        s = data.elastic_shear[i]
        if data.held[i] != CARRIED:
            b, s, _kept = strained(phase, modulus, slope, b, s, h)
            data.elastic_normal[i] = b
            data.elastic_shear[i] = s
        stress = elastic_stress(modulus, b, s, 0.0) * correction
    store_vec4(data.pulling, 4 * i, wp.vec4(own[0], own[1], own[2], own[3]))
    store_vec4(data.pulling, 4 * i + 1, wp.vec4(own[4], own[5], own[6], stress[0, 0]))
    store_vec4(data.pulling, 4 * i + 2, wp.vec4(stress[0, 1], stress[0, 2], stress[1, 0], stress[1, 1]))
    store_vec4(data.pulling, 4 * i + 3, wp.vec4(stress[1, 2], stress[2, 0], stress[2, 1], stress[2, 2]))


strain = Pass(Numbers, Shearing, MOVING, 15, strain_pair, strain_finish, seen=seen_moving)
"""Strain of the substep by the common material law, and the elastic deviator that answers it. There is no isotropic
tension: density constraints only push. Sums: the velocity gradient (9), the moment (xx yy zz xy xz yz)."""


@wp.func
def seen_pulling(box: Box, data: Shearing, row: floats(PULLING), j: int, code: int):
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
    t = wp.mat33(row[7], row[8], row[9], row[10], row[11], row[12], row[13], row[14], row[15])
    t = mirrored_stress(box, t, code)
    for a in range(3):
        for b in range(3):
            row[7 + 3 * a + b] = t[a, b]
    return row


@wp.func
def pull_pair(num: Numbers, own: floats(PULLING + 4), other: floats(PULLING), r: wp.vec3):
    r2 = wp.dot(r, r)
    distance = wp.sqrt(r2)
    g = (other[3] * gradient(distance, num.support) / wp.max(distance, 1.0e-9)) * r
    stress = wp.mat33(
        own[7] + other[7], own[8] + other[8], own[9] + other[9],
        own[10] + other[10], own[11] + other[11], own[12] + other[12],
        own[13] + other[13], own[14] + other[14], own[15] + other[15],
    )  # fmt: skip
    a = stress * g
    u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
    w = other[3] * num.weight * kernel(r2, num.support)
    damping = -(w * wp.dot(u, r) / wp.max(r2, 1.0e-18)) * r
    return vec6(a[0], a[1], a[2], damping[0], damping[1], damping[2])


@wp.func
def pull_finish(num: Numbers, box: Box, data: Shearing, world: int, i: int, own: floats(PULLING + 4), sums: vec6):
    v = wp.vec3(own[4], own[5], own[6])
    if data.held[i] == FREE:
        a = wp.vec3(sums[0], sums[1], sums[2])
        damping = wp.vec3(sums[3], sums[4], sums[5])
        v += (data.dt[world] / rest_density(data.mass, data.volume, i)) * a + num.calm * damping
    data.smoothed[i] = v


pull = Pass(Numbers, Shearing, PULLING, 6, pull_pair, pull_finish, seen=seen_pulling)
"""Velocity under the stress of the particle and its neighbours, and damping along their lines of centres. Sums: 3 and
3."""


@functools.cache
def passes(cpu: bool) -> SimpleNamespace:
    """The passes for one kind of device."""
    over_pairs = {
        "multipliers": multipliers,
        "correct": correct,
        "strain": strain,
        "pull": pull,
    }
    return SimpleNamespace(
        predict=predict,
        apply=apply,
        velocities=velocities,
        follow=follow,
        pack=pack,
        settle=settle,
        wall_friction=wall_friction,
        **{name: one.compiled(name, cpu) for name, one in over_pairs.items()},
    )
