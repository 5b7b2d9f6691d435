"""The second sum over neighbours of SPH in Taichi: force_warp.py, written anew from the same equations."""

from typing import Any

from fluidbench.native.scene import FRICTION, STICK

from ..corrected_taichi import mirrored_stress
from ..neighbours_taichi import BoxT, ListsT, face_kind, image_traction, image_velocity
from ..pairs_taichi import matrix_into, over_pairs, reader, stressed, vector_at, vector_into
from ..taichi_bridge import Floats, Forces, Ints, Phases, Quads, Vectors, force_at, phase_at, ti, vec3, vec4
from ..viscosity_taichi import dragging, shared
from .force_warp import width_of
from .particle_taichi import SmoothingT, slope


@ti.func
def rubbed(box, x, v, inward_pull, walls, h):
    """Acceleration by friction walls, from what pairs across them push: never pulled, and rubbed by Coulomb's law up to
    what stops the slide within h."""
    a = inward_pull
    gained = vec3(0.0)
    for axis in ti.static(range(3)):
        if walls[axis] != 0.0:
            inward, friction = 1.0, box.lower_friction[axis]
            if 0.5 * (box.lower[axis] + box.upper[axis]) < x[axis]:
                inward, friction = -1.0, box.upper_friction[axis]
            normal = ti.max(inward * walls[axis], 0.0)
            slide = v + h * (a + gained)
            slide[axis] = 0.0
            speed = slide.norm()
            gained -= ti.min(friction * normal, speed / h) / ti.max(speed, 1.0e-12) * slide
            gained[axis] += inward * normal
    return gained


def force_pass(strength: bool, tensile: bool, viscous: bool, changing: bool) -> Any:
    """The kernel, see force_warp.py."""
    width = width_of(strength, tensile, viscous, changing)
    last, drags, state_at = width_of(strength, tensile, False, False), width - 4, reader(width)

    @ti.func
    def state_seen(box, extra: ti.template(), row, j, code):
        out = vector_into(row, 4, image_velocity(box, vector_at(row, 4), code))
        if ti.static(tensile):
            out = matrix_into(out, 7, mirrored_stress(box, stressed(row, 7), code))
        if ti.static(strength):
            out = vector_into(out, 16, image_traction(box, vector_at(row, 16), code))
        return out

    @ti.func
    def drag_along(num, own, begun, other, r, s):
        """Acceleration by viscosity, along s."""
        u, mu = vector_at(own, 4) - vector_at(other, 4), begun[1]
        volume, per_rest = other[3] * begun[2], begun[2]
        if ti.static(changing):
            u -= (own[drags + 1] + other[drags + 1]) / 6.0 * r
            mu = shared(own[last + 2], other[last + 2])
            volume, per_rest = other[3] / other[last + 1], 1.0 / own[last + 1]
        between = own[drags] * other[drags] * dragging(mu, r.norm_sqr(), 2.0 * num.h, volume)
        return -between * per_rest * s.dot(u) * s

    @ti.func
    def force_pair(num, own, begun, other, r):
        u = vector_at(own, 4) - vector_at(other, 4)
        r2, ur, tiny = r.norm_sqr(), u.dot(r), 0.01 * num.h * num.h
        q = ti.sqrt(r2) / num.h
        shock = begun[0]
        mine, theirs = 1.0, 1.0
        if ti.static(changing):
            mine, theirs = 1.0 / other[last + 1], 1.0 / own[last + 1]
            # means of both partners, for both must find the same force
            fast = 0.5 * (own[last + 3] + other[last + 3])
            shock = num.artificial_viscosity * num.h * fast / ti.max(own[last], other[last])
        along = 0.0  # what acts along the line of centres
        push = vec3(0.0)
        if ti.static(tensile):
            push = (mine * stressed(own, 7) + theirs * stressed(other, 7)) @ r
        else:
            along = -(mine * own[7] + theirs * other[7])
        if ti.static(strength):
            push += theirs * vector_at(other, 16) - mine * vector_at(own, 16)
            along += ti.max(own[19], other[19]) * shock * ur / (r2 + tiny)
        else:
            along += shock * ti.min(ur, 0.0) / (r2 + tiny)
        push = other[3] * slope(q, num.h) * (push + along * r)
        if ti.static(viscous):
            push += 2.0 * drag_along(num, own, begun, other, r, r)
        return vector_into(ti.Vector.zero(ti.f32, 6), 0, push)

    @ti.func
    def in_walls(num, box, code, own, begun, other, r, sums):
        """Viscosity drags along both lines in no-slip walls; what friction walls push along their normals stands by
        itself."""
        out = sums
        if ti.static(viscous):
            s = r
            for axis in ti.static(range(3)):
                if face_kind(box, code, axis) == STICK:
                    s[axis] = -s[axis]
            along = drag_along(num, own, begun, other, r, s) - drag_along(num, own, begun, other, r, r)
            out = vector_into(out, 0, vector_at(out, 0) + along)
        for axis in ti.static(range(3)):
            if face_kind(box, code, axis) == FRICTION:
                out[3 + axis] = out[axis]
                out[axis] = 0.0
        return out

    pushed_by = over_pairs(width, 6, force_pair, state_seen, in_walls)

    @ti.kernel
    def force(
        num: SmoothingT,
        box: BoxT,
        lists: ListsT,
        entries: Ints,
        number: Ints,
        inside: Ints,
        capacity: int,
        count: Ints,
        state: Quads,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        forces: Forces,
        density: Floats,
        acceleration: Vectors,
    ):
        for i in range(phase_of.shape[0]):
            world = i // capacity
            if i - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[i])
                own = state_at(state, i)
                # Pi_ij per velocity difference: alpha h c / rho (Monaghan 1992)
                shock = num.artificial_viscosity * num.h * phase.wave_speed / phase.density
                begun = vec4(shock, phase.viscosity, 1.0 / phase.density, 0.0)
                sums = pushed_by(num, box, lists, entries, number, state, density, i, own, begun)
                a = vector_at(sums, 0) + force_at(forces, world, vector_at(own, 0))
                rub = rubbed(box, vector_at(own, 0), vector_at(own, 4), a, vector_at(sums, 3), dt[world])
                acceleration[i] = a + rub

    return force
