"""Elastic stress of position-based dynamics in Warp: strain by the common law at the end of a substep, and what its
stress makes of the next.

After XPBI (Yu et al. 2024, arXiv 2405.11694), constraints are on the velocity gradient and flow is part of them: the
stress at the end of a step is kept (s + 2 G dt dev D), s being that at its beginning and `kept` the share that flow
leaves of it, last seen. The first term is known, and pulls before density constraints push (`predict`). The second is a
viscosity, and is solved for with Newton's own (../viscosity.py) in place of sweeps over constraints: backward Euler,
stable at any stiffness. What pulls back strain that no gradient shows (../hourglass.py) is taken the same way.
"""

from dataclasses import replace
from typing import Any

import warp as wp

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.crew import index_of
from fluidbench.native.scene import Box, Phase, is_solid
from fluidbench.native.vector_access import store_vec4

from ..aging import rest_density
from ..bind import warp_func
from ..corrected import (
    SINGULAR,
    SOUND,
    elastic_stress,
    from_before,
    least_eigenvalue,
    mirrored_stress,
    spanned,
    strain_by_chords,
    symmetric,
    symmetric_inverse,
)
from ..flow import pressure, strained
from ..hourglass import off_linear
from ..images import image_traction, image_velocity
from ..pairs import Pass, floats
from ..smoothing import cusp, drag_weight, poly6, spiky_slope
from ..tool import Tool, felt, seen_by_tool
from .numbers import MOVING, PULLING, Numbers

wp.set_module_options({"enable_backward": False, "fast_math": True})

gradient, weight = warp_func(spiky_slope), warp_func(drag_weight)
summed, flat = warp_func(cusp), warp_func(poly6)
vec24 = floats(24)


