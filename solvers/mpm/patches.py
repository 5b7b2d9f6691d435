"""The transfers of MPM on the CPU, block by block.

Particles scatter into the patch of their home, which no other thread touches and which stays in the nearest cache; the
patches that overlap at a node are then added up in one order, whatever the number of threads. The gather reads a patch
in the same way, once it holds the velocities.
"""

import warp as wp

from fluidbench.native.crew import index_of
from fluidbench.native.scene import Phase

from .grid import Grid, activate_stencil, first_node
from .homes import NOWHERE, PATCH, SIDE, Homes, coordinates, home_of, neighbour, part_of, place_in_patch
from .particle import affine_of, as_begun, moved, resistance_of, shifted, stressed, taken, viscous, weights

wp.set_module_options({"enable_backward": False, "fast_math": True})


@wp.func_native(
    snippet="""
#if !defined(__CUDA_ARCH__)
    typedef float quad __attribute__((vector_size(16), aligned(4)));
    quad* const lowest = (quad*)&patch.data[at];
    const quad own = { momentum[0], momentum[1], momentum[2], mass };
    const quad ax = { a.data[0][0], a.data[1][0], a.data[2][0], 0.0f };
    const quad ay = { a.data[0][1], a.data[1][1], a.data[2][1], 0.0f };
    const quad az = { a.data[0][2], a.data[1][2], a.data[2][2], 0.0f };
    for (unsigned o = 0; o < 3; ++o)
        for (unsigned q = 0; q < 3; ++q) {
            quad* const node = lowest + (o * 6 + q) * 6;
            const quad row = own + (o * 1.0f) * ax + (q * 1.0f) * ay;
            const float w = wx[o] * wy[q];
            node[0] += (w * wz[0]) * row;
            node[1] += (w * wz[1]) * (row + az);
            node[2] += (w * wz[2]) * (row + az + az);
        }
#endif
"""
)
def add_to_nodes(
    patch: wp.array(dtype=wp.vec4),
    at: int,
    wx: wp.vec3,
    wy: wp.vec3,
    wz: wp.vec3,
    momentum: wp.vec3,
    mass: float,
    a: wp.mat33,
):
    """patch[at + 36 o + 6 q + r] += wx[o] wy[q] wz[r] (momentum + a (o, q, r), mass), four floats at a time."""
    ...


@wp.func_native(
    snippet="""
#if !defined(__CUDA_ARCH__)
    typedef float quad __attribute__((vector_size(16), aligned(4)));
    const quad* const lowest = (const quad*)&patch.data[at];
    quad v = {}, x = {}, y = {}, z = {};
    for (unsigned o = 0; o < 3; ++o) {
        quad plane = {};
        for (unsigned q = 0; q < 3; ++q) {
            const quad* const node = lowest + (o * 6 + q) * 6;
            const quad near = wz[1] * node[1], far = wz[2] * node[2];
            const quad row = wz[0] * node[0] + near + far;
            const float w = wx[o] * wy[q];
            plane += wy[q] * row;
            y += (w * (q * 1.0f - f[1])) * row;
            z += w * (near + far + far - f[2] * row);
        }
        v += wx[o] * plane;
        x += (wx[o] * (o * 1.0f - f[0])) * plane;
    }
    return wp::mat_t<4, 4, wp::float32>(
        v[0], v[1], v[2], v[3], x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], z[0], z[1], z[2], z[3]
    );
#else
    return wp::mat_t<4, 4, wp::float32>();
#endif
"""
)
def taken_from_nodes(
    patch: wp.array(dtype=wp.vec4), at: int, wx: wp.vec3, wy: wp.vec3, wz: wp.vec3, f: wp.vec3
) -> wp.mat44:
    """Row 0: the sum of w patch over the 27 nodes from `at` on; rows 1 to 3: of w patch d, d being the distance of a
    node from the point f along x, y and z, in cells."""
    ...


@wp.func
def empty(homes: Homes, start: int):
    """Empty the patch that begins there."""
    for k in range(PATCH):
        homes.patch[start + k] = wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def fill(
    grid: Grid,
    homes: Homes,
    h: int,
    nodes: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
):
    """Copy what the nodes of a home's patch hold into it; returns the home's world."""
    own = block_of[homes.slot[h]]
    world = own / grid.blocks_per_world
    block = coordinates(grid, own - world * grid.blocks_per_world)
    for corner in range(8):
        b, node, place, size = neighbour(grid, block, corner, 1)
        slot = int(NOWHERE)
        if b >= 0:
            slot = table[b + world * grid.blocks_per_world] - 1
        if slot >= 0:
            for i in range(size[0]):
                for j in range(size[1]):
                    of = slot * 64 + ((node[0] + i) << 4) + ((node[1] + j) << 2) + node[2]
                    at = h * PATCH + ((place[0] + i) * SIDE + place[1] + j) * SIDE + place[2]
                    for k in range(size[2]):
                        homes.patch[at + k] = nodes[of + k]
    return world


