"""Weakly compressible SPH in Warp: continuity density, delta-SPH diffusion, the common material law.

One substep: lists, pack (rows that neighbours are asked for), strain (continuity, velocity gradient, stress), force
(momentum), move. Materials with shear stiffness use corrected gradients for strain and stress (see corrected.py),
liquids the symmetric form of Monaghan (2005, Rep. Prog. Phys. 68:1703). Sums over pairs are those of pairs.py.
"""

import functools
from types import SimpleNamespace

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE
from fluidbench.native.scene import PERIODIC, Box, Force, Phase, force_at, is_solid, too_fast
from fluidbench.native.vector_access import store_vec4

from ..aging import rest_density
from ..bind import warp_func
from ..corrected import (
    SOUND,
    elastic_stress,
    from_before,
    least_eigenvalue,
    mirrored_stress,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)
from ..crowding import excess, out_of_crowd
from ..flow import pressure, shear_rate, strained
from ..hourglass import off_linear
from ..images import WALL_INSET, contained, image_gradient, image_traction, image_velocity
from ..pairs import Pass, floats
from ..smoothing import wendland_slope
from ..tool import Tool, felt, keep_out, seen_by_tool
from .particle import Smoothing, broken, drifted, pulled_back, straggling

wp.set_module_options({"enable_backward": False, "fast_math": True})

slope = warp_func(wendland_slope)

FLOOR = wp.constant(0.1)  # least density over that at rest
CRUSHED = wp.constant(1.0e3)  # density over that at rest that no matter reaches

# Rows of `strain`: position, mass | velocity, density | carried gradient, rest density.
MATTER = 12
# Rows of `force`: position, mass | velocity, then of liquids the pressure term; of what has strength stress (9), the
# traction that pulls back (3) and how far it is a straggler. Where partners differ also density, rest density,
# viscosity, sound.
STATE = {(False, False): 8, (True, False): 20, (False, True): 12, (True, True): 24}


@wp.struct
class Straining:
    """What `strain` reads and writes of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    growth: wp.array(dtype=float)  # of the rest volume; one zero where nothing changes [1/s]
    elastic_normal: wp.array(dtype=wp.vec3)
    elastic_shear: wp.array(dtype=wp.vec3)
    off_linear: wp.array(dtype=wp.vec3)
    plastic: wp.array(dtype=float)  # strain; one zero where nothing hardens
    new_density: wp.array(dtype=float)
    state: wp.array(dtype=wp.vec4)  # rows of `force`
    shift: wp.array(dtype=wp.vec3)
    fault: wp.array(dtype=int)
    tool: Tool


@wp.struct
class Forcing:
    """What `force` reads and writes of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    forces: wp.array(dtype=Force)
    new_density: wp.array(dtype=float)
    acceleration: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.kernel