@wp.struct
class Straining:
    """What the passes read and write of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    volume: wp.array(dtype=float)
    volume_ratio: wp.array(dtype=float)
    elastic_normal: wp.array(dtype=wp.vec3)
    elastic_shear: wp.array(dtype=wp.vec3)
    off_linear: wp.array(dtype=wp.vec3)
    plastic: wp.array(dtype=float)  # strain; one zero where nothing hardens
    kept: wp.array(dtype=float)
    enclosure: wp.array(dtype=float)  # 0 at a free surface, 1 from halfway to within on
    overread: wp.array(dtype=float)  # share by which disorder makes the density read too high, times enclosure
    bias: wp.array(dtype=float)  # mean of that over the neighbours
    fabric_normal: wp.array(dtype=wp.vec3)  # tr(M) / 3 M^-1 of the moment M; 1 where neighbours are all round alike
    fabric_shear: wp.array(dtype=wp.vec3)
    pulling: wp.array(dtype=wp.vec4)
    pulled: wp.array(dtype=wp.vec3)
    tool: Tool


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
def holding(num: Numbers, volume: float, r: wp.vec3):
    """V_j w, by which a pair counts in hourglass control"""
    return volume * weight(wp.length(r) / num.support, num.support)


@wp.func
def counted(num: Numbers, volume: float):
    """Volume with which a particle counts in its own density [m^3]: its own by half, so that a lattice stretched by a
    percent sums as before."""
    return 0.5 * (volume + num.spacing * num.spacing * num.spacing)


@wp.func
def seen_moving(box: Box, data: Straining, row: floats(MOVING), j: int, code: int):
    v = image_velocity(box, wp.vec3(row[4], row[5], row[6]), code)
    for axis in range(3):
        row[4 + axis] = v[axis]
    return row


@wp.func
def strain_pair(num: Numbers, own: floats(MOVING + 4), other: floats(MOVING), r: wp.vec3):
    g = sloping(num, other[3], r)
    w = holding(num, other[3], r)
    distance = wp.length(r)
    level = other[3] * flat(distance, num.support)
    u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
    return vec24(
        -u[0] * g[0], -u[0] * g[1], -u[0] * g[2],
        -u[1] * g[0], -u[1] * g[1], -u[1] * g[2],
        -u[2] * g[0], -u[2] * g[1], -u[2] * g[2],
        -g[0] * r[0], -g[1] * r[1], -g[2] * r[2], -g[0] * r[1], -g[0] * r[2], -g[1] * r[2],
        w * r[0], w * r[1], w * r[2], w * u[0], w * u[1], w * u[2],
        other[3] * summed(distance, num.support), level, level * other[7],
    )  # fmt: skip


@wp.func
def strain_finish(num: Numbers, box: Box, data: Straining, world: int, i: int, own: floats(MOVING + 4), sums: vec24):
    phase = data.phases[world, data.phase_of[i]]
    h = data.dt[world]
    stress, back = wp.mat33(), wp.vec3()
    if phase.shear_modulus > 0.0:
        moment = symmetric(wp.vec3(sums[9], sums[10], sums[11]), wp.vec3(sums[12], sums[13], sums[14]))
        correction = symmetric_inverse(moment)
        slope = wp.mat33(
            sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8]
        )  # fmt: skip
        slope = slope * correction
        span = spanned(moment, correction)
        seen = span * slope
        slope = from_before(strain_by_chords(span, slope, h), seen, h)
        b = data.elastic_normal[i]
        s = data.elastic_shear[i]
        # the gradient of a straggler is not exact even in a linear flow
        least = least_eigenvalue(moment)
        whole = float(least >= SOUND)
        leaning = wp.vec3(sums[15], sums[16], sums[17])
        q = whole * (wp.vec3(sums[18], sums[19], sums[20]) - seen * leaning)
        z = whole * data.off_linear[i]
        ratio = data.volume_ratio[i]
        push = float(0.0)
        if data.held[i] != CARRIED:
            b, s, kept = strained(phase, phase.shear_modulus, slope, b, s, h, i, data.plastic)
            data.elastic_normal[i] = b
            data.elastic_shear[i] = s
            data.kept[i] = kept
            z = off_linear(z, seen, q, kept, h)
            data.off_linear[i] = z
            if is_solid(phase):
                ratio *= wp.determinant(wp.identity(n=3, dtype=float) + h * slope)
                data.volume_ratio[i] = ratio
        if is_solid(phase):
            push = ratio * pressure(1.0 / ratio - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
        own_level = own[3] * flat(0.0, num.support)
        level = sums[22] + own_level
        dense = num.weight * (sums[21] + counted(num, own[3]) * summed(0.0, num.support))
        data.bias[i] = (sums[23] + own_level * own[7]) / level
        data.enclosure[i] = wp.clamp((least - num.face_moment) / (num.halfway - num.face_moment), 0.0, 1.0)
        evened = num.evened * wp.clamp((least - SINGULAR) / (SOUND - SINGULAR), 0.0, 1.0)
        scale, plain = evened * wp.trace(moment) / 3.0, 1.0 - evened
        data.fabric_normal[i] = wp.vec3(plain, plain, plain) + scale * wp.get_diag(correction)
        data.fabric_shear[i] = scale * wp.vec3(correction[0, 1], correction[0, 2], correction[1, 2])
        data.overread[i] = data.enclosure[i] * (dense / (num.flat_weight * level) - 1.0)
        modulus = data.kept[i] * phase.shear_modulus
        # where matter is packed more densely q is larger for the same motion, and so is what the traction does
        packing = wp.max(num.lattice * wp.trace(moment) / 3.0, 1.0)
        back = (modulus * num.hourglass / (packing * packing)) * z
        stress = span * (elastic_stress(modulus, b, s, push) - wp.outer(back, leaning)) * correction
    store_vec4(data.pulling, 4 * i, wp.vec4(own[0], own[1], own[2], own[3]))
    store_vec4(data.pulling, 4 * i + 1, wp.vec4(stress[0, 0], stress[0, 1], stress[0, 2], stress[1, 0]))
    store_vec4(data.pulling, 4 * i + 2, wp.vec4(stress[1, 1], stress[1, 2], stress[2, 0], stress[2, 1]))
    store_vec4(data.pulling, 4 * i + 3, wp.vec4(stress[2, 2], back[0], back[1], back[2]))


@wp.func
def tooled_strain_finish(
    num: Numbers, box: Box, data: Straining, world: int, i: int, own: floats(MOVING + 4), sums: vec24
):
    found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
    if found.on == 1:
        u = seen_by_tool(data.tool, found, wp.vec3(own[4], own[5], own[6]))
        for a in range(3):
            for b in range(3):
                sums[3 * a + b] -= u[a] * found.own[b]
            sums[9 + a] -= found.second[a, a]
        sums[12] -= found.second[0, 1]
        sums[13] -= found.second[0, 2]
        sums[14] -= found.second[1, 2]
    strain_finish(num, box, data, world, i, own, sums)
    if found.on == 1:
        data.overread[i] = 0.0  # the body fills a part of what its density is summed over


strain = Pass(Numbers, Straining, MOVING, 24, strain_pair, strain_finish, seen=seen_moving)
"""Elastic strain after the substep by the common law, and its stress times the correction of gradients. The volume of
what flows is the density constraint's; only a solid's is elastic. Sums: velocity gradient (9), moment (6); weighed for
hourglass control the places of partners (3), and the motion off their mean (3); the density by two kernels, and by how
much partners over-read it.

