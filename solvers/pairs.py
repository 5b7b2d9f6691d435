"""The one loop over pairs of SPH and PBD, in Warp.

What a pass asks of a particle, its own or a neighbour's, is a row of packed floats: position first, read 16 bytes at a
time. A pass is then short functions: what a neighbour's row looks like as an image in a wall (`seen`), what a pair adds
(`pair`), what a particle does with the sums (`finish`).

On the CPU each neighbour is weighed against the eight particles that share its list (neighbours.py) at once: LLVM makes
vector instructions of the loop over them, for there is no branch in it; a particle's own entry is moved beyond every
kernel's support instead (Pall & Hess 2013, Comput. Phys. Commun. 184:2641, cluster pairs). On a GPU several threads
share a particle, read 16 bytes at a time, and join their sums by shuffles.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from fluidbench.native.crew import BLOCK, index_of
from fluidbench.native.scene import Box
from fluidbench.native.vector_access import joined, load_int, load_vec4

from .images import INDEX_BITS, INDEX_MASK, image_position
from .neighbours import LANES
from .search import FAR, Lists

OWN = 4  # further floats that a particle brings to its pairs, which no neighbour is asked for
HEAVY, BLOCKS = 20, 6  # passes of so many floats are held to registers that let so many blocks share a multiprocessor
ROWS_AHEAD = 24  # floats of neighbours' rows that a thread of a GPU has on their way at once, of two rows at least
ahead = wp.types.vector(length=4, dtype=int)


@cache
def floats(length: int) -> Any:
    """A Warp vector of so many floats."""
    return wp.types.vector(length=length, dtype=float)


@wp.func
def nothing(num: Any, data: Any, world: int, i: int):
    return wp.vec4()


@wp.func
def alike(box: Box, data: Any, row: Any, j: int, code: int):
    return row


@wp.func
def no_faces(box: Box, code: int):
    return wp.vec3()


@wp.func
def as_summed(num: Any, faces: wp.vec3, own: Any, other: Any, r: wp.vec3, sums: Any):
    return sums


@dataclass(frozen=True)
class Pass:
    """A sum over pairs. `row` floats are asked of each particle (a multiple of 4), `sums` are added up. Its functions
    are Warp's:

    - begin(num, data, world, i) -> vec4: what the particle itself brings to its pairs beyond its row
    - seen(box, data, row, j, code) -> row: an image's, whose position is in place already
    - pair(num, own, other, r) -> sums: r points from the neighbour; own has the row, then what `begin` gave
    - faces(box, code) -> vec3: what `across` asks of the walls that an image lies behind, found once an image
    - across(num, faces, own, other, r, sums) -> sums: what an image adds, of what it would as a particle
    - finish(num, box, data, world, i, own, sums)
    """

    num: Any
    data: Any
    row: int
    sums: int
    pair: Callable
    finish: Callable
    begin: Callable = nothing
    seen: Callable = alike
    faces: Callable = no_faces
    across: Callable = as_summed

    def compiled(self, name: str, cpu: bool) -> wp.Kernel:
        """The kernel, in a module of its own; launched with `work` threads (neighbours.py)."""
        function = (_side_by_side if cpu else _in_teams)(self)
        function.__name__ = function.__qualname__ = name
        # LLVM makes vectors of the loop over particles only if Warp leaves it one; shorter loops Warp must unroll, and
        # none within it may be so long that LLVM does not
        options = {"fast_math": True, "enable_backward": False} | ({"max_unroll": LANES - 1} if cpu else {})
        bounds = (BLOCK, BLOCKS) if self.row + self.sums >= HEAVY else None
        return wp.kernel(function, module="unique", enable_backward=False, module_options=options, launch_bounds=bounds)


def _reader(length: int) -> Callable:
    """The function that reads a row."""
    Row = floats(length)

    @wp.func
    def read(rows: wp.array(dtype=wp.vec4), i: int):
        row = Row()
        for q in range(wp.static(length // 4)):
            quad = load_vec4(rows, i * wp.static(length // 4) + q)
            for c in range(4):
                row[4 * q + c] = quad[c]
        return row

    return read


def _side_by_side(p: Pass) -> Callable:
    """Eight particles against one neighbour at a time."""
    N, F = p.row, p.sums
    Own, Sums = floats(N + OWN), floats(F)
    Rows, Totals = (wp.types.matrix(shape=(k, LANES), dtype=float) for k in (N + OWN, F))
    read, begin, seen, pair, finish = _reader(N), p.begin, p.seen, p.pair, p.finish
    faces, across = p.faces, p.across

    def sweep(
        share: wp.vec3i,
        num: p.num,
        box: Box,
        lists: Lists,
        capacity: int,
        count: wp.array(dtype=int),
        rows: wp.array(dtype=wp.vec4),
        data: p.data,
    ):
        group = index_of(share, wp.tid())
        first = group * LANES
        world = first / capacity
        owns = Rows()
        totals = Totals()
        for lane in range(wp.static(LANES)):
            row = read(rows, first + lane)
            extra = begin(num, data, world, first + lane)
            for c in range(wp.static(N)):
                owns[c, lane] = row[c]
            for c in range(wp.static(OWN)):
                owns[N + c, lane] = extra[c]
        start = group * lists.row
        for k in range(lists.inside[group]):
            j = lists.entries[start + k]
            other = read(rows, j)
            for lane in range(wp.static(LANES)):
                own = Own()
                for q in range(wp.static((N + OWN) // 4)):
                    for c in range(4):
                        own[4 * q + c] = owns[4 * q + c, lane]
                r = wp.vec3(own[0] - other[0], own[1] - other[1], own[2] - other[2])
                r[0] = wp.where(j == first + lane, FAR, r[0])
                add = pair(num, own, other, r)
                for q in range(wp.static(F // 4)):
                    for c in range(4):
                        totals[4 * q + c, lane] += add[4 * q + c]
                for c in range(wp.static(F - F % 4), wp.static(F)):
                    totals[c, lane] += add[c]
        for k in range(lists.inside[group], lists.number[group]):
            entry = lists.entries[start + k]
            j = entry & INDEX_MASK
            code = entry >> INDEX_BITS
            other = read(rows, j)
            x = image_position(box, wp.vec3(other[0], other[1], other[2]), code)
            for c in range(3):
                other[c] = x[c]
            other = seen(box, data, other, j, code)
            behind = faces(box, code)
            for lane in range(wp.static(LANES)):
                own = Own()
                for q in range(wp.static((N + OWN) // 4)):
                    for c in range(4):
                        own[4 * q + c] = owns[4 * q + c, lane]
                r = wp.vec3(own[0] - other[0], own[1] - other[1], own[2] - other[2])
                add = across(num, behind, own, other, r, pair(num, own, other, r))
                for q in range(wp.static(F // 4)):
                    for c in range(4):
                        totals[4 * q + c, lane] += add[4 * q + c]
                for c in range(wp.static(F - F % 4), wp.static(F)):
                    totals[c, lane] += add[c]
        for lane in range(wp.static(LANES)):
            if first + lane - world * capacity < count[world]:
                own = Own()
                for q in range(wp.static((N + OWN) // 4)):
                    for c in range(4):
                        own[4 * q + c] = owns[4 * q + c, lane]
                sums = Sums()
                for c in range(wp.static(F)):
                    sums[c] = totals[c, lane]
                finish(num, box, data, world, first + lane, own, sums)

    return sweep


def _in_teams(p: Pass) -> Callable:
    """Several threads for one particle, each with every so manieth neighbour."""
    N, F = p.row, p.sums
    Row, Own, Sums = floats(N), floats(N + OWN), floats(F)
    read, begin, seen, pair, finish = _reader(N), p.begin, p.seen, p.pair, p.finish
    faces, across = p.faces, p.across

    STEPS = min(max(ROWS_AHEAD // N, 2), 4)
    Others = wp.types.matrix(shape=(STEPS, N), dtype=float)

    @wp.func
    def inside(num: p.num, i: int, own: Own, entry: int, other: Row):
        """What a particle of the list of particle i adds; nothing where that is the particle itself."""
        r = wp.vec3(own[0] - other[0], own[1] - other[1], own[2] - other[2])
        r[0] = wp.where(entry == i, FAR, r[0])
        return pair(num, own, other, r)

    @wp.func
    def image(num: p.num, box: Box, data: p.data, own: Own, entry: int, other: Row):
        """What an image adds."""
        code = entry >> INDEX_BITS
        x = image_position(box, wp.vec3(other[0], other[1], other[2]), code)
        for c in range(3):
            other[c] = x[c]
        other = seen(box, data, other, entry & INDEX_MASK, code)
        r = wp.vec3(own[0] - other[0], own[1] - other[1], own[2] - other[2])
        return across(num, faces(box, code), own, other, r, pair(num, own, other, r))

    def sweep(
        num: p.num,
        box: Box,
        lists: Lists,
        capacity: int,
        count: wp.array(dtype=int),
        rows: wp.array(dtype=wp.vec4),
        data: p.data,
    ):
        thread = wp.tid()
        i = thread / lists.threads
        member = thread - i * lists.threads
        world = i / capacity
        active = i - world * capacity < count[world]
        row = read(rows, i)
        extra = begin(num, data, world, i)
        own = Own()
        for c in range(wp.static(N)):
            own[c] = row[c]
        for c in range(wp.static(OWN)):
            own[N + c] = extra[c]
        sums = Sums()
        n, plain = int(0), int(0)
        if active:
            n = lists.number[i]
            plain = lists.inside[i]
        k = int(member)
        at = int(thread)
        step = wp.static(STEPS) * lists.threads
        # some at a time, without a branch: while one is weighed the others are on their way
        while k + step - lists.threads < plain:
            others = Others()
            entries = ahead()
            for u in range(wp.static(STEPS)):
                entries[u] = load_int(lists.entries, at + u * lists.column)
            for u in range(wp.static(STEPS)):
                other = read(rows, entries[u])
                for c in range(wp.static(N)):
                    others[u, c] = other[c]
            for u in range(wp.static(STEPS)):
                other = Row()
                for c in range(wp.static(N)):
                    other[c] = others[u, c]
                sums += inside(num, i, own, entries[u], other)
            k += step
            at += wp.static(STEPS) * lists.column
        while k < n:
            entry = load_int(lists.entries, at)
            other = read(rows, entry & INDEX_MASK)
            if entry == (entry & INDEX_MASK):
                sums += inside(num, i, own, entry, other)
            else:
                sums += image(num, box, data, own, entry, other)
            k += lists.threads
            at += lists.column
        for c in range(wp.static(F)):
            sums[c] = joined(sums[c], lists.threads)
        if active and member == 0:
            finish(num, box, data, world, i, own, sums)

    return sweep
