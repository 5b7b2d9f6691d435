"""The first sum over neighbours of SPH: continuity, velocity gradient, strain and stress."""

from typing import Any

import warp as wp

from fluidbench.method.frame import CARRIED
from fluidbench.native.crew import raise_fault
from fluidbench.native.pool import FAULT_STATE
from fluidbench.native.scene import Box, Phase, is_solid
from fluidbench.native.vector_access import store_vec4

from ..aging import GROWN
from ..corrected import (
    SOUND,
    elastic_stress,
    enclosed,
    from_before,
    least_eigenvalue,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)
from ..crowding import excess, out_of_crowd
from ..flow import pressure, shear_rate, strained
from ..hourglass import off_linear
from ..images import image_gradient, image_velocity, turned_back
from ..pairs import Pass, floats
from ..tool import Tool, felt, seen_by_tool
from ..viscosity_warp import weight
from .force_warp import width_of
from .particle import FARTHEST, LEVELLED, THINNEST, Smoothing, broken, crowded, damped, pulled_back, slope, straggling

wp.set_module_options({"enable_backward": False, "fast_math": True})

FLOOR = wp.constant(0.1)  # least density over that at rest
CRUSHED = wp.constant(1.0e3)  # density over that at rest that no matter reaches

# Rows of `strain`: position, mass | velocity, density | carried gradient, rest density.
MATTER = 12


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
    carried_gradient: wp.array(dtype=wp.vec3)  # of what carries tension [kg/m^4]
    flowing: wp.array(dtype=float)  # rate of shear of what flows, which settles [1/s]
    fault: wp.array(dtype=int)
    tool: Tool


