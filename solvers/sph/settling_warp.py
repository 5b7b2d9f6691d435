"""Settling of SPH in Warp: two sums over neighbours between substeps, see settling.py."""

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.scene import Box, Phase, is_solid
from fluidbench.native.vector_access import store_vec4

from ..aging import GROWN
from ..bind import warp_func
from ..images import image_gradient
from ..pairs import Pass, floats
from ..smoothing import wendland
from ..tool import Tool, felt
from . import settling
from .particle import Smoothing, slope
from .strain_warp import MATTER

wp.set_module_options({"enable_backward": False, "fast_math": True})

weight = warp_func(wendland)
leaning = warp_func(settling.leaning)
drift = warp_func(settling.drift)
heard = warp_func(settling.heard)
AVERAGED, TOLD = settling.AVERAGED, settling.TOLD


@wp.struct
class Settling:
    """What both passes read and write of a particle itself."""

    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    flowing: wp.array(dtype=float)
    told: wp.array(dtype=wp.vec4)  # rows of `settle`: see TOLD
    density: wp.array(dtype=float)
    tool: Tool


def tell_pass(tooled: bool) -> Pass:
    """How full each place is and to where it leans. Sums: r.grad W, grad W (3)."""
    Own, Other, Sums = floats(MATTER + 4), floats(MATTER), floats(4)

    @wp.func
    def pair(num: Smoothing, own: Own, other: Other, r: wp.vec3):
        w = slope(wp.length(r) / num.h, num.h) * other[3] / other[11]
        sums = Sums()
        sums[0] = -w * wp.dot(r, r)
        for a in range(3):
            sums[1 + a] = w * r[a]
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
        lean *= num.h
        filled = second * num.lattice / 3.0
        store_vec4(data.told, 2 * i, wp.vec4(own[0], own[1], own[2], own[3] / own[11]))
        store_vec4(data.told, 2 * i + 1, wp.vec4(filled, lean[0], lean[1], lean[2]))

    return Pass(Smoothing, Settling, MATTER, 4, pair, finish)


@wp.func
def seen_told(box: Box, data: Settling, row: floats(TOLD), j: int, code: int):
    """A row of `settle` in the walls."""
    lean = image_gradient(box, wp.vec3(row[5], row[6], row[7]), code)
    for axis in range(3):
        row[5 + axis] = lean[axis]
    return row


def settle_pass() -> Pass:
    """The means, and what follows from them. Sums: V0 W, and that times phi, l (3) and |l|."""
    Own, Other, Sums = floats(TOLD + 4), floats(TOLD), floats(6)

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
        return told_by(num, other[3] * weight(wp.length(r) / num.h, num.h), other)

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

    return Pass(Smoothing, Settling, TOLD, 6, pair, finish, seen=seen_told)
