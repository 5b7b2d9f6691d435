"""What a particle of MPM does in a step, whatever way it reaches its nodes: strain, stress, motion."""

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.crew import raise_fault
from fluidbench.native.pool import FAULT_ASTRAY
from fluidbench.native.scene import Phase, is_solid, too_fast

from ..bind import warp_func
from ..flow import pressure, shear_rate, strained
from ..smoothing import quadratic_spline
from .grid import Grid, first_node

wp.set_module_options({"enable_backward": False, "fast_math": True})

spline = warp_func(quadratic_spline)
FAULT_STENCIL = 2
# How viscosity is taken in a step, `drags`: solved for; as a stress; the same, where what is carried is stressed, too,
# and what is elastic presses by way of nodes (dilation.py).
IMPLICIT, EXPLICIT, PRESSED = wp.constant(0), wp.constant(1), wp.constant(2)
STEEPEST = wp.constant(1.0 / 6.0)  # D dt / dx^2 up to which explicit diffusion is stable in three dimensions
ANCHORED = wp.constant(10.0)  # crowding on the grid that only clamps can make (clamp.py) [-]
PACKED = wp.constant(2.0)  # volume ratio, or one over it, beyond which nothing is let go [-]


@wp.func
def columns_scaled(m: wp.mat33, by: wp.vec3):
    """m diag(by)."""
    return wp.mat33(
        m[0, 0] * by[0],
        m[0, 1] * by[1],
        m[0, 2] * by[2],
        m[1, 0] * by[0],
        m[1, 1] * by[1],
        m[1, 2] * by[2],
        m[2, 0] * by[0],
        m[2, 1] * by[1],
        m[2, 2] * by[2],
    )


@wp.func
def mean_stress(phase: Phase, volume_ratio: float):
    """The mean of Kirchhoff stress [Pa], from J: pressure, turned round."""
    return -volume_ratio * pressure(1.0 / volume_ratio - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)


@wp.func
def presses_nodes(phase: Phase):
    """Whether, beside a body, the mean stress of such matter acts by way of nodes (dilation.py)."""
    return phase.shear_modulus > 0.0


@wp.func
def kirchhoff(phase: Phase, mean: float, b: wp.vec3, s: wp.vec3):
    """Kirchhoff stress [Pa] without viscosity, from its mean and the elastic tensor (b: diagonal, s: xy, xz, yz)."""
    g = phase.shear_modulus
    m = g * (b[0] + b[1] + b[2]) / 3.0 - mean
    return wp.mat33(
        g * b[0] - m,
        g * s[0],
        g * s[1],
        g * s[0],
        g * b[1] - m,
        g * s[2],
        g * s[1],
        g * s[2],
        g * b[2] - m,
    )


@wp.func
def viscous(phase: Phase, volume_ratio: float, velocity_gradient: wp.mat33):
    """Viscous Kirchhoff stress [Pa]: 2 min(J, 1) eta dev(D). A liquid that has cavitated (J > 1) must not break the
    bound on dt."""
    rate = 0.5 * (velocity_gradient + wp.transpose(velocity_gradient))
    mean = wp.trace(rate) / 3.0
    return (2.0 * wp.min(volume_ratio, 1.0) * phase.viscosity) * (rate - wp.diag(wp.vec3(mean, mean, mean)))


@wp.func
def resistance_of(grid: Grid, dt: float, volume: float, tau: wp.mat33):
    """By how much more a stress resists, within dt, the motion of a node one cell farther along each axis: the columns
    of 4 dt V0 tau / dx^2 dx [kg m/s] (Hu et al. 2018, eq. 18)."""
    return columns_scaled(tau, (4.0 * dt * volume) * grid.inv_dx)


@wp.func
def weights(grid: Grid, x: wp.vec3, base: wp.vec3i):
    """(where x lies beyond its lowest node, in cells; the weights of its three nodes along x, y and z)."""
    f = wp.cw_mul(x - grid.origin, grid.inv_dx) - wp.vec3(float(base[0]), float(base[1]), float(base[2]))
    wx0, wx1, wx2 = spline(f[0])
    wy0, wy1, wy2 = spline(f[1])
    wz0, wz1, wz2 = spline(f[2])
    return f, wp.vec3(wx0, wx1, wx2), wp.vec3(wy0, wy1, wy2), wp.vec3(wz0, wz1, wz2)


@wp.func
def stretch(c: wp.mat33, dt: float):
    """det(1 + dt c). Its trace alone would take the steps of what turns, along tangents, for compression: a spinning
    cube swelled by a sixth in eight turns."""
    t = wp.trace(c)
    minors = 0.5 * (t * t - wp.trace(c * c))
    return 1.0 + dt * (t + dt * (minors + dt * wp.determinant(c)))


