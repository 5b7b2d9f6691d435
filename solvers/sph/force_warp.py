"""The second sum over neighbours of SPH: what pushes and drags."""

import warp as wp

from fluidbench.native.scene import Box, Force, Phase, force_at

from ..corrected import mirrored_stress
from ..images import image_traction, image_velocity, kinds_of_faces
from ..pairs import Pass, floats
from ..tool import Tool, felt
from ..viscosity_warp import dragging, shared
from .particle import Smoothing, slope

wp.set_module_options({"enable_backward": False, "fast_math": True})


def width_of(strength: bool, tensile: bool, viscous: bool, changing: bool) -> int:
    """Floats of a row of `force`: position, mass | velocity, then the pressure term; of what carries tension instead
    of that its stress (9), of what has strength also the traction that pulls back (3) and
    how far it is a straggler. Where partners differ also density, rest density, viscosity, sound; where viscosity is
    explicit one over the root of the fullness and the growth, two of none."""
    return (20 if strength else 16 if tensile else 8) + 4 * changing + 4 * viscous


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


def force_pass(strength: bool, tensile: bool, viscous: bool, changing: bool, tooled: bool) -> Pass:
    """Momentum: pressure or stress, artificial and Newtonian viscosity (that of viscosity.py, explicit). Sums: what
    pushes (3), and what pushes across friction walls (3), which never pull and rub by Coulomb's law."""
    N = width = width_of(strength, tensile, viscous, changing)
    LAST = width_of(strength, tensile, False, False)
    DRAGS = width - 4
    Own, Other, Sums = floats(width + 4), floats(width), floats(6)

    @wp.func
    def begin(num: Smoothing, data: Forcing, world: int, i: int):
        """The coefficient of artificial viscosity, Newtonian viscosity and volume at rest, where all are alike."""
        phase = data.phases[world, data.phase_of[i]]
        # At rest density: both partners must find the same force, and a cavitated liquid, whose density is low, would
        # break the bound on dt. Monaghan 1992: alpha h c / rho
        shock = num.artificial_viscosity * num.h * phase.wave_speed / phase.density
        return wp.vec4(shock, phase.viscosity, 1.0 / phase.density, 0.0)

    @wp.func
    def drag_of(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        """Acceleration by a partner over -(r (r . u) + s (s . u)), see viscosity.py."""
        mu, volume, per_rest = own[N + 1], other[3] * own[N + 2], own[N + 2]
        if wp.static(changing):
            mu = shared(own[LAST + 2], other[LAST + 2])
            volume, per_rest = other[3] / other[LAST + 1], 1.0 / own[LAST + 1]
        return own[DRAGS] * other[DRAGS] * per_rest * dragging(mu, wp.dot(r, r), 2.0 * num.h, volume)

    @wp.func
    def apart(own: Own, other: Other, r: wp.vec3):
        """How fast two move apart beyond what growth moves them."""
        u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
        if wp.static(changing):
            u -= (own[DRAGS + 1] + other[DRAGS + 1]) / 6.0 * r
        return u

    @wp.func
    def seen(box: Box, data: Forcing, row: Other, j: int, code: int):
        v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
        for axis in range(3):
            row[4 + axis] = v[axis]
        if wp.static(tensile):
            t = wp.mat33(row[7], row[8], row[9], row[10], row[11], row[12], row[13], row[14], row[15])
            t = mirrored_stress(box, t, code)
            for a in range(3):
                for b in range(3):
                    row[7 + 3 * a + b] = t[a, b]
        if wp.static(strength):
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
        shock = float(own[N])
        mine, theirs = float(1.0), float(1.0)
        if wp.static(changing):
            # Stress over rho_i^2 rho0_j / rho0_i: light matter must not feel its heavy partner's mass, and the strain's
            # sums, which are over those volumes, too, find the work that this does.
            mine, theirs = 1.0 / other[LAST + 1], 1.0 / own[LAST + 1]
            # both partners must find the same force: means of what differs between them
            fast = own[LAST + 3] + other[LAST + 3]
            shock = 0.5 * num.artificial_viscosity * num.h * fast / wp.max(own[LAST], other[LAST])
        along = float(0.0)
        push = wp.vec3(0.0, 0.0, 0.0)
        if wp.static(tensile):
            both = wp.mat33(
                mine * own[7] + theirs * other[7], mine * own[8] + theirs * other[8], mine * own[9] + theirs * other[9],
                mine * own[10] + theirs * other[10],
                mine * own[11] + theirs * other[11],
                mine * own[12] + theirs * other[12],
                mine * own[13] + theirs * other[13],
                mine * own[14] + theirs * other[14],
                mine * own[15] + theirs * other[15],
            )  # fmt: skip
            push = both * r
        else:
            along = -(mine * own[7] + theirs * other[7])
        if wp.static(strength):
            push += wp.vec3(
                theirs * other[16] - mine * own[16],
                theirs * other[17] - mine * own[17],
                theirs * other[18] - mine * own[18],
            )
            along += wp.max(own[19], other[19]) * shock * ur / (r2 + tiny)
        else:
            # artificial viscosity for approaching particles (Monaghan 1992)
            along += shock * wp.min(ur, 0.0) / (r2 + tiny)
        push = f * (push + along * r)
        if wp.static(viscous):
            push -= 2.0 * drag_of(num, own, other, r) * wp.dot(r, apart(own, other, r)) * r
        sums = Sums()
        for a in range(3):
            sums[a] = push[a]
        return sums

    @wp.func
    def across(num: Smoothing, kinds: wp.vec3, own: Own, other: Other, r: wp.vec3, sums: Sums):
        if wp.static(viscous):
            s = r
            for a in range(3):
                s[a] = wp.where(kinds[a] < 0.0, -r[a], r[a])
            u = apart(own, other, r)
            turned = drag_of(num, own, other, r) * (wp.dot(r, u) * r - wp.dot(s, u) * s)
            for a in range(3):
                sums[a] += turned[a]
        for a in range(3):
            sums[3 + a] = wp.max(kinds[a], 0.0) * sums[a]
            sums[a] = sums[a] - sums[3 + a]
        return sums

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
            if wp.static(tensile):
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
                drag = 10.0 * phase.viscosity * own[DRAGS] * own[DRAGS] / rest
                u = wp.vec3(own[4], own[5], own[6]) + h * (a + others) - found.velocity
                still = wp.identity(n=3, dtype=float) + (h * drag) * found.drag
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

    return Pass(Smoothing, Forcing, width, 6, pair, finish, begin, seen, kinds_of_faces, across)