Any sum reads particles in disorder too dense, the more the sharper its kernel's peak; one that is flat where others
keep their distance does not, but would not see pairs. So what a particle reads beyond its neighbourhood is judged by
the sharp one, and the mean of a neighbourhood is brought to that of the flat one: `bias` divides the density
(constraints_warp.py).

What constraints push along lines to partners presses as the moment M of these does, the fabric: matter that is squeezed
has more of them along that axis, and so carries a share of its pressure by itself, as friction would: a column of paste
slumped as if it were up to a third stronger, at any spacing. Pushed along tr(M) / 3 M^-1 of those lines it is pressed
alike on all sides, as by a pressure in corrected gradients, and on the mean over the axes no harder. The two commute:
between partners of one density there is no torque."""


@wp.func
def stress_of(row: Any, first: int):
    return wp.mat33(
        row[first], row[first + 1], row[first + 2],
        row[first + 3], row[first + 4], row[first + 5],
        row[first + 6], row[first + 7], row[first + 8],
    )  # fmt: skip


@wp.func
def seen_pulling(box: Box, data: Straining, row: floats(PULLING), j: int, code: int):
    t = mirrored_stress(box, stress_of(row, 4), code)
    for a in range(3):
        for b in range(3):
            row[4 + 3 * a + b] = t[a, b]
    back = image_traction(box, wp.vec3(row[13], row[14], row[15]), code)
    for axis in range(3):
        row[13 + axis] = back[axis]
    return row


@wp.func
def pull_pair(num: Numbers, own: floats(PULLING + 4), other: floats(PULLING), r: wp.vec3):
    back = wp.vec3(other[13] - own[13], other[14] - own[14], other[15] - own[15])
    return (stress_of(own, 4) + stress_of(other, 4)) * sloping(num, other[3], r) + holding(num, other[3], r) * back


@wp.func
def pull_finish(num: Numbers, box: Box, data: Straining, world: int, i: int, own: floats(PULLING + 4), sums: wp.vec3):
    if data.held[i] == FREE:
        data.pulled[i] = sums / rest_density(data.mass, data.volume, i)


@wp.func
def tooled_pull_finish(
    num: Numbers, box: Box, data: Straining, world: int, i: int, own: floats(PULLING + 4), sums: wp.vec3
):
    found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
    pulled = 2.0 * stress_of(own, 4) * found.first
    if data.tool.slips == 1:
        pulled = wp.dot(pulled, found.normal) * found.normal
    pull_finish(num, box, data, world, i, own, sums + pulled)


pull = Pass(Numbers, Straining, PULLING, 3, pull_pair, pull_finish, seen=seen_pulling)
"""Acceleration by the stress of the particle and its neighbours, and by what pulls back."""

KERNELS = (pack,)


def elastic(tooled: bool) -> dict[str, Pass]:
    """The passes, beside a rigid body or without one."""
    if not tooled:
        return {"strain": strain, "pull": pull}
    return {"strain": replace(strain, finish=tooled_strain_finish), "pull": replace(pull, finish=tooled_pull_finish)}
