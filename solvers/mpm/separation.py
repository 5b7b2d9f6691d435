"""MPM's particles kept apart: what the grid cannot see, a pair of them within a cell, is undone by pairs.

Where matter is sheared, particles that a grid carries along come as near to each other as they like: no stress resists
what has no velocity gradient. They line up in threads with gaps between, and what is measured finer than a cell finds
less matter than there is. So every few ticks, where matter flows, pairs nearer than a spacing leave each other as in
SPH (../crowding.py), in proportion to the strain meanwhile; those that touch, nearer than a quarter of one, at once,
wherever both deform: what hardly flows brings single pairs so near, and leaves them there. What the grid does see of
these shifts, their mean over its nodes, is taken off again, and once more of what is left: it would widen whatever is
strained (a flattened drop by 6 % of its radius), for no volume ratio knows of it. Velocities stay: the momentum of
nodes is changed by no more than how the field bends within a cell.

What has grown is evened out as well, as in SPH (../corrected.py): the halves of split particles lie as they were
born, and where none is within a cell the grid finds a gap in what should be full.
"""

from typing import Any

import warp as wp

from fluidbench.method.frame import FREE
from fluidbench.native.crew import index_of
from fluidbench.native.pool import Pool
from fluidbench.native.scene import PERIODIC, Box, Phase, Scene
from fluidbench.native.vector_access import joined

from ..aging import GROWN, rest_density
from ..backends import Warp
from ..bind import warp_func
from ..cells import Cells, WhoIsWhere, bucket_of, cell_of, place
from ..corrected import enclosed, least_eigenvalue
from ..crowding import excess, farthest, nearest
from ..flow import flows, shear_rate
from ..images import face_kind, has_choice, image_position, near_faces, undoing
from ..pairs import floats
from ..search import around
from ..smoothing import wendland_slope
from .grid import Grid, clear_grid
from .nodes import follow, mean_of_nodes, tell_nodes
from .particle import contained

wp.set_module_options({"enable_backward": False, "fast_math": True})

EVERY = 4  # ticks: in each matter goes a quarter of a spacing at most
KERNEL = 1.5  # smoothing length of the crowding, in spacings: SPH's in matter that lies in no order
CLOSE = 1.0  # distance below which particles are moved apart, in spacings: nothing in a lattice is
TOUCHING = 0.25  # distance below which they are parted at once, in spacings: two halves of what is shifted
STIRRED = 1.0e-4  # strain meanwhile from which matter deforms, a thousandth of what brings two together
TEAM = 8  # threads that look around a particle on a GPU: alone each waits for 27 cells, one after the other
LONGEST = wp.constant(0.25)  # shift at a time, in spacings: as far as matter goes in a tick

slope = warp_func(wendland_slope)
Sums = floats(12)  # shift / h^2 (3), the gradient of the concentration (3) and the second moment: xx yy zz xy xz yz


@wp.struct
class Apart:
    """Numbers of the crowding."""

    h: float  # smoothing length [m]
    near: float  # kernel at the distance below which partners crowd each other [1/m^3]
    strain: float  # shift over the rate of shear and h^2 crowding [s],
    farthest: float  # and over h^2 crowding at most [-]
    touching: float  # distance below which it is as far as that [m]
    stirred: float  # rate of shear from which matter deforms [1/s]
    evens: int  # 1 where matter grows, and is evened out


@wp.func
def through(
    num: Apart,
    box: Box,
    cells: Cells,
    world: int,
    i: int,
    x: wp.vec3,
    code: int,
    strain: float,
    volume: wp.array(dtype=float),
    member: int,
    team: int,
    sums: Sums,
):
    """The sums of particle i at x, gone on with over the images of all of this code, its own as well, or the others
    themselves (0), in the cells of one member of a team; its shift is `strain` times h^2 crowding."""
    signs = wp.vec3(1.0, 1.0, 1.0)
    for axis in range(3):
        if face_kind(box, code, axis) != PERIODIC:
            signs[axis] = -1.0
    at = image_position(box, x, undoing(box, code))  # where it sees others as it sees their images from x
    middle = cell_of(at, cells.width)
    for c in range(member, 27, team):
        bucket = bucket_of(cells, world, around(middle, c))
        start = cells.start[bucket]
        for m in range(start, start + cells.number[bucket]):
            r = wp.cw_mul(signs, at - place(cells.spot[m]))
            length = wp.length(r)
            if length < cells.width and length > 0.0 and (code > 0 or cells.members[m] != i):
                w = slope(length / num.h, num.h) * volume[cells.members[m]]
                by = wp.where(length < num.touching, num.farthest, strain)
                crowds = by * excess(length, num.h, num.near) * w
                for a in range(3):
                    sums[a] += crowds * r[a]
                if num.evens == 1:
                    for a in range(3):
                        sums[3 + a] += w * r[a]
                        sums[6 + a] -= w * r[a] * r[a]
                    sums[9] -= w * r[0] * r[1]
                    sums[10] -= w * r[0] * r[2]
                    sums[11] -= w * r[1] * r[2]
    return sums