@wp.func
def stressed(
    grid: Grid,
    dt: float,
    drags: int,
    phase: Phase,
    p: int,
    on: bool,
    x: wp.vec3,
    affine: wp.array(dtype=wp.mat33),
    m: float,
    volume: wp.array(dtype=float),
    held: wp.array(dtype=int),
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
):
    """Strain and stress of particle p in a step, kept if it is `on`; what it gives to a node one cell farther along
    each axis beyond its momentum, of the mass m, which is 0 where nodes have that: the columns of
    (m C - 4 dt V0 tau / dx^2) dx [kg m/s] (Hu et al. 2018, eq. 18). At dt = 0 nothing is strained."""
    c = affine[p]
    j = volume_ratio[p]
    b = elastic_normal[p]
    s = elastic_shear[p]
    a = wp.mat33()
    if held[p] == FREE or (held[p] == CARRIED and drags == PRESSED):
        a = columns_scaled(m * c, grid.dx)
    if (held[p] != CARRIED or drags == PRESSED) and on and dt > 0.0:
        j *= wp.max(stretch(c, dt), 0.1)
        volume_ratio[p] = j
        if phase.shear_modulus > 0.0:
            b, s, _kept = strained(phase, phase.shear_modulus, c, b, s, dt, p, plastic)
            elastic_normal[p] = b
            elastic_shear[p] = s
    if on and dt > 0.0 and (held[p] != CARRIED or drags == PRESSED):
        mean = float(0.0)
        if drags != PRESSED or not presses_nodes(phase):
            mean = mean_stress(phase, j)
        tau = kirchhoff(phase, mean, b, s)
        if drags != IMPLICIT and phase.viscosity > 0.0:
            tau += viscous(phase, j, c)
        a -= resistance_of(grid, dt, volume[p], tau)
    return a


@wp.func
def as_begun(grid: Grid, a: wp.mat33, bent: wp.mat33):
    """What a stress gives to a node one cell farther along each axis, as cells were where matter has been bent since
    by 1 + grad u: tau becomes tau (1 + grad u)^-T."""
    back = wp.inverse(wp.identity(n=3, dtype=float) + bent)
    return columns_scaled(columns_scaled(a, grid.dx) * wp.transpose(back), grid.inv_dx)


@wp.func
def contained(grid: Grid, x: wp.vec3):
    """A position wrapped along periodic axes and kept in front of walls."""
    out = x
    for axis in range(3):
        low, high = grid.lower[axis], grid.upper[axis]
        if grid.wrap[axis] > 0:
            if out[axis] < low:
                out[axis] = out[axis] + (high - low)
            elif out[axis] >= high:
                out[axis] = out[axis] - (high - low)
        else:
            skin = 1.0e-3 * grid.dx[axis]
            out[axis] = wp.clamp(out[axis], low + skin, high - skin)
    return out


@wp.func
def taken(p: int, sums: wp.mat44, held: wp.array(dtype=int), velocity: wp.array(dtype=wp.vec3)):
    """Particle p takes the velocity that it gathered (the sums' first row), if it is free; returns that which it moves
    with."""
    v = velocity[p]
    if held[p] == FREE:
        v = wp.vec3(sums[0, 0], sums[0, 1], sums[0, 2])
        velocity[p] = v
    return v


@wp.func
def down_the_slope(grid: Grid, density: float, sums: wp.mat44, c: wp.mat33, step: float):
    """-step |2 dev D| dx^2 grad(rho) / rho0 [m], of the sums that a particle of a rest density gathers: 4 sum w rho
    (x_i - x) is dx^2 grad(rho)."""
    slope = wp.cw_mul(wp.vec3(sums[1, 3], sums[2, 3], sums[3, 3]), grid.dx)
    return -(wp.min(step * shear_rate(c), STEEPEST) * 4.0 / density) * slope


@wp.func
def shifted(
    grid: Grid,
    phase: Phase,
    sums: wp.mat44,
    c: wp.mat33,
    step: float,
    volume_ratio: float,
    held: int,
):
    """How far a particle is shifted out of a crowd [m]: down the slope of the density where rho J > rho0.

    Matter that is stretched beyond the width of a cell leaves gaps between its particles that no stress holds open,
    and its volume is lost. Shifting fills them (Fick's law, Lind et al. 2012), in proportion to the strain that makes
    them: what rests, flies or turns is left alone.
    """
    by = wp.vec3(0.0, 0.0, 0.0)
    crowding = sums[0, 3] * volume_ratio / phase.density
    if held == FREE and not is_solid(phase) and crowding > 1.0 and crowding < ANCHORED:
        by = down_the_slope(grid, phase.density, sums, c, step)
    return by


@wp.func
def moved(
    grid: Grid,
    x: wp.vec3,
    v: wp.vec3,
    dt: float,
    p: int,
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
):
    """Move particle p on from x, walls stop it; returns its lowest node then. What is astray stays: where a velocity
    that is no number leads there are no nodes."""
    free = x + dt * v
    if too_fast(v, grid.top_speed):
        raise_fault(fault, FAULT_ASTRAY)
        free = position[p]
    y = contained(grid, free)
    position[p] = y
    for axis in range(3):
        if y[axis] != free[axis] and grid.wrap[axis] == 0:
            stopped = velocity[p]
            stopped[axis] = 0.0
            velocity[p] = stopped
    return first_node(grid, y)


@wp.func
def affine_of(grid: Grid, sums: wp.mat44):
    """The affine velocity field [1/s]: C = B D^-1, from B's transpose in rows 1 to 3, in cells."""
    b = wp.mat33(
        sums[1, 0],
        sums[2, 0],
        sums[3, 0],
        sums[1, 1],
        sums[2, 1],
        sums[3, 1],
        sums[1, 2],
        sums[2, 2],
        sums[3, 2],
    )
    return columns_scaled(b, 4.0 * grid.inv_dx)
