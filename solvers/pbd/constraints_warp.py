"""The constraints of position-based fluids (Macklin & Mueller 2013, ACM TOG 32:104) in Warp: nothing is denser than at
rest, what carries tension is no less dense within, and no two are too near."""

from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.scene import Box, Phase, is_solid
from fluidbench.native.vector_access import store_vec4

from ..corrected import symmetric
from ..images import image_gradient
from ..pairs import Pass, floats
from ..tool import Tool, felt
from .numbers import PLACE, Numbers, push_row
from .surroundings_warp import counted, flat, gradient, sloping, summed

wp.set_module_options({"enable_backward": False, "fast_math": True})

vec5 = floats(5)

CROWDED = wp.constant(0.25)  # excess of density that is pushed apart at once: limits moves, and momentum stays
NEAREST = wp.constant(0.5)  # spacings that two keep apart: density alone lets them pair
PARTED = wp.constant(0.5)  # share of what two are too near that a correction takes away
SLACK_SOLID = wp.constant(0.1)  # a solid's bulk modulus keeps its density; the constraint only keeps its parts apart
SCARCE = wp.constant(1.0e-6)  # density of what is enclosed, over that at rest, that is none
# Of a mean lack of density, in an iteration: a lattice's stiffest wave goes by 1.2 of a whole (by its own lack by 1.8),
# and what answers an iteration late holds below 1.
DRAWN = wp.constant(0.5)


@wp.struct
class Constraining:
    """What the constraints read and write of a particle itself."""

    dt: wp.array(dtype=float)
    phases: wp.array2d(dtype=Phase)
    phase_of: wp.array(dtype=int)
    held: wp.array(dtype=int)
    mass: wp.array(dtype=float)
    motion: wp.array(dtype=wp.vec3)
    pushes: wp.array(dtype=wp.vec4)
    fill: wp.array(dtype=float)
    bias: wp.array(dtype=float)  # this and the next three: surroundings_warp.py; one zero each where nothing is drawn
    enclosure: wp.array(dtype=float)
    fabric_normal: wp.array(dtype=wp.vec3)
    fabric_shear: wp.array(dtype=wp.vec3)
    lack: wp.array(dtype=float)  # of density, mean of the neighbourhood, an iteration ago
    correction: wp.array(dtype=wp.vec3)
    tool: Tool


@wp.func
def multiplier_pair(num: Numbers, own: floats(PLACE + 4), other: floats(PLACE), r: wp.vec3):
    dense = other[3] * summed(wp.length(r), num.support)
    g = num.slope_weight * sloping(num, other[3], r)
    return vec5(dense, g[0], g[1], g[2], wp.dot(g, g))


@wp.func
def within(num: Numbers, dense: float):
    """How far what is so dense lies within matter, from 0 at the face of a lattice to 1: a surface must not be drawn
    together."""
    return wp.clamp(2.0 * (dense - num.face) / (1.0 - num.face), 0.0, 1.0)


@wp.func
def drawing_compliance(num: Numbers, phase: Phase, density: float, dt: float):
    """Of a tension of bulk modulus K, which moves by dt^2 K lack grad W / rho in a substep, however short [-]."""
    wave = dt / num.spacing
    return density / (phase.bulk_modulus * wave * wave)


@wp.func
def held_together(phase: Phase, lack: float):
    """Lack of density that the tension which the material carries answers."""
    return wp.clamp(lack, 0.0, phase.tension_limit / phase.bulk_modulus)