@wp.kernel
def separate(
    share: wp.vec3i,
    num: Apart,
    box: Box,
    cells: Cells,
    capacity: int,
    count: wp.array(dtype=int),
    phases: wp.array2d(dtype=Phase),
    phase_of: wp.array(dtype=int),
    held: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    volume: wp.array(dtype=float),
    affine: wp.array(dtype=wp.mat33),
    elastic_normal: wp.array(dtype=wp.vec3),
    elastic_shear: wp.array(dtype=wp.vec3),
    plastic: wp.array(dtype=float),
    dt: wp.array(dtype=float),
    team: int,
    # outputs
    shift: wp.array(dtype=wp.vec4),
):
    """How far each particle is to be shifted [m], and 1 if it takes part: if it touches another, is a liquid's, or
    would flow in a step as it is."""
    thread = index_of(share, wp.tid())
    i = thread / team
    world = i / capacity
    active = i - world * capacity < count[world]
    strain, grown = float(0.0), bool(False)
    sums = Sums()
    if active and held[i] == FREE:
        phase, rate = phases[world, phase_of[i]], shear_rate(affine[i])
        if flows(phase, affine[i], elastic_normal[i], elastic_shear[i], dt[world], i, plastic):
            strain = wp.min(num.strain * rate, num.farthest)
            grown = num.evens == 1 and rest_density(mass, volume, i) < GROWN * phase.density
        if rate > num.stirred:
            x = position[i]
            near = near_faces(box, x, cells.width, True)
            walled = near_faces(box, x, cells.width, False)
            for axis in range(3):
                near[axis] = near[axis] | walled[axis]
            codes = int(1)
            if near[0] + near[1] + near[2] > 12:
                codes = 27
            for code in range(codes):
                if has_choice(near, code):
                    sums = through(num, box, cells, world, i, x, code, strain, volume, thread - i * team, team, sums)
    for k in range(12):
        sums[k] = joined(sums[k], team)
    if active and thread == i * team:
        by = wp.vec3(sums[0], sums[1], sums[2])
        if grown:
            moment = wp.mat33(
                sums[6], sums[9], sums[10], sums[9], sums[7], sums[11], sums[10], sums[11], sums[8]
            )  # fmt: skip
            by += strain * enclosed(least_eigenvalue(moment)) * wp.vec3(sums[3], sums[4], sums[5])
        by *= -num.h * num.h
        shift[i] = wp.vec4(by[0], by[1], by[2], wp.where(strain > 0.0 or wp.length_sq(by) > 0.0, 1.0, 0.0))


@wp.kernel
def spread(
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    shift: wp.array(dtype=wp.vec4),
    table: wp.array(dtype=int),
    # outputs
    nodes: wp.array(dtype=wp.vec4),
):
    """(sum of w m shift, sum of w m) of those that take part to nodes, which are empty."""
    p = wp.tid()
    world = p / capacity
    if p - world * capacity < count[world] and shift[p][3] > 0.0:
        tell_nodes(grid, world, position[p], True, mass[p] * shift[p], table, nodes)


