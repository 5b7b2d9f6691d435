"""Settling of SPH in Warp: two sums over neighbours between substeps, see settling.py."""

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.scene import Box, Phase, is_solid
from fluidbench.native.vector_access import store_vec4

from ..aging import GROWN
from ..bind import warp_func
from ..crowding import excess, out_of_crowd
from ..flow import shear_rate
from ..images import WALL_INSET, contained, image_gradient, mirroring_faces
from ..pairs import Pass, floats
from ..smoothing import wendland
from ..tool import Tool, felt, seen_by_tool
from . import settling
from .particle import PARTED, Smoothing, damped, slope
from .strain_warp import MATTER, seen_matter

wp.set_module_options({"enable_backward": False, "fast_math": True})

weight = warp_func(wendland)
leaning = warp_func(settling.leaning)
drift = warp_func(settling.drift)
heard = warp_func(settling.heard)
AVERAGED = settling.AVERAGED


def told_of(tensile: bool) -> int:
    """Floats of a row of `settle`: position, V0 | phi, l (3); of what cavitates also the shift out of crowds (3)."""
    return 8 if tensile else 12


@wp.struct
class Settling:
    """What both passes read and write of a particle itself; `position` is where `settle` puts it."""

    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    flowing: wp.array(dtype=float)
    told: wp.array(dtype=wp.vec4)  # rows of `settle`: see told_of
    density: wp.array(dtype=float)
    position: wp.array(dtype=wp.vec3)
    tool: Tool


