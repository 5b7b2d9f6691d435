"""The one loop over pairs of SPH and PBD, in Taichi: rows, images and sums as in pairs.py, written anew."""

from collections.abc import Callable

from .images import INDEX_BITS, INDEX_MASK
from .neighbours_taichi import image_position
from .taichi_bridge import mat3, ti, vec3


@ti.func
def as_seen(box, extra: ti.template(), row, j, code):
    return row


@ti.func
def as_summed(num, box, code, own, begun, other, r, sums):
    return sums


@ti.func
def stressed(row, at: ti.template()):
    """The matrix in nine floats of a row."""
    return mat3(
        row[at], row[at + 1], row[at + 2], row[at + 3], row[at + 4], row[at + 5], row[at + 6], row[at + 7], row[at + 8]
    )  # fmt: skip


@ti.func
def symmetric_at(row, at: ti.template()):
    """The symmetric matrix in six floats of a row: xx yy zz xy xz yz."""
    return mat3(
        row[at], row[at + 3], row[at + 4],
        row[at + 3], row[at + 1], row[at + 5],
        row[at + 4], row[at + 5], row[at + 2],
    )  # fmt: skip


@ti.func
def matrix_into(row, at: ti.template(), m):
    """The row with nine of its floats replaced by a matrix."""
    out = row
    for a, b in ti.static(ti.ndrange(3, 3)):
        out[at + 3 * a + b] = m[a, b]
    return out


@ti.func
def vector_at(row, at: ti.template()):
    return vec3(row[at], row[at + 1], row[at + 2])


@ti.func
def vector_into(row, at: ti.template(), v):
    """The row with three of its floats replaced by a vector."""
    out = row
    for axis in ti.static(range(3)):
        out[at + axis] = v[axis]
    return out


def reader(length: int) -> Callable:
    """The function that reads a row of so many floats."""

    @ti.func
    def read(rows: ti.template(), i):
        row = ti.Vector.zero(ti.f32, length)
        for q in ti.static(range(length // 4)):
            quad = rows[i * (length // 4) + q]
            for c in ti.static(range(4)):
                row[4 * q + c] = quad[c]
        return row

    return read


def writer(length: int) -> Callable:
    """The function that writes one."""

    @ti.func
    def write(rows: ti.template(), i, row):
        for q in ti.static(range(length // 4)):
            rows[i * (length // 4) + q] = ti.math.vec4(row[4 * q], row[4 * q + 1], row[4 * q + 2], row[4 * q + 3])

    return write


def over_pairs(
    length: int, sums: int, pair: Callable, seen: Callable = as_seen, across: Callable = as_summed
) -> Callable:
    """The function that sums pair(num, own, begun, other, r) over the neighbours of a particle: `own` and `other` are
    rows of `length` floats, `begun` is what the particle brings beside, r points from the neighbour. An image's row is
    seen(box, extra, row, j, code), and what it adds across(num, box, code, own, begun, other, r,
    sums)."""
    read = reader(length)

    @ti.func
    def summed(
        num,
        box,
        lists,
        entries: ti.template(),
        number: ti.template(),
        rows: ti.template(),
        extra: ti.template(),
        i,
        own,
        begun,
    ):
        total = ti.Vector.zero(ti.f32, sums)
        for k in range(number[i]):
            entry = entries[i * lists.row + k * lists.column]
            j, code = entry & INDEX_MASK, entry >> INDEX_BITS
            if entry != i:
                other = read(rows, j)
                if code > 0:
                    other = seen(
                        box, extra, vector_into(other, 0, image_position(box, vector_at(other, 0), code)), j, code
                    )
                r = vector_at(own, 0) - vector_at(other, 0)
                add = pair(num, own, begun, other, r)
                if code > 0:
                    add = across(num, box, code, own, begun, other, r, add)
                total += add
        return total

    return summed