@wp.kernel
def take_off(
    share: wp.vec3i,
    grid: Grid,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    nodes: wp.array(dtype=wp.vec4),
    # outputs
    shift: wp.array(dtype=wp.vec4),
):
    """Off each shift the mean of them that its nodes see."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and shift[p][3] > 0.0:
        mean = mean_of_nodes(grid, world, position[p], True, table, nodes)
        shift[p] = shift[p] - wp.vec4(mean[0], mean[1], mean[2], 0.0)


@wp.kernel
def shift_apart(
    share: wp.vec3i,
    grid: Grid,
    spacing: float,
    capacity: int,
    count: wp.array(dtype=int),
    shift: wp.array(dtype=wp.vec4),
    nodes: wp.array(dtype=wp.vec4),
    # outputs
    position: wp.array(dtype=wp.vec3),
    table: wp.array(dtype=int),
    block_of: wp.array(dtype=int),
    active: wp.array(dtype=int),
    homes: wp.array(dtype=int),
    fault: wp.array(dtype=int),
):
    """Shift each particle that takes part by what its nodes do not see, among active nodes."""
    p = index_of(share, wp.tid())
    world = p / capacity
    if p - world * capacity < count[world] and shift[p][3] > 0.0:
        x = position[p]
        by = wp.vec3(shift[p][0], shift[p][1], shift[p][2]) - mean_of_nodes(grid, world, x, True, table, nodes)
        by *= wp.min(1.0, LONGEST * spacing / wp.max(wp.length(by), 1.0e-12))
        if wp.length(by) > 0.0:
            position[p] = contained(grid, x + by)
            follow(grid, world, x, position[p], table, block_of, active, homes, fault)


class Separation:
    """What separating allocates, and its launches, which are Warp's whatever the solver's language."""

    def __init__(self, scene: Scene, pool: Pool, grid: Grid, plastic: wp.array, constant: float) -> None:
        """`plastic`: strains, see flow.py; `constant`: shift over strain and h^2 crowding [-]."""
        self.scene, self.pool, self.grid = scene, pool, grid
        self.elastic = [pool.elastic_normal, pool.elastic_shear, plastic]
        num = self.num = Apart()
        num.h = KERNEL * scene.spacing
        r0 = CLOSE * scene.spacing
        num.near, num.farthest = nearest(r0, num.h), farthest(scene.spacing, r0, num.h)
        num.touching = TOUCHING * scene.spacing
        num.strain = constant * EVERY * scene.clock.tick
        num.stirred = STIRRED / (EVERY * scene.clock.tick)
        num.evens = int(scene.expands)
        with wp.ScopedDevice(scene.device):
            self.shift = wp.zeros(pool.size, dtype=wp.vec4)
            self._nobody = wp.zeros(1, dtype=int)
        self.who = WhoIsWhere(scene, pool, 2.0 * num.h if scene.expands else r0)
        self.team = 1 if scene.device.is_cpu else TEAM
        self.backend = Warp(scene.crew)

    def prepare(self) -> None:
        self.who.prepare()
        for module in (__name__, clear_grid.module):
            self.scene.crew.load(module)

    def part(
        self, table: wp.array, block_of: wp.array, active: wp.array, nodes: wp.array, lanes: int, homes: Any
    ) -> None:
        """Enqueue: move apart who is too near, by way of `nodes`; `lanes` are the threads that empty them."""
        pool, scene, launch = self.pool, self.scene, self.backend.launch
        some = [pool.capacity, pool.count]
        matter = [pool.phase, pool.held, pool.position, pool.mass, pool.volume, pool.affine, *self.elastic, scene.dt]
        asked = [self.num, scene.box, self.who.cells, *some, scene.phases, *matter, self.team]
        self.who.tell(self.backend)
        launch(separate, pool.size * self.team, asked, [self.shift])
        self._spread(table, active, nodes, lanes)
        launch(take_off, pool.size, [self.grid, *some, pool.position, table, nodes], [self.shift])
        self._spread(table, active, nodes, lanes)
        launch(
            shift_apart,
            pool.size,
            [self.grid, scene.spacing, *some, self.shift, nodes],
            [
                pool.position,
                table,
                block_of,
                active,
                self._nobody if homes is None else homes.outdated,
                pool.fault,
            ],
        )

    def _spread(self, table: wp.array, active: wp.array, nodes: wp.array, lanes: int) -> None:
        pool, launch = self.pool, self.backend.launch
        launch(clear_grid, lanes, [active, lanes], [nodes])
        inputs = [self.grid, pool.capacity, pool.count, pool.position, pool.mass, self.shift, table]
        launch(spread, pool.size, inputs, [nodes])

    def footprint(self) -> dict[str, int]:
        return {"separation": self.shift.capacity + self.who.footprint()}