def tell_pass(tensile: bool, tooled: bool) -> Pass:
    """How full each place is and to where it leans. Sums: r.grad W, grad W (3); of what cavitates crowding (3), and the
    velocity gradient (9), by which it shears: `strain` knows that of what carries tension.

    It is uncorrected, a free surface halves it. All relative motion, noise included, made noise feed on itself: rows on
    a slip wall were held up by shifting as fast as they fell. Walls crowd nobody, for the same reason.
    """
    sums_of, quads = 4 if tensile else 16, told_of(tensile) // 4
    Own, Other, Sums = floats(MATTER + 4), floats(MATTER), floats(sums_of)

    @wp.func
    def pair(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        w = slope(wp.length(r) / num.h, num.h) * other[3] / other[11]
        sums = Sums()
        sums[0] = -w * wp.dot(r, r)
        for a in range(3):
            sums[1 + a] = w * r[a]
        if wp.static(not tensile):
            crowd = excess(wp.length(r), num.h, num.near) * w
            u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
            for a in range(3):
                sums[4 + a] = crowd * r[a]
            for a in range(3):
                for b in range(3):
                    sums[7 + 3 * a + b] = -w * u[a] * r[b]
        return sums

    @wp.func
    def across(num: Smoothing, walls: wp.vec3, own: Own, other: Other, r: wp.vec3, sums: Sums):
        if wp.static(not tensile):
            crowds = 1.0 - wp.max(walls)
            for a in range(3):
                sums[4 + a] = crowds * sums[4 + a]
        return sums

    @wp.func
    def finish(num: Smoothing, box: Box, data: Settling, world: int, i: int, own: Own, sums: Sums):
        second = sums[0]
        lean = wp.vec3(sums[1], sums[2], sums[3])
        if wp.static(tooled):
            found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
            if found.on == 1:
                second -= wp.trace(found.second)
                lean += found.first
                if wp.static(not tensile):
                    u = seen_by_tool(data.tool, found, wp.vec3(own[4], own[5], own[6]))
                    for a in range(3):
                        for b in range(3):
                            sums[7 + 3 * a + b] -= u[a] * found.own[b]
        lean *= num.h
        filled = second * num.lattice / 3.0
        store_vec4(data.told, quads * i, wp.vec4(own[0], own[1], own[2], own[3] / own[11]))
        store_vec4(data.told, quads * i + 1, wp.vec4(filled, lean[0], lean[1], lean[2]))
        if wp.static(not tensile):
            gradient = wp.mat33(
                sums[7], sums[8], sums[9], sums[10], sums[11], sums[12], sums[13], sums[14], sums[15]
            )  # fmt: skip
            phase = data.phases[world, data.phase_of[i]]
            sheared = float(0.0)
            if data.held[i] != CARRIED and not is_solid(phase):
                sheared = shear_rate(gradient)
            data.flowing[i] = damped(num, phase, own[7], sheared)
            crowd = wp.vec3(sums[4], sums[5], sums[6])
            shift = out_of_crowd(crowd, num.h, PARTED * num.settling * sheared, num.farthest)
            store_vec4(data.told, quads * i + 2, wp.vec4(shift[0], shift[1], shift[2], 0.0))

    return Pass(
        Smoothing, Settling, MATTER, sums_of, pair, finish, seen=seen_matter, faces=mirroring_faces, across=across
    )


def settle_pass(tensile: bool) -> Pass:
    """The means, and what follows from them. Sums: V0 W, and that times phi, l (3) and |l|; of what cavitates also how
    it is shifted beside its neighbours (3): what they share would move a free surface, unseen by density."""
    TOLD = told_of(tensile)
    sums_of = 6 if tensile else 9
    Own, Other, Sums = floats(TOLD + 4), floats(TOLD), floats(sums_of)

    @wp.func
    def seen(box: Box, data: Settling, row: Other, j: int, code: int):
        lean = image_gradient(box, wp.vec3(row[5], row[6], row[7]), code)
        for axis in range(3):
            row[5 + axis] = lean[axis]
        if wp.static(not tensile):
            shift = image_gradient(box, wp.vec3(row[8], row[9], row[10]), code)
            for axis in range(3):
                row[8 + axis] = shift[axis]
        return row

    @wp.func
    def told_by(num: Smoothing, w: float, row: Other):
        sums = Sums()
        sums[0] = w
        for a in range(4):
            sums[1 + a] = w * row[4 + a]
        sums[5] = w * leaning(row[5] * row[5] + row[6] * row[6] + row[7] * row[7], num.disorder)
        return sums

    @wp.func
    def pair(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        length = wp.length(r)
        sums = told_by(num, other[3] * weight(length / num.h, num.h), other)
        if wp.static(not tensile):
            share = -num.evened * other[3] * slope(length / num.h, num.h)
            for a in range(3):
                sums[6 + a] = share * (own[8 + a] - other[8 + a])
        return sums

    @wp.func
    def finish(num: Smoothing, box: Box, data: Settling, world: int, i: int, own: Own, sums: Sums):
        phase = data.phases[world, data.phase_of[i]]
        rest = data.mass[i] / own[3]
        # halves of split particles lie in no order: what has grown is told of crowds alone (see particle.py)
        if data.held[i] == FREE and rest >= GROWN * phase.density and not is_solid(phase):
            mine = Other()
            for c in range(TOLD):
                mine[c] = own[c]
            sums += told_by(num, own[3] * weight(0.0, num.h), mine)
            filled = sums[1] / sums[0]
            mean = wp.vec3(sums[2], sums[3], sums[4]) / sums[0]
            lean = leaning(wp.dot(mean, mean), AVERAGED * num.disorder)
            rho = data.density[i]
            off = drift(filled - rho / rest, lean, sums[5] / sums[0], num.density_tolerance * num.disorder)
            if phase.relaxation_rate > 0.0:
                # in a stretched thread a pair too close reads as thin, and would be pulled closer
                off = wp.max(off, wp.min(1.0 - rho / rest, 0.0))
            data.density[i] = rho + rest * heard(filled) * wp.min(num.settling * data.flowing[i], 1.0) * off
        if wp.static(not tensile):
            if data.held[i] == FREE:
                free = wp.vec3(own[0] + sums[6], own[1] + sums[7], own[2] + sums[8])
                data.position[i] = contained(box, free, WALL_INSET * num.spacing)

    return Pass(Smoothing, Settling, TOLD, sums_of, pair, finish, seen=seen)