def pack(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    density: wp.array(dtype=float),
    carried_gradient: wp.array(dtype=wp.vec3),
    # outputs
    matter: wp.array(dtype=wp.vec4),
):
    """Rows of `strain`."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        x, v, g = position[i], velocity[i], carried_gradient[i]
        store_vec4(matter, 3 * i, wp.vec4(x[0], x[1], x[2], mass[i]))
        store_vec4(matter, 3 * i + 1, wp.vec4(v[0], v[1], v[2], density[i]))
        store_vec4(matter, 3 * i + 2, wp.vec4(g[0], g[1], g[2], rest_density(mass, volume, i)))


@wp.func
def seen_matter(box: Box, data: Straining, row: floats(MATTER), j: int, code: int):
    """A row of `strain` in the walls."""
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    g = image_gradient(box, wp.vec3(row[8], row[9], row[10]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
        row[8 + axis] = g[axis]
    return row


@functools.cache
def passes(strength: bool, viscous: bool, changing: bool, tooled: bool, cpu: bool) -> SimpleNamespace:
    """The passes for materials with or without shear stiffness, viscosity, parameters or rest densities that differ
    between particles, and a rigid body that is carried along: unused physics costs nothing."""
    name = f"{'strength' if strength else 'liquid'}_{'viscous' if viscous else 'inviscid'}"
    name += "_changing" * changing + "_tooled" * tooled
    strain = strain_pass(strength, changing, tooled).compiled(f"strain_{name}", cpu)
    force = force_pass(strength, viscous, changing, tooled).compiled(f"force_{name}", cpu)
    kept_out = {"keep_out": keep_out} if tooled else {}
    return SimpleNamespace(pack=pack, strain=strain, force=force, move=move, **kept_out)


def strain_pass(strength: bool, changing: bool, tooled: bool) -> Pass:
    """Continuity with density diffusion (Monaghan 2005, eq. 2.17; Antuono et al. 2010), then the material law.

    Diffusion must not level the gradient that carries pressure, which is `carried_gradient` from both partners (see
    `move`). Sums: diffusion, the first moment (3), crowding (3); then of liquids the second moment, the inflow and the
    rate of shear squared over 5, of what has strength the velocity gradient (9), the second moment (xx yy zz xy xz yz)
    and the motion off the mean of the neighbours (3).
    """
    sums_of = 25 if strength else 10
    state_of = STATE[strength, changing] // 4
    Own, Other, Sums, Strong = floats(MATTER + 4), floats(MATTER), floats(sums_of), floats(25)

    @wp.func
    def pair(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
        r2 = wp.dot(r, r)
        w = other[3] * slope(wp.sqrt(r2) / num.h, num.h)
        partner = other[7]
        carried = wp.vec3(other[8], other[9], other[10])
        if wp.static(changing):
            # in volumes and compressions: partners may be at rest at another density
            share = own[11] / other[11]
            w *= share
            partner *= share
            carried *= share
        spread = w * (own[7] - partner - wp.dot(wp.vec3(own[8], own[9], own[10]) + carried, r))
        m = w * r
        crowd = excess(wp.sqrt(r2), num.h, num.near) * m
        if wp.static(strength):
            return Strong(
                spread, m[0], m[1], m[2], crowd[0], crowd[1], crowd[2],
                -u[0] * m[0], -u[0] * m[1], -u[0] * m[2],
                -u[1] * m[0], -u[1] * m[1], -u[1] * m[2],
                -u[2] * m[0], -u[2] * m[1], -u[2] * m[2],
                -m[0] * r[0], -m[1] * r[1], -m[2] * r[2], -m[0] * r[1], -m[0] * r[2], -m[1] * r[2],
                w * u[0], w * u[1], w * u[2],
            )  # fmt: skip
        else:  # noqa: RET505 - Warp compiles one of the two
            ur = wp.dot(u, r)
            sheared = -w * ur * ur / (r2 + 0.01 * num.h * num.h)
            return Sums(spread, m[0], m[1], m[2], crowd[0], crowd[1], crowd[2], -w * r2, w * ur, sheared)

    @wp.func
    def into_tool(tool: Tool, own: Own, sums: Sums):
        """The sums, gone on with into a rigid body (../tool_map.py)."""
        found = felt(tool, wp.vec3(own[0], own[1], own[2]))
        if found.on == 1:
            rho = own[7]
            u = rho * seen_by_tool(tool, found, wp.vec3(own[4], own[5], own[6]))
            for a in range(3):
                sums[1 + a] += rho * found.first[a]
            if wp.static(strength):
                for a in range(3):
                    for b in range(3):
                        sums[7 + 3 * a + b] -= u[a] * found.own[b]
                    sums[16 + a] -= rho * found.second[a, a]
                    sums[22 + a] += u[a] * found.zeroth
                sums[19] -= rho * found.second[0, 1]
                sums[20] -= rho * found.second[0, 2]
                sums[21] -= rho * found.second[1, 2]
            else:
                sums[7] -= rho * wp.trace(found.second)
                sums[8] += wp.dot(u, found.own)
        return sums

    @wp.func
    def finish(num: Smoothing, box: Box, data: Straining, world: int, i: int, own: Own, sums: Sums):
        phase = data.phases[world, data.phase_of[i]]
        h = data.dt[world]
        rho = own[7]
        rest, sound = float(phase.density), float(phase.wave_speed)
        if wp.static(changing):
            rest = own[11]
            sound = phase.wave_speed * wp.sqrt(phase.density / rest)
        if wp.static(tooled):
            sums = into_tool(data.tool, own, sums)
        spread = sums[0]
        first_moment = wp.vec3(sums[1], sums[2], sums[3])
        crowd = wp.vec3(sums[4], sums[5], sums[6])
        second, inflow, strain, alone = float(0.0), float(0.0), float(0.0), float(0.0)
        flows = bool(True)
        gradient, correction, span = wp.mat33(), wp.mat33(), wp.mat33()
        if wp.static(strength):
            # density from the corrected gradient, too: the same strain for pressure and for shear
            moment = wp.mat33(
                sums[16], sums[19], sums[20], sums[19], sums[17], sums[21], sums[20], sums[21], sums[18]
            )  # fmt: skip
            second = wp.trace(moment)
            correction = symmetric_inverse(moment / rho)
            gradient = wp.mat33(
                sums[7], sums[8], sums[9], sums[10], sums[11], sums[12], sums[13], sums[14], sums[15]
            )  # fmt: skip
            gradient = gradient * correction / rho
            span = spanned(moment / rho, correction)
            deformation = strain_by_chords(span, gradient, h)
            gradient = span * gradient
            inflow = -rho * wp.trace(deformation)
            b = data.elastic_normal[i]
            s = data.elastic_shear[i]
            # the gradient of a straggler is not exact even in a linear flow
            least = least_eigenvalue(moment / rho)
            whole = float(least >= SOUND)
            alone = straggling(least)
            if wp.static(changing):
                inflow -= (1.0 - whole) * rho * data.growth[i]  # nothing is there that it would have to push away
            z = whole * data.off_linear[i]
            q = (whole / rho) * (wp.vec3(sums[22], sums[23], sums[24]) - gradient * first_moment)
            if data.held[i] != CARRIED:
                turned = from_before(deformation, gradient, h)
                b, s, kept = strained(phase, phase.shear_modulus, turned, b, s, h, i, data.plastic)
                flows = kept < 1.0 or phase.shear_modulus <= 0.0
                z = off_linear(z, gradient, q, kept, h)
                data.elastic_normal[i] = b
                data.elastic_shear[i] = s
                data.off_linear[i] = z
            strain = h * shear_rate(gradient)
        else:
            second = sums[7]
            inflow = sums[8]
            strain = h * wp.sqrt(5.0 * wp.max(sums[9], 0.0) / rho)
        crowd /= rho
        flows = flows and not is_solid(phase)
        if not flows:
            crowd = broken(crowd, num.broken)
        data.shift[i] = out_of_crowd(crowd, num.h, num.shifting * strain)
        if flows:
            drift = drifted(num, phase, rho, rest, second, first_moment)
            inflow += num.density_feedback * sound / num.h * drift
            inflow += 2.0 * num.density_diffusion * num.h * sound * spread / rho
        rho += h * inflow
        if not (rho > -rest and rho < CRUSHED * rest):
            raise_fault(data.fault, FAULT_STATE)
        rho = wp.max(rho, FLOOR * rest)
        data.new_density[i] = rho
        p = pressure(rho / rest - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
        scale = 1.0 / (rho * rho)
        if wp.static(changing):
            scale *= rest  # over that of the partner: see `force_pass`
        at = i * state_of
        store_vec4(data.state, at, wp.vec4(own[0], own[1], own[2], own[3]))
        if wp.static(strength):
            g = phase.shear_modulus * rho / rest  # Cauchy from Kirchhoff: divide by J
            # Monaghan & Gingold 1983 act as a viscosity alpha h c / 10: here on what no gradient shows, a smooth flow
            # feels none.
            # Where particles are packed more densely than a lattice, by a factor that the second moment tells, q is
            # larger by it for the same motion, and so is what g does: over its square damping keeps its bound on dt.
            packing = wp.max(num.lattice * second / (3.0 * rho), 1.0)
            compact = num.compact / (packing * packing)
            damping = 0.1 * num.artificial_viscosity * num.h * sound * rho * compact
            pull = pulled_back(phase, num.hourglass * compact, damping, z, q)
            # With the correction of its gradient stress does on the particles exactly the work of the strain.
            t = scale * (span * (elastic_stress(g, b, s, p) - wp.outer(pull, first_moment / own[7])) * correction)
            pull *= scale
            store_vec4(data.state, at + 1, wp.vec4(own[4], own[5], own[6], t[0, 0]))
            store_vec4(data.state, at + 2, wp.vec4(t[0, 1], t[0, 2], t[1, 0], t[1, 1]))
            store_vec4(data.state, at + 3, wp.vec4(t[1, 2], t[2, 0], t[2, 1], t[2, 2]))
            store_vec4(data.state, at + 4, wp.vec4(pull[0], pull[1], pull[2], alone))
        else:
            store_vec4(data.state, at + 1, wp.vec4(own[4], own[5], own[6], scale * p))
        if wp.static(changing):
            store_vec4(data.state, at + state_of - 1, wp.vec4(rho, rest, phase.viscosity, sound))

    return Pass(Smoothing, Straining, MATTER, sums_of, pair, finish, seen=seen_matter)


def force_pass(strength: bool, viscous: bool, changing: bool, tooled: bool) -> Pass:
    """Momentum: pressure or stress, artificial and Newtonian viscosity. Sums: what pushes (3), and what pushes across
    friction walls (3), which never pull and rub by Coulomb's law."""
    N = width = STATE[strength, changing]
    LAST = width - 4
    Own, Other, Sums = floats(width + 4), floats(width), floats(6)

    @wp.func
    def begin(num: Smoothing, data: Forcing, world: int, i: int):
        """Coefficients of artificial and of Newtonian viscosity, where they do not depend on the partner."""
        phase = data.phases[world, data.phase_of[i]]
        # At rest density: both partners must find the same force, and a cavitated liquid, whose density is low, would
        # break the bound on dt. Monaghan 1992: alpha h c / rho; Monaghan & Gingold 1983: 2 (d + 2) mu / (rho_i rho_j)
        shock = num.artificial_viscosity * num.h * phase.wave_speed / phase.density
        drag = 10.0 * num.viscous_lattice * phase.viscosity / (phase.density * phase.density)
        return wp.vec4(shock, drag, 0.0, 0.0)

    @wp.func
    def seen(box: Box, data: Forcing, row: Other, j: int, code: int):
        v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
        for axis in range(3):
            row[4 + axis] = v[axis]
        if wp.static(strength):
            t = wp.mat33(row[7], row[8], row[9], row[10], row[11], row[12], row[13], row[14], row[15])
            t = mirrored_stress(box, t, code)
            for a in range(3):
                for b in range(3):
                    row[7 + 3 * a + b] = t[a, b]
            g = image_traction(box, wp.vec3(row[16], row[17], row[18]), code)
            for axis in range(3):
                row[16 + axis] = g[axis]
        return row

    @wp.func
    def pair(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
        r2 = wp.dot(r, r)
        q = wp.sqrt(r2) / num.h
        f = other[3] * slope(q, num.h)
        ur = wp.dot(u, r)
        tiny = 0.01 * num.h * num.h
        shock, drag = float(own[N]), float(own[N + 1])
        mine, theirs = float(1.0), float(1.0)
        if wp.static(changing):
            # Stress over rho_i^2 rho0_j / rho0_i: light matter must not feel its heavy partner's mass, and the strain's
            # sums, which are over those volumes, too, find the work that this does.
            mine, theirs = 1.0 / other[LAST + 1], 1.0 / own[LAST + 1]
            # both partners must find the same force: means of what differs between them
            fast = own[LAST + 3] + other[LAST + 3]
            shock = 0.5 * num.artificial_viscosity * num.h * fast / wp.max(own[LAST], other[LAST])
            thin = 2.0 * own[LAST + 2] * other[LAST + 2] / wp.max(own[LAST + 2] + other[LAST + 2], 1.0e-30)
            drag = 10.0 * num.viscous_lattice * thin / (own[LAST + 1] * other[LAST + 1])
        along = float(0.0)
        push = wp.vec3(0.0, 0.0, 0.0)
        if wp.static(strength):
            both = wp.mat33(
                mine * own[7] + theirs * other[7], mine * own[8] + theirs * other[8], mine * own[9] + theirs * other[9],
                mine * own[10] + theirs * other[10],
                mine * own[11] + theirs * other[11],
                mine * own[12] + theirs * other[12],
                mine * own[13] + theirs * other[13],
                mine * own[14] + theirs * other[14],
                mine * own[15] + theirs * other[15],
            )  # fmt: skip
            pull = wp.vec3(
                theirs * other[16] - mine * own[16],
                theirs * other[17] - mine * own[17],
                theirs * other[18] - mine * own[18],
            )
            push = both * r + pull
            along = wp.max(own[19], other[19]) * shock * ur / (r2 + tiny)
        else:
            both_pressures = mine * own[7] + theirs * other[7]
            # artificial viscosity for approaching particles (Monaghan 1992)
            along = shock * wp.min(ur, 0.0) / (r2 + tiny) - both_pressures
        if wp.static(viscous):
            along += drag * ur / (r2 + 0.01 * tiny)
        push = f * (push + along * r)
        return Sums(push[0], push[1], push[2], 0.0, 0.0, 0.0)

    @wp.func
    def held(rough: wp.vec3, sums: Sums):
        x, y, z = rough[0] * sums[0], rough[1] * sums[1], rough[2] * sums[2]
        return Sums(sums[0] - x, sums[1] - y, sums[2] - z, x, y, z)

    @wp.func
    def by_tool(num: Smoothing, data: Forcing, world: int, i: int, own: Own, others: wp.vec3):
        """The acceleration by a rigid body, beside that by others: its stress is the particle's own, and its drag is
        implicit in time, for beside the surface it is stiffer than any between particles."""
        a = wp.vec3(0.0, 0.0, 0.0)
        found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
        if found.on == 1:
            rho, h = data.new_density[i], data.dt[world]
            both = 2.0 * rho * found.first
            if wp.static(changing):
                both *= 1.0 / own[LAST + 1]
            if wp.static(strength):
                a = wp.mat33(own[7], own[8], own[9], own[10], own[11], own[12], own[13], own[14], own[15]) * both
            else:
                a = -own[7] * both
            if data.tool.slips == 1:
                a = wp.dot(a, found.normal) * found.normal
            if wp.static(viscous):
                phase = data.phases[world, data.phase_of[i]]
                rest = float(phase.density)
                if wp.static(changing):
                    rest = own[LAST + 1]
                drag = 10.0 * num.viscous_lattice * phase.viscosity / (rest * rest) * rho
                u = wp.vec3(own[4], own[5], own[6]) + h * (a + others) - found.velocity
                still = wp.identity(n=3, dtype=float) - (h * drag) * found.drag
                a += (wp.inverse(still) * u - u) / h
        return a

    @wp.func
    def finish(num: Smoothing, box: Box, data: Forcing, world: int, i: int, own: Own, sums: Sums):
        x = wp.vec3(own[0], own[1], own[2])
        a = wp.vec3(sums[0], sums[1], sums[2])
        pull = force_at(data.forces[world], x)
        h = data.dt[world]
        for axis in range(3):
            if sums[3 + axis] != 0.0:
                inward = wp.sign(0.5 * (box.lower[axis] + box.upper[axis]) - x[axis])
                normal = wp.max(inward * sums[3 + axis], 0.0)
                friction = box.lower_friction[axis]
                if inward < 0.0:
                    friction = box.upper_friction[axis]
                slide = wp.vec3(own[4], own[5], own[6]) + h * (a + pull)
                slide[axis] = 0.0
                speed = wp.length(slide)
                grip = wp.min(friction * normal, speed / h)
                a -= (grip / wp.max(speed, 1.0e-12)) * slide
                a[axis] = a[axis] + inward * normal
        if wp.static(tooled):
            a += by_tool(num, data, world, i, own, a + pull)
        data.acceleration[i] = a + pull

    return Pass(Smoothing, Forcing, width, 6, pair, finish, begin, seen, held)


@wp.kernel
def move(
    share: wp.vec3i,
    box: Box,
    spacing: float,
    capacity: int,
    count: wp.array(dtype=int),
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    force: wp.array(dtype=Force),
    held: wp.array(dtype=int),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    acceleration: wp.array(dtype=wp.vec3),
    new_density: wp.array(dtype=float),
    shift: wp.array(dtype=wp.vec3),
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    density: wp.array(dtype=float),
    carried_gradient: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
):
    """Symplectic Euler; a particle that would cross a wall stops at it.

    `carried_gradient` is half the density gradient of the pressure that carries the particle, rho^2 (g - a) / K: that
    of hydrostatic equilibrium for a liquid at rest (Fourtakas et al. 2019, Comput. Fluids 190:346), none in free fall.
    """
    i = index_of(share, wp.tid())
    world = i / capacity
    if i - world * capacity < count[world]:
        h = dt[world]
        v = velocity[i]
        carried = wp.vec3(0.0, 0.0, 0.0)
        if held[i] == FREE:
            v += h * acceleration[i]
            phase = phases[world, phase_of[i]]
            rest = rest_density(mass, volume, i)
            stiffness = 0.5 * rest * rest / phase.bulk_modulus
            carried = stiffness * (force_at(force[world], position[i]) - acceleration[i])
        carried_gradient[i] = carried
        free = position[i] + h * v
        if held[i] == FREE:
            free += shift[i]
        if too_fast(v, box.top_speed):
            raise_fault(fault, FAULT_ASTRAY)
        x = contained(box, free, WALL_INSET * spacing)
        for axis in range(3):
            if x[axis] != free[axis] and box.lower_kind[axis] != PERIODIC:
                v[axis] = 0.0
        position[i] = x
        velocity[i] = v
        density[i] = new_density[i]
