"""MLS-MPM in Taichi: the passes of kernels_warp.py with the same arguments, written anew from the same equations."""

import functools
from collections.abc import Callable
from types import SimpleNamespace

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import FAULT_ASTRAY

from ..flow_taichi import pressure, shear_rate, strained
from ..smoothing import quadratic_spline
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Matrices,
    Phases,
    Quads,
    Vectors,
    force_at,
    is_solid,
    ivec3,
    mat3,
    phase_at,
    struct_of,
    symmetric,
    taichi_func,
    ti,
    too_fast,
    vec3,
    vec4,
)
from .grid_taichi import (
    GridT,
    address,
    base_node,
    claim,
    clear_grid,
    contained,
    facing,
    find_blocks,
    folded,
    in_front,
    in_reach,
    near_any,
    node_at,
    reset_blocks,
    rubbed,
    seen,
    slots_in_use,
    touched,
    wrapped,
)
from .particle import ANCHORED, FAULT_STENCIL, STEEPEST
from .piston import BELOW, FINE, WIDE, Piston

spline = taichi_func(quadratic_spline)
PistonT = struct_of(Piston)


@ti.func
def weights(f):
    """Spline weights of the three nodes (columns) on each axis (rows)."""
    w = mat3(0.0)
    for axis in ti.static(range(3)):
        first, second, third = spline(f[axis])
        w[axis, 0], w[axis, 1], w[axis, 2] = first, second, third
    return w


@ti.func
def kirchhoff(phase, j, b, s):
    """tau = -J p 1 + G dev(b) [Pa]."""
    unit = ti.Matrix.identity(ti.f32, 3)
    p = pressure(1.0 / j - 1.0, phase.bulk_modulus, phase.tait, phase.tension_limit)
    return phase.shear_modulus * (symmetric(b, s) - (b.sum() / 3.0) * unit) - (j * p) * unit


@ti.func
def viscous(phase, j, rate):
    """2 min(J, 1) eta dev(D) [Pa]."""
    mean = rate.trace() / 3.0 * ti.Matrix.identity(ti.f32, 3)
    return (2.0 * ti.min(j, 1.0) * phase.viscosity) * (0.5 * (rate + rate.transpose()) - mean)


@ti.func
def resistance_of(grid, h, volume, tau):
    """Momentum that a stress takes from a node per distance from the particle: 4 h V0 tau / dx^2."""
    out = tau
    for i, axis in ti.static(ti.ndrange(3, 3)):
        out[i, axis] *= 4.0 * h * volume * grid.inv_dx[axis] * grid.inv_dx[axis]
    return out


@ti.func
def gathered_from(grid, world, base, f, w, table: ti.template(), nodes: ti.template()):
    """(sum of w v, the affine field C) of the velocities of a particle's 27 nodes; and the sums of w rho and of
    w rho (x_node - x) in cells."""
    total, density = vec3(0.0), 0.0
    moment, lean = mat3(0.0), vec3(0.0)
    for o, q in ti.ndrange(3, 3):
        share = w[0, o] * w[1, q]
        for r in ti.static(range(3)):
            at = address(grid, world, wrapped(grid, base + ivec3(o, q, r)), table)
            node = share * w[2, r] * nodes[ti.max(at, 0)]
            u = vec3(node[0], node[1], node[2])
            total += u
            density += node[3]
            moment += u.outer_product(vec3(o, q, r) - f)
            lean += node[3] * (vec3(o, q, r) - f)
    for a, b in ti.static(ti.ndrange(3, 3)):
        moment[a, b] *= 4.0 * grid.inv_dx[b]
    return total, moment, density, lean


@ti.kernel
def g2p(
    grid: GridT,
    capacity: int,
    count: Ints,
    dt: Floats,
    moves: float,
    moving: Quads,
    phases: Phases,
    phase_of: Ints,
    held: Ints,
    shifting: float,
    position: Vectors,
    velocity: Vectors,
    affine: Matrices,
    volume_ratio: Floats,
    table: Ints,
    block_of: Ints,
    active: Ints,
    fault: Ints,
):
    known = slots_in_use(active, block_of)
    for p in range(position.shape[0]):
        world = p // capacity
        if p - world * capacity < count[world]:
            x, v, h = position[p], velocity[p], dt[world]
            base = base_node(grid, x)
            f = (x - grid.origin) * grid.inv_dx - base
            w = weights(f)
            gathered, moment, density, lean = gathered_from(grid, world, base, f, w, table, moving)
            affine[p] = moment
            phase = phase_at(phases, world, phase_of[p])
            if held[p] == FREE:
                v = gathered
                velocity[p] = v
                crowding = density * volume_ratio[p] / phase.density
                if not is_solid(phase) and crowding > 1.0 and crowding < ANCHORED:
                    amount = ti.min(shifting * h * shear_rate(moment), STEEPEST)
                    x -= (4.0 * amount / phase.density) * lean * grid.dx
            free = x + moves * h * v
            if too_fast(v, grid.top_speed):
                ti.atomic_or(fault[0], FAULT_ASTRAY)
                free = position[p]
            x = contained(grid, free)
            position[p] = x
            for axis in ti.static(range(3)):
                if x[axis] != free[axis] and grid.wrap[axis] == 0:
                    velocity[p][axis] = 0.0
            after = base_node(grid, x)
            if (after != base).any():
                claim(grid, world, after, table, block_of, active, fault)
    for slot in range(known, slots_in_use(active, block_of)):
        table[block_of[slot]] = slot + 1


def adder(alone: bool) -> Callable:
    """What adds to a node; a thread that is alone needs no atomic additions, which would take half of its time."""

    @ti.func
    def add(target: ti.template(), at, value):
        if ti.static(alone):
            target[at] = target[at] + value
        else:
            target[at] += value

    return add