@wp.func
def seen_matter(box: Box, data: Any, row: floats(MATTER), j: int, code: int):
    """A row of `strain` in the walls."""
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    g = image_gradient(box, wp.vec3(row[8], row[9], row[10]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
        row[8 + axis] = g[axis]
    return row


def strain_pass(strength: bool, tensile: bool, viscous: bool, changing: bool, tooled: bool) -> Pass:
    """Continuity with density diffusion (Monaghan 2005, eq. 2.17; Antuono et al. 2010), then the material law.

    Diffusion must not level the gradient that carries pressure, which is `carried_gradient` from both partners: of what
    cavitates by its acceleration (see `move`), of what carries tension, whose shear stress carries as well, half the
    corrected gradient of density itself (Antuono et al. 2010), and it levels no faster than `LEVELLED` times the shear
    and the growth that make its noise. Sums: diffusion; of what cavitates the inflow and the second moment's trace; of
    what carries tension the velocity gradient (9), the second moment (xx yy zz xy xz yz), the gradient of density (3)
    and crowding (3), of what has strength also the motion off the mean of the neighbours (3) and the first moment (3);
    where viscosity is explicit, last, fullness (viscosity.py).

    A plain sum takes it for expansion when a particle comes to the surface, out of a bore: tension pulled the skin of
    strands together by a fifth. A liquid that cavitates feels none, and needs no correction.
    """
    FULL = 28 if strength else 22 if tensile else 3
    many = FULL + viscous
    state_of, plain = (width_of(strength, tensile, *more) // 4 for more in ((viscous, changing), (False, False)))
    Own, Other, Sums = floats(MATTER + 4), floats(MATTER), floats(many)

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
        sums = Sums()
        sums[0] = spread
        if wp.static(tensile):
            crowd = excess(wp.sqrt(r2), num.h, num.near) * m
            for a in range(3):
                for b in range(3):
                    sums[1 + 3 * a + b] = -u[a] * m[b]
            for a in range(3):
                sums[10 + a] = -m[a] * r[a]
            sums[13] = -m[0] * r[1]
            sums[14] = -m[0] * r[2]
            sums[15] = -m[1] * r[2]
            for a in range(3):
                sums[16 + a] = (partner - own[7]) * m[a]
                sums[19 + a] = crowd[a]
        else:
            sums[1] = wp.dot(u, m)
            sums[2] = -w * r2
        if wp.static(strength):
            for a in range(3):
                sums[22 + a] = w * u[a]
                sums[25 + a] = m[a]
        if wp.static(viscous):
            sums[FULL] = other[3] / other[11] * weight(0.5 * wp.sqrt(r2) / num.h, 2.0 * num.h) * r2 / 3.0
        return sums

    @wp.func
    def across(num: Smoothing, back: wp.vec3, own: Own, other: Other, r: wp.vec3, sums: Sums):
        w = other[3] * slope(wp.length(r) / num.h, num.h)
        if wp.static(changing):
            w *= own[11] / other[11]
        m = w * wp.cw_mul(back, r)
        v = wp.vec3(other[4], other[5], other[6])
        if wp.static(tensile):
            for a in range(3):
                for b in range(3):
                    sums[1 + 3 * a + b] -= v[a] * m[b]
        else:
            sums[1] += wp.dot(v, m)
        return sums

    @wp.func
    def into_tool(tool: Tool, own: Own, sums: Sums):
        """The sums, gone on with into a rigid body (../tool_map.py)."""
        found = felt(tool, wp.vec3(own[0], own[1], own[2]))
        if found.on == 1:
            rho = own[7]
            u = rho * seen_by_tool(tool, found, wp.vec3(own[4], own[5], own[6]))
            if wp.static(tensile):
                for a in range(3):
                    for b in range(3):
                        sums[1 + 3 * a + b] -= u[a] * found.own[b]
                for a in range(3):
                    sums[10 + a] -= rho * found.second[a, a]
                sums[13] -= rho * found.second[0, 1]
                sums[14] -= rho * found.second[0, 2]
                sums[15] -= rho * found.second[1, 2]
            else:
                sums[1] += wp.dot(u, found.own)
                sums[2] -= rho * wp.trace(found.second)
            if wp.static(strength):
                for a in range(3):
                    sums[22 + a] += u[a] * found.zeroth
                    sums[25 + a] += rho * found.first[a]
            if wp.static(viscous):
                sums[FULL] += found.full
        return sums

    @wp.func
    def finish(num: Smoothing, box: Box, data: Straining, world: int, i: int, own: Own, sums: Sums):
        phase = data.phases[world, data.phase_of[i]]
        h = data.dt[world]
        rho = own[7]
        rest, sound, grown = float(phase.density), float(phase.wave_speed), bool(False)
        if wp.static(changing):
            rest = own[11]
            grown = rest < GROWN * phase.density
            sound = phase.wave_speed * wp.sqrt(phase.density / rest)
        if wp.static(tooled):
            sums = into_tool(data.tool, own, sums)
        spread = sums[0]
        second, inflow, sheared = float(sums[2]), float(sums[1]), float(0.0)
        least, alone = float(0.0), float(0.0)
        flows = bool(True)
        deformation, correction, span, gradient = wp.mat33(), wp.mat33(), wp.mat33(), wp.mat33()
        if wp.static(tensile):
            # density from the corrected gradient, too: the same strain for pressure and for shear
            moment = wp.mat33(
                sums[10], sums[13], sums[14], sums[13], sums[11], sums[15], sums[14], sums[15], sums[12]
            )  # fmt: skip
            second = wp.trace(moment)
            correction = symmetric_inverse(moment / rho)
            gradient = wp.mat33(
                sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8], sums[9]
            ) / rho * correction  # fmt: skip
            span = spanned(moment / rho, correction)
            deformation = strain_by_chords(span, gradient, h)
            gradient = span * gradient
            inflow = -rho * wp.trace(deformation)
            data.carried_gradient[i] = (0.5 / rho) * (correction * wp.vec3(sums[16], sums[17], sums[18]))
            least = least_eigenvalue(moment / rho)
            sheared = shear_rate(gradient)
        if wp.static(strength):
            first_moment = wp.vec3(sums[25], sums[26], sums[27])
            b = data.elastic_normal[i]
            s = data.elastic_shear[i]
            # the gradient of a straggler is not exact even in a linear flow
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
        flows = flows and not is_solid(phase)
        if wp.static(tensile):
            data.flowing[i] = wp.where(flows and data.held[i] != CARRIED, damped(num, phase, rho, sheared), 0.0)
            crowd = wp.vec3(sums[19], sums[20], sums[21])
            if wp.static(strength):
                if flows:
                    crowd += enclosed(least) * first_moment
            crowd /= rho
            if not flows:
                crowd = broken(crowd, num.broken)
            data.shift[i] = out_of_crowd(crowd, num.h, num.shifting * h * sheared, FARTHEST)
        if flows or grown:
            # Where fresh foam rises against cured foam neither flows, and they came to lie within each other with no
            # pressure to say so.
            inflow += num.density_feedback * sound / num.h * crowded(num, rho, second)
        if flows:
            rate = num.density_diffusion * sound / num.h
            if wp.static(tensile):
                stirred = float(sheared)
                if wp.static(changing):
                    stirred += data.growth[i]
                rate = wp.min(rate, LEVELLED * stirred)
            inflow += 2.0 * num.h * num.h * rate * spread / rho
        rho += h * inflow
        if not (rho > -rest and rho < CRUSHED * rest):
            raise_fault(data.fault, FAULT_STATE)
        rho = wp.max(rho, FLOOR * rest)
        data.new_density[i] = rho
        p = pressure(rho / rest - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
        scale = 1.0 / (rho * rho)
        if wp.static(changing):
            scale *= rest  # over that of the partner: see `force_pass`
        stress = wp.diag(wp.vec3(-p, -p, -p))
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
            stress = elastic_stress(g, b, s, p) - wp.outer(pull, first_moment / own[7])
            pull *= scale
            store_vec4(data.state, at + 4, wp.vec4(pull[0], pull[1], pull[2], alone))
        if wp.static(tensile):
            # With the correction of its gradient stress does on the particles exactly the work of the strain.
            t = scale * (span * stress * correction)
            store_vec4(data.state, at + 1, wp.vec4(own[4], own[5], own[6], t[0, 0]))
            store_vec4(data.state, at + 2, wp.vec4(t[0, 1], t[0, 2], t[1, 0], t[1, 1]))
            store_vec4(data.state, at + 3, wp.vec4(t[1, 2], t[2, 0], t[2, 1], t[2, 2]))
        else:
            store_vec4(data.state, at + 1, wp.vec4(own[4], own[5], own[6], scale * p))
        if wp.static(changing):
            store_vec4(data.state, at + plain, wp.vec4(rho, rest, phase.viscosity, sound))
        if wp.static(viscous):
            growth = float(0.0)
            if wp.static(changing):
                growth = data.growth[i]
            store_vec4(
                data.state, at + state_of - 1, wp.vec4(1.0 / wp.sqrt(wp.max(sums[FULL], THINNEST)), growth, 0.0, 0.0)
            )

    return Pass(Smoothing, Straining, MATTER, many, pair, finish, seen=seen_matter, faces=turned_back, across=across)