@wp.kernel
def scatter(
    share: wp.vec3i,
    lanes: int,
    grid: Grid,
    capacity: int,
    homes: Homes,
    dt: wp.array(dtype=float),
    drags: int,
    anew: float,
    phases: wp.array2d(dtype=Phase),
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    bent: wp.array(dtype=wp.mat33),
    # outputs
    volume_ratio: wp.array(dtype=float),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
):
    """Strain and stress of each particle, then momentum and mass, or its push alone (transfers.py), to the patch of
    its home."""
    h, end = part_of(homes, index_of(share, wp.tid()), lanes)
    while h < end:
        start = h * PATCH
        empty(homes, start)
        for member in range(homes.first[h], homes.first[h] + homes.number[h]):
            p = homes.members[member]
            world = p / capacity
            phase = phases[world, phase_of[p]]
            m = anew * mass[p]
            a = stressed(
                grid,
                dt[world],
                drags,
                phase,
                p,
                True,
                position[p],
                affine,
                m,
                volume,
                held,
                volume_ratio,
                elastic_normal,
                elastic_shear,
                plastic,
            )
            if anew == 0.0:
                a = as_begun(grid, a, bent[p])
            base = first_node(grid, position[p])
            f, wx, wy, wz = weights(grid, position[p], base)
            momentum = m * velocity[p] - a * f
            at = start + place_in_patch(grid, base)
            add_to_nodes(homes.patch, at, wx, wy, wz, momentum, m, a)
        h += 1


@wp.kernel
def add_up(
    share: wp.vec3i,
    lanes: int,
    grid: Grid,
    active: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    table: wp.array(dtype=int),
    homes: Homes,
    # outputs
    raw: wp.array(dtype=wp.vec4),
):
    """Momentum and mass of every node, emptied before: the sum over all patches that hold it."""
    slot = index_of(share, wp.tid())
    while slot < wp.min(active[0], block_of.shape[0]):
        world = block_of[slot] / grid.blocks_per_world
        block = coordinates(grid, block_of[slot] - world * grid.blocks_per_world)
        for corner in range(8):
            b, node, place, size = neighbour(grid, block, corner, 0)
            h = int(NOWHERE)
            if b >= 0:
                other = table[b + world * grid.blocks_per_world] - 1
                if other >= 0:
                    h = homes.of_slot[other]
            if h >= 0:
                for i in range(size[0]):
                    for j in range(size[1]):
                        to = slot * 64 + ((node[0] + i) << 4) + ((node[1] + j) << 2) + node[2]
                        at = h * PATCH + ((place[0] + i) * SIDE + place[1] + j) * SIDE + place[2]
                        for k in range(size[2]):
                            raw[to + k] = raw[to + k] + homes.patch[at + k]
        slot += lanes


@wp.kernel
def gather(
    share: wp.vec3i,
    lanes: int,
    grid: Grid,
    capacity: int,
    homes: Homes,
    dt: wp.array(dtype=float),
    moves: float,
    moving: wp.array(dtype=wp.vec4),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    shifting: float,
    # outputs
    position: wp.array(dtype=wp.vec3),
    velocity: wp.array(dtype=wp.vec3),
    affine: wp.array(dtype=wp.mat33),
    volume_ratio: wp.array(dtype=float),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Velocity and affine velocity field of each particle from the patch of its home; then it `moves` (1; else 0)."""
    h, end = part_of(homes, index_of(share, wp.tid()), lanes)
    while h < end:
        start = h * PATCH
        world = fill(grid, homes, h, moving, table, block_of)
        for member in range(homes.first[h], homes.first[h] + homes.number[h]):
            p = homes.members[member]
            x = position[p]
            base = first_node(grid, x)
            f, wx, wy, wz = weights(grid, x, base)
            sums = taken_from_nodes(homes.patch, start + place_in_patch(grid, base), wx, wy, wz, f)
            c = affine_of(grid, sums)
            affine[p] = c
            v = taken(p, sums, held, velocity)
            x += shifted(grid, phases[world, phase_of[p]], sums, c, shifting * dt[world], volume_ratio[p], held[p])
            after = moved(grid, x, v, moves * dt[world], p, position, velocity, fault)
            if after[0] != base[0] or after[1] != base[1] or after[2] != base[2]:
                activate_stencil(grid, world, after, table, block_of, active, fault)
                if home_of(grid, after) != home_of(grid, base):
                    homes.outdated[0] = 1
        h += 1


@wp.kernel
def resist(
    share: wp.vec3i,
    lanes: int,
    grid: Grid,
    capacity: int,
    homes: Homes,
    dt: wp.array(dtype=float),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    volume: wp.array(dtype=float),
    volume_ratio: wp.array(dtype=float),
    nodes: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    # outputs
    given: wp.array(dtype=wp.mat33),
):
    """What viscosity resists the velocities of the nodes with, to the patch of each home: dt A v (implicit.py)."""
    h, end = part_of(homes, index_of(share, wp.tid()), lanes)
    while h < end:
        start = h * PATCH
        world = fill(grid, homes, h, nodes, table, block_of)
        for member in range(homes.first[h], homes.first[h] + homes.number[h]):
            p = homes.members[member]
            phase = phases[world, phase_of[p]]
            a = wp.mat33()
            if phase.viscosity > 0.0:
                base = first_node(grid, position[p])
                f, wx, wy, wz = weights(grid, position[p], base)
                sums = taken_from_nodes(homes.patch, start + place_in_patch(grid, base), wx, wy, wz, f)
                tau = viscous(phase, volume_ratio[p], affine_of(grid, sums))
                a = resistance_of(grid, dt[world], volume[p], tau)
            given[p] = a
        empty(homes, start)
        for member in range(homes.first[h], homes.first[h] + homes.number[h]):
            p = homes.members[member]
            base = first_node(grid, position[p])
            f, wx, wy, wz = weights(grid, position[p], base)
            a = given[p]
            add_to_nodes(homes.patch, start + place_in_patch(grid, base), wx, wy, wz, -(a * f), 0.0, a)
        h += 1