@functools.cache
def passes(alone: bool) -> SimpleNamespace:
    """All passes, for one thread or several."""

    add = adder(alone)

    @ti.kernel
    def p2g(
        grid: GridT,
        capacity: int,
        count: Ints,
        dt: Floats,
        drags: int,
        anew: float,
        phases: Phases,
        position: Vectors,
        velocity: Vectors,
        affine: Matrices,
        mass: Floats,
        volume: Floats,
        phase_of: Ints,
        held: Ints,
        bent: Matrices,
        table: Ints,
        volume_ratio: Floats,
        elastic_normal: Vectors,
        elastic_shear: Vectors,
        plastic: Floats,
        raw: Quads,
        fault: Ints,
    ):
        for p in range(position.shape[0]):
            world = p // capacity
            if p - world * capacity < count[world]:
                h, c, m = dt[world], affine[p], anew * mass[p]
                phase = phase_at(phases, world, phase_of[p])
                a = mat3(0.0)  # momentum per distance from the particle
                if held[p] == FREE:
                    a = m * c
                j, b, s = volume_ratio[p], elastic_normal[p], elastic_shear[p]
                if held[p] != CARRIED and h > 0.0:
                    t = c.trace()
                    minors = 0.5 * (t * t - (c @ c).trace())
                    j *= ti.max(1.0 + h * (t + h * (minors + h * c.determinant())), 0.1)
                    if phase.shear_modulus > 0.0:
                        b, s, _ = strained(phase, phase.shear_modulus, c, b, s, h, p, plastic)
                        elastic_normal[p], elastic_shear[p] = b, s
                    volume_ratio[p] = j
                if h > 0.0 and held[p] != CARRIED:
                    tau = kirchhoff(phase, j, b, s)
                    if drags == 1 and phase.viscosity > 0.0:
                        tau += viscous(phase, j, c)
                    if anew == 0.0:
                        tau = tau @ (ti.Matrix.identity(ti.f32, 3) + bent[p]).inverse().transpose()
                    a -= resistance_of(grid, h, volume[p], tau)
                base = base_node(grid, position[p])
                f = (position[p] - grid.origin) * grid.inv_dx - base
                w = weights(f)
                own = m * velocity[p]
                for o, q in ti.ndrange(3, 3):
                    for r in ti.static(range(3)):
                        at = address(grid, world, wrapped(grid, base + ivec3(o, q, r)), table)
                        if at < 0:
                            ti.atomic_or(fault[0], FAULT_STENCIL)
                        else:
                            share = w[0, o] * w[1, q] * w[2, r]
                            momentum = share * (own + a @ ((vec3(o, q, r) - f) * grid.dx))
                            add(raw, at, vec4(momentum[0], momentum[1], momentum[2], share * m))

    @ti.kernel
    def grid_step(
        grid: GridT,
        lanes: int,
        active: Ints,
        block_of: Ints,
        table: Ints,
        raw: Quads,
        dt: Floats,
        force: Forces,
        piston: PistonT,
        speed: Floats,
        row: Ints,
        exit: Vectors,
        drift: Vectors,
        feeding: Floats,
        moving: Quads,
        spent: Quads,
    ):
        for t in range(ti.min(active[0] * 64, raw.shape[0])):
            block = block_of[t // 64]
            world = block // grid.blocks_per_world
            node = node_at(grid, block - world * grid.blocks_per_world, t % 64)
            wall = near_any(grid, node)
            result = vec4(0.0)
            if (wall or raw[t][3] > 0.0) and in_reach(grid, node):
                inside = in_front(grid, node)
                place = grid.origin + grid.dx * inside
                kick = dt[world] * force_at(force, world, place)
                total, hold, into = raw[t], 1.0, vec3(0.0)
                if wall:
                    touching, held, pressing = touched(grid, world, node, kick, table, raw)
                    hold, into = held, pressing
                    inside = facing(grid, node, touching)
                    total = folded(grid, world, inside, touching, table, raw)
                if total[3] > 0.0:
                    v = vec3(total[0], total[1], total[2]) / total[3] + kick
                    if piston.on == 1:
                        before = ti.max(row[0] - 1, 0)
                        away = place - exit[row[0]]
                        square = away[0] ** 2 + away[1] ** 2
                        within = square < piston.reach**2 and away[2] > -BELOW * grid.dx[2]
                        if within and feeding[before] > 0.0:
                            going = drift[before]
                            part = ti.min(FINE * square / (WIDE * piston.bore) ** 2, FINE)
                            low = ti.min(ti.cast(part, ti.i32), FINE - 1)
                            flow = speed[low] + (part - low) * (speed[low + 1] - speed[low])
                            down = going[2] - feeding[before] * flow
                            if piston.firm == 0:
                                down = ti.min(v[2], down)
                            v = (1 - piston.still) * vec3(going[0], going[1], down)
                    if wall:
                        v = rubbed(grid, node, into, v)
                    result = seen(grid, node, inside, vec4(v[0], v[1], v[2], total[3] * grid.inv_volume))
                    if hold < 1.0:  # between a wall that acts in full and none
                        own = raw[t]
                        free = vec4(0.0, 0.0, 0.0, result[3])
                        if own[3] > 0.0:
                            u = vec3(own[0], own[1], own[2]) / own[3] + kick
                            free = vec4(u[0], u[1], u[2], result[3])
                        result = hold * result + (1.0 - hold) * free
            moving[t] = result
            if t < spent.shape[0]:
                spent[t] = vec4(0.0)

    return SimpleNamespace(
        reset_blocks=reset_blocks, find_blocks=find_blocks, clear_grid=clear_grid, p2g=p2g, grid_step=grid_step, g2p=g2p
    )
