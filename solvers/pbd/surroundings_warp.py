"""How matter lies about a particle of position-based dynamics, in Warp: how far others enclose it, what disorder adds
to the density that is read, and the fabric of the lines to its partners.

Any sum reads particles in disorder too dense, the more the sharper its kernel's peak; one that is flat where others
keep their distance does not, but would not see pairs. So what a particle reads beyond its neighbourhood is judged by
the sharp one, and the mean of a neighbourhood is brought to that of the flat one: `bias` divides the density
(constraints_warp.py).

What constraints push along lines to partners presses as the moment M of these does, the fabric: matter that is squeezed
has more of them along that axis, and so carries a share of its pressure by itself, as friction would: a column of paste
slumped as if it were up to a third stronger, at any spacing. Pushed along tr(M) / 3 M^-1 of those lines it is pressed
alike on all sides, as by a pressure in corrected gradients, and on the mean over the axes no harder. The two commute:
between partners of one density there is no torque.
"""

from dataclasses import replace
from typing import Any

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Box
from fluidbench.native.vector_access import store_vec4

from ..bind import warp_func
from ..corrected import SINGULAR, SOUND, least_eigenvalue, symmetric, symmetric_inverse
from ..pairs import Pass, floats
from ..smoothing import cusp, poly6, spiky_slope
from ..tool import Tool, felt
from .numbers import MOVING, Numbers

wp.set_module_options({"enable_backward": False, "fast_math": True})

gradient = warp_func(spiky_slope)
summed, flat = warp_func(cusp), warp_func(poly6)
vec9 = floats(9)


@wp.struct
class Surrounding:
    """What is written of a particle."""

    enclosure: wp.array(dtype=float)  # 0 at a free surface, 1 where others lie all round alike
    overread: wp.array(dtype=float)  # share by which disorder makes the density read too high; 0 at a free surface
    bias: wp.array(dtype=float)  # mean of that over the neighbours
    fabric_normal: wp.array(dtype=wp.vec3)  # tr(M) / 3 M^-1 of the moment M; 1 where neighbours are all round alike
    fabric_shear: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.struct
class Around:
    """The same, of one particle."""

    enclosure: float
    overread: float
    bias: float
    fabric_normal: wp.vec3
    fabric_shear: wp.vec3


@wp.kernel
def pack(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    velocity: wp.array(dtype=wp.vec3),
    overread: wp.array(dtype=float),
    # outputs
    moving: wp.array(dtype=wp.vec4),
):
    """Rows of velocities."""
    i = index_of(share, wp.tid())
    if i % capacity < count[i / capacity]:
        x, v = position[i], velocity[i]
        store_vec4(moving, 2 * i, wp.vec4(x[0], x[1], x[2], volume[i]))
        store_vec4(moving, 2 * i + 1, wp.vec4(v[0], v[1], v[2], overread[i]))


@wp.func
def sloping(num: Numbers, volume: float, r: wp.vec3):
    """V_j grad W"""
    distance = wp.length(r)
    return (volume * gradient(distance, num.support) / wp.max(distance, 1.0e-9)) * r


@wp.func
def counted(num: Numbers, volume: float):
    """Volume with which a particle counts in its own density [m^3]: its own by half, so that a lattice stretched by a
    percent sums as before."""
    return 0.5 * (volume + num.spacing * num.spacing * num.spacing)


@wp.func
def levels(num: Numbers, volume: float, overread: float, distance: float):
    """What a partner adds to the density by the sharp kernel and by the flat one, and to its over-reading."""
    level = volume * flat(distance, num.support)
    return wp.vec3(volume * summed(distance, num.support), level, level * overread)


@wp.func
def evenly(num: Numbers, moment: wp.mat33):
    """How far others lie all round alike [-], by the eigenvalues of the moment: near a surface a part of the support is
    empty, and what that takes from the density is no lack, for which a shell would be drawn together. Matter that is
    stretched evenly reads as it did."""
    trace = wp.max(wp.trace(moment), 1.0e-12)
    alike = 27.0 * wp.determinant(moment) / (trace * trace * trace)
    return wp.clamp((alike - num.uneven) / (num.even - num.uneven), 0.0, 1.0)


@wp.func
def surrounded(num: Numbers, volume: float, overread: float, moment: wp.mat33, correction: wp.mat33, found: wp.vec3):
    """A particle's surroundings, by the moment of its lines, the inverse of that, and its sums of `levels`."""
    own_level = volume * flat(0.0, num.support)
    level = found[1] + own_level
    dense = num.weight * (found[0] + counted(num, volume) * summed(0.0, num.support))
    least = least_eigenvalue(moment)
    evened = num.evened * wp.clamp((least - SINGULAR) / (SOUND - SINGULAR), 0.0, 1.0)
    scale, plain = evened * wp.trace(moment) / 3.0, 1.0 - evened
    around = Around()
    around.bias = (found[2] + own_level * overread) / level
    beyond_face = wp.clamp((least - num.face_moment) / (num.halfway - num.face_moment), 0.0, 1.0)
    around.enclosure = beyond_face * evenly(num, moment)
    around.overread = beyond_face * (dense / (num.flat_weight * level) - 1.0)
    around.fabric_normal = wp.vec3(plain, plain, plain) + scale * wp.get_diag(correction)
    around.fabric_shear = scale * wp.vec3(correction[0, 1], correction[0, 2], correction[1, 2])
    return around


@wp.func
def keep(data: Any, i: int, around: Around):
    data.enclosure[i] = around.enclosure
    data.overread[i] = around.overread
    data.bias[i] = around.bias
    data.fabric_normal[i] = around.fabric_normal
    data.fabric_shear[i] = around.fabric_shear


@wp.func
def surround_pair(num: Numbers, own: floats(MOVING + 4), other: floats(MOVING), r: wp.vec3):
    g = sloping(num, other[3], r)
    level = levels(num, other[3], other[7], wp.length(r))
    return vec9(
        -g[0] * r[0], -g[1] * r[1], -g[2] * r[2], -g[0] * r[1], -g[0] * r[2], -g[1] * r[2],
        level[0], level[1], level[2],
    )  # fmt: skip


@wp.func
def surround_finish(num: Numbers, box: Box, data: Surrounding, world: int, i: int, own: floats(MOVING + 4), sums: vec9):
    moment = symmetric(wp.vec3(sums[0], sums[1], sums[2]), wp.vec3(sums[3], sums[4], sums[5]))
    found = wp.vec3(sums[6], sums[7], sums[8])
    around = surrounded(num, own[3], own[7], moment, symmetric_inverse(moment), found)
    keep(data, i, around)


@wp.func
def tooled_surround_finish(
    num: Numbers, box: Box, data: Surrounding, world: int, i: int, own: floats(MOVING + 4), sums: vec9
):
    found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
    if found.on == 1:
        for a in range(3):
            sums[a] -= found.second[a, a]
        sums[3] -= found.second[0, 1]
        sums[4] -= found.second[0, 2]
        sums[5] -= found.second[1, 2]
    surround_finish(num, box, data, world, i, own, sums)
    if found.on == 1:
        data.overread[i] = 0.0  # the body fills a part of what its density is summed over


surround = Pass(Numbers, Surrounding, MOVING, 9, surround_pair, surround_finish)
"""Surroundings of liquids; what is elastic finds them with its strain (elastic_warp.py). Sums: moment (6), `levels`."""


def surroundings(tooled: bool) -> dict[str, Pass]:
    """The pass, beside a rigid body or without one."""
    return {"surround": replace(surround, finish=tooled_surround_finish) if tooled else surround}
