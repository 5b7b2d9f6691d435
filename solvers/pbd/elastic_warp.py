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
from fluidbench.native.scene import Box, Phase, is_solid
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
    symmetric,
    symmetric_inverse,
)
from ..flow import pressure, strained
from ..hourglass import off_linear
from ..images import image_traction, image_velocity
from ..pairs import Pass, floats
from ..smoothing import drag_tail, drag_weight
from ..tool import Tool, felt, seen_by_tool
from .numbers import MOVING, PULLING, Numbers
from .surroundings_warp import keep, levels, sloping, surrounded

wp.set_module_options({"enable_backward": False, "fast_math": True})

weight = warp_func(drag_weight, drag_tail)
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
    enclosure: wp.array(dtype=float)  # this and the next four: surroundings_warp.py
    overread: wp.array(dtype=float)
    bias: wp.array(dtype=float)
    fabric_normal: wp.array(dtype=wp.vec3)
    fabric_shear: wp.array(dtype=wp.vec3)
    pulling: wp.array(dtype=wp.vec4)
    pulled: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.func
def holding(num: Numbers, volume: float, r: wp.vec3):
    """V_j w, by which a pair counts in hourglass control"""
    return volume * weight(wp.length(r) / num.support, num.support)


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
    level = levels(num, other[3], other[7], wp.length(r))
    u = wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
    return vec24(
        -u[0] * g[0], -u[0] * g[1], -u[0] * g[2],
        -u[1] * g[0], -u[1] * g[1], -u[1] * g[2],
        -u[2] * g[0], -u[2] * g[1], -u[2] * g[2],
        -g[0] * r[0], -g[1] * r[1], -g[2] * r[2], -g[0] * r[1], -g[0] * r[2], -g[1] * r[2],
        w * r[0], w * r[1], w * r[2], w * u[0], w * u[1], w * u[2],
        level[0], level[1], level[2],
    )  # fmt: skip


@wp.func
def strain_finish(num: Numbers, box: Box, data: Straining, world: int, i: int, own: floats(MOVING + 4), sums: vec24):
    phase = data.phases[world, data.phase_of[i]]
    h = data.dt[world]
    stress, back = wp.mat33(), wp.vec3()
    moment = symmetric(wp.vec3(sums[9], sums[10], sums[11]), wp.vec3(sums[12], sums[13], sums[14]))
    correction = symmetric_inverse(moment)
    around = surrounded(num, own[3], own[7], moment, correction, wp.vec3(sums[21], sums[22], sums[23]))
    keep(data, i, around)
    if phase.shear_modulus > 0.0:
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
        whole = float(least_eigenvalue(moment) >= SOUND)
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
much partners over-read it."""


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


def elastic(tooled: bool) -> dict[str, Pass]:
    """The passes, beside a rigid body or without one."""
    if not tooled:
        return {"strain": strain, "pull": pull}
    return {"strain": replace(strain, finish=tooled_strain_finish), "pull": replace(pull, finish=tooled_pull_finish)}