def multiplier_pass(drawn: bool, tooled: bool) -> Pass:
    """Lagrange multiplier of the density constraint rho / rho0 <= 1 (eqs. 1, 8, 9 and 11 of the paper). What flows
    and carries tension is drawn together, too.

    The paper sums density with poly6 and moves along the slope of the spiky kernel. Poly6 has a flat top, under which
    particles pair; the spiky kernel itself reads matter in disorder 8 % too dense, which then swells. `cusp` is between
    them: 2 to 5 %, which `bias` takes away (surroundings_warp.py). Sums: density, gradient of the own place (3),
    squares of the others'.
    """

    @wp.func
    def finish(num: Numbers, box: Box, data: Constraining, world: int, i: int, own: floats(PLACE + 4), sums: vec5):
        if wp.static(tooled):
            found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
            own_slope = num.slope_weight * found.first
            squares = num.slope_weight * num.slope_weight * found.squares
            sums += vec5(found.level, own_slope[0], own_slope[1], own_slope[2], squares)
        dense = num.weight * (sums[0] + counted(num, own[3]) * summed(0.0, num.support))
        together = wp.vec3(sums[1], sums[2], sums[3])
        phase = data.phases[world, data.phase_of[i]]
        if wp.static(drawn):
            if not is_solid(phase):
                dense /= 1.0 + data.bias[i]
        data.fill[i] = dense
        limit = 1.0 + wp.where(is_solid(phase), SLACK_SOLID, num.slack)
        # Lengths are scaled by the spacing to make epsilon a number.
        slopes = (sums[4] + wp.dot(together, together)) * num.spacing * num.spacing
        metric = num.response * slopes + num.relaxation
        multiplier = -wp.clamp(dense - limit, 0.0, CROWDED) / metric
        heft, moved = data.mass[i] / (own[3] * phase.density), data.motion[i]
        first = wp.static(push_row(drawn) // 4) * i
        store_vec4(data.pushes, first, wp.vec4(own[0], own[1], own[2], own[3]))
        store_vec4(data.pushes, first + 1, wp.vec4(moved[0], moved[1], moved[2], heft))
        if wp.static(drawn):
            inside, normal, shear = float(0.0), wp.vec3(1.0, 1.0, 1.0), wp.vec3()
            if not is_solid(phase):
                inside = within(num, dense) * data.enclosure[i]
                compliance = num.iterations * drawing_compliance(num, phase, data.mass[i] / own[3], data.dt[world])
                multiplier += DRAWN * inside * held_together(phase, data.lack[i]) / (metric + compliance)
                normal = wp.vec3(data.fabric_normal[i])
                shear = wp.vec3(data.fabric_shear[i])
            n, s = multiplier * normal, multiplier * shear
            store_vec4(data.pushes, first + 2, wp.vec4(n[0], n[1], n[2], s[0]))
            store_vec4(data.pushes, first + 3, wp.vec4(s[1], s[2], inside * (1.0 - num.slack - dense), inside))
        else:
            store_vec4(data.pushes, first + 2, wp.vec4(multiplier, 0.0, 0.0, 0.0))

    return Pass(Numbers, Constraining, PLACE, 5, multiplier_pair, finish)


@wp.func
def pushed_to(row: Any, u: wp.vec3):
    """Where matter that is drawn together is pushed along u, before it is weighed."""
    return symmetric(wp.vec3(row[8], row[9], row[10]), wp.vec3(row[11], row[12], row[13])) * u


def correct_pass(drawn: bool, tooled: bool) -> Pass:
    """Position correction (eq. 12), and of pairs that are too near (Mueller et al. 2007, J. Vis. Commun. Image R.
    18:109), as one simultaneous Jacobi step. Of two the lighter moves more, such that momentum stays: V_i rho_i dx_i =
    - V_j rho_j dx_j. They part along the line between them as the substep began, as bonds do in SHAKE (Ryckaert et al.
    1977): with v = (x - x0) / dt, m x cross v is m x0 cross v, and stays. Sums over spacing squared.

    Where matter is drawn together it is pushed along that line times the inverse of the fabric, and two sums more find
    by how much what is enclosed nearby lacks density on the mean. A pull by what each particle lacks itself would make
    pairs of those that are apart, and take the noise of a density for a tension: a few tenths of a percent times the
    bulk modulus are more than a paste's yield stress.
    """
    row, sums_of = push_row(drawn), 5 if drawn else 3
    Own, Other, Sums = floats(row + 4), floats(row), floats(sums_of)

    @wp.func
    def seen(box: Box, data: Constraining, row: Other, j: int, code: int):
        moved = image_gradient(box, wp.vec3(row[4], row[5], row[6]), code)
        for axis in range(3):
            row[4 + axis] = moved[axis]
        if wp.static(drawn):
            sign = image_gradient(box, wp.vec3(1.0, 1.0, 1.0), code)
            row[11] *= sign[0] * sign[1]
            row[12] *= sign[0] * sign[2]
            row[13] *= sign[1] * sign[2]
        return row

    @wp.func
    def pair(num: Numbers, own: Own, other: Other, r: wp.vec3):
        distance = wp.length(r)
        before = r - wp.vec3(own[4] - other[4], own[5] - other[5], own[6] - other[6])
        apart = wp.length(before)
        line = (1.0 / wp.max(apart, 1.0e-9)) * before
        weight = (2.0 * other[7] / (own[7] + other[7]) * num.slope_weight) * other[3]
        lap = wp.max(NEAREST * num.spacing - distance, 0.0)
        mass = other[3] * other[7]
        parted = (PARTED * lap * mass / ((own[3] * own[7] + mass) * num.spacing * num.spacing)) * line
        if wp.static(drawn):
            push = weight * gradient(apart, num.support)  # as the moment was summed, or there would be a torque
            moved = push * (pushed_to(own, line) + pushed_to(other, line)) + parted
            level = other[3] * flat(distance, num.support)
            return Sums(moved[0], moved[1], moved[2], level * other[15], level * other[14])
        else:  # noqa: RET505 - Warp compiles one of the two
            push = weight * gradient(distance, num.support)
            moved = push * (own[8] + other[8]) * line + parted
            return Sums(moved[0], moved[1], moved[2])

    @wp.func
    def finish(num: Numbers, box: Box, data: Constraining, world: int, i: int, own: Own, sums: Sums):
        moved = wp.vec3(sums[0], sums[1], sums[2])
        if wp.static(tooled):
            found = felt(data.tool, wp.vec3(own[0], own[1], own[2]))
            pushed = 2.0 * num.slope_weight * found.first
            if wp.static(drawn):
                pushed = pushed_to(own, pushed)
                if data.tool.slips == 1:
                    pushed = wp.dot(pushed, found.normal) * found.normal
            else:
                pushed = own[8] * pushed
            moved += pushed
        if wp.static(drawn):
            own_level = own[3] * flat(0.0, num.support)
            data.lack[i] = (sums[4] + own_level * own[14]) / wp.max(sums[3] + own_level * own[15], SCARCE)
        if data.held[i] == FREE:
            data.correction[i] = (num.over_relaxation * num.spacing * num.spacing) * moved

    return Pass(Numbers, Constraining, row, sums_of, pair, finish, seen=seen)


def constraints(drawn: bool, tooled: bool) -> dict[str, Pass]:
    """The passes of an iteration, where matter is drawn together or is not, beside a rigid body or without one."""
    return {"multipliers": multiplier_pass(drawn, tooled), "correct": correct_pass(drawn, tooled)}
