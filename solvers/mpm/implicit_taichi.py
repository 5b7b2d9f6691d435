"""Viscosity implicit in time on MPM's grid, in Taichi: the kernels of implicit_warp.py with the same arguments, written
anew from the same equations (implicit.py)."""

import functools
from types import SimpleNamespace

from ..conjugate_taichi import STEP, TURN, Table, Twos, note, weigh_start, weigh_step, weigh_turn
from ..taichi_bridge import (
    Floats,
    Forces,
    Ints,
    Phases,
    Quads,
    Vectors,
    force_at,
    ivec3,
    phase_at,
    ti,
    vec2,
    vec3,
    vec4,
)
from .grid_taichi import (
    GridT,
    address,
    base_node,
    in_front,
    node_at,
    seen,
    slots_in_use,
    wrapped,
)
from .kernels_taichi import adder, gathered_from, resistance_of, viscous, weights
from .ranks import PART, PARTS


@ti.func
def velocity_of(value):
    """The first three components alone."""
    return vec4(value[0], value[1], value[2], 0.0)


@ti.func
def product(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@ti.func
def sum_of(number: ti.template(), begin: ti.template(), world, part):
    return begin[world] + number[part // PARTS] * PARTS + part % PARTS


@ti.kernel
def count_off(lanes: int, grid: GridT, active: Ints, block_of: Ints, number: Ints, many: Ints, begin: Ints):
    for slot in range(slots_in_use(active, block_of)):
        number[slot] = ti.atomic_add(many[block_of[slot] // grid.blocks_per_world], 1)


@ti.kernel
def divide(worlds: int, number: Ints, many: Ints, begin: Ints):
    before = 0
    ti.loop_config(serialize=True)
    for world in range(worlds):
        begin[world] = before * PARTS
        before += many[world]
        many[world] = 0
    begin[worlds] = before * PARTS


@ti.func
def pushed(grid, world, node, h, force: ti.template()):
    """See implicit_warp.py."""
    inside = in_front(grid, node)
    v = h * force_at(force, world, grid.origin + grid.dx * inside)
    return seen(grid, node, inside, vec4(v[0], v[1], v[2], 0.0))


@ti.kernel
def guess(
    grid: GridT,
    lanes: int,
    active: Ints,
    block_of: Ints,
    raw: Quads,
    dt: Floats,
    force: Forces,
    residual: Quads,
):
    for t in range(slots_in_use(active, block_of) * 64):
        change = vec4(0.0)
        if raw[t][3] > 0.0:
            block = block_of[t // 64]
            world = block // grid.blocks_per_world
            node = node_at(grid, block - world * grid.blocks_per_world, t % 64)
            change = velocity_of(residual[t] - raw[t] - raw[t][3] * pushed(grid, world, node, dt[world], force))
        change[3] = raw[t][3]
        residual[t] = change


@ti.kernel
def start(
    grid: GridT,
    lanes: int,
    active: Ints,
    block_of: Ints,
    number: Ints,
    many: Ints,
    begin: Ints,
    raw: Quads,
    dt: Floats,
    force: Forces,
    answer: Quads,
    moving: Quads,
    image: Quads,
    partial: Twos,
):
    for part in range(slots_in_use(active, block_of) * PARTS):
        block, total = block_of[part // PARTS], 0.0
        world = block // grid.blocks_per_world
        for t in range(part * PART, (part + 1) * PART):
            given = pushed(grid, world, node_at(grid, block - world * grid.blocks_per_world, t % 64), dt[world], force)
            total += raw[t][3] * (product(moving[t], moving[t]) + product(given, given))
            moving[t] += velocity_of(answer[t])
            image[t] = vec4(0.0)
        partial[sum_of(number, begin, world, part)] = vec2(0.0, total)


@ti.kernel
def residual_of(lanes: int, active: Ints, image: Quads, residual: Quads):
    for t in range(ti.min(active[0] * 64, residual.shape[0])):
        r = -residual[t] - image[t]
        residual[t] = vec4(r[0], r[1], r[2], residual[t][3])


@ti.kernel
def set_out(lanes: int, active: Ints, residual: Quads, answer: Quads, impulse: Quads, search: Quads, image: Quads):
    for t in range(ti.min(active[0] * 64, residual.shape[0])):
        impulse[t], search[t], image[t] = residual[t], answer[t], residual[t]


@ti.kernel
def turn(
    grid: GridT,
    lanes: int,
    active: Ints,
    block_of: Ints,
    totals: Table,
    residual: Quads,
    answer: Quads,
    impulse: Quads,
    search: Quads,
    image: Quads,
):
    for t in range(slots_in_use(active, block_of) * 64):
        beta = totals[block_of[t // 64] // grid.blocks_per_world, TURN]
        p = residual[t] + beta * velocity_of(impulse[t])
        impulse[t], image[t] = p, p
        search[t] = answer[t] + beta * search[t]


@ti.kernel
def along(
    grid: GridT,
    lanes: int,
    active: Ints,
    block_of: Ints,
    number: Ints,
    many: Ints,
    begin: Ints,
    momentum: Quads,
    velocity: Quads,
    partial: Twos,
):
    for part in range(slots_in_use(active, block_of) * PARTS):
        total = 0.0
        for t in range(part * PART, (part + 1) * PART):
            total += product(momentum[t], velocity[t])
        at = sum_of(number, begin, block_of[part // PARTS] // grid.blocks_per_world, part)
        partial[at] = vec2(total, partial[at][1])


@ti.kernel
def descend(
    grid: GridT,
    lanes: int,
    active: Ints,
    block_of: Ints,
    totals: Table,
    search: Quads,
    image: Quads,
    moving: Quads,
    residual: Quads,
):
    for t in range(slots_in_use(active, block_of) * 64):
        alpha = totals[block_of[t // 64] // grid.blocks_per_world, STEP]
        moving[t] += alpha * velocity_of(search[t])
        residual[t] -= alpha * velocity_of(image[t])


@ti.kernel
def close(lanes: int, active: Ints, answer: Quads, moving: Quads):
    for t in range(ti.min(active[0] * 64, moving.shape[0])):
        moving[t] += velocity_of(answer[t])


@functools.cache
def passes(alone: bool) -> SimpleNamespace:
    """All kernels, for one thread or several."""

    add = adder(alone)

    @ti.kernel
    def resist(
        grid: GridT,
        capacity: int,
        count: Ints,
        dt: Floats,
        phases: Phases,
        phase_of: Ints,
        position: Vectors,
        volume: Floats,
        volume_ratio: Floats,
        table: Ints,
        nodes: Quads,
        image: Quads,
    ):
        for p in range(position.shape[0]):
            world = p // capacity
            if p - world * capacity < count[world]:
                phase = phase_at(phases, world, phase_of[p])
                if phase.viscosity > 0.0:
                    base = base_node(grid, position[p])
                    f = (position[p] - grid.origin) * grid.inv_dx - base
                    w = weights(f)
                    _, rate, _, _ = gathered_from(grid, world, base, f, w, table, nodes)
                    a = resistance_of(grid, dt[world], volume[p], viscous(phase, volume_ratio[p], rate))
                    for o, q in ti.ndrange(3, 3):
                        for r in ti.static(range(3)):
                            at = address(grid, world, wrapped(grid, base + ivec3(o, q, r)), table)
                            taken = w[0, o] * w[1, q] * w[2, r] * (a @ ((vec3(o, q, r) - f) * grid.dx))
                            if at >= 0:
                                add(image, at, vec4(taken[0], taken[1], taken[2], 0.0))

    return SimpleNamespace(
        count_off=count_off,
        divide=divide,
        guess=guess,
        start=start,
        residual_of=residual_of,
        set_out=set_out,
        turn=turn,
        along=along,
        descend=descend,
        close=close,
        resist=resist,
        weigh_start=weigh_start,
        weigh_step=weigh_step,
        weigh_turn=weigh_turn,
        note=note,
    )
