"""The search for neighbours in Warp: when lists are outdated, how far they reach, and how they are filled.

Lists reach a skin s beyond the support R, and hold while nothing has moved half of it. A wide skin costs every substep,
by (1 + s / R)^3, a narrow one more renewals, of which each costs as much as `RENEWAL` substeps, one in s / (2 u) where
the fastest moves by u a substep: together least at s^2 = 2 RENEWAL R u / 3 (nearly, for s << R). u is half the last
skin over the substeps that it held.
"""

import warp as wp

from fluidbench.native.crew import index_of, raise_fault
from fluidbench.native.scene import Box
from fluidbench.native.vector_access import largest_of_warp, load_vec4, ranked

from .cells import NOBODY, Cells, bucket_of, cell_of, place
from .images import INDEX_BITS, INDEX_MASK, has_choice, image_position, near_faces, opposite

wp.set_module_options({"enable_backward": False})
FAULT_NEIGHBOURS = 4
TEAM = wp.constant(8)  # threads that look for the neighbours of a particle on a GPU
FAR = wp.constant(1.0e9)  # beyond any support [m]
RENEWAL = wp.constant(2.0)
OUTGROWN = wp.constant(2)  # what `outdated` says where it is not that something came or went: 1


@wp.struct
class Lists:
    """Entry k of list g is entries[place_of(lists, g, k)], for k < number[g]; images begin at inside[g]. Particle i
    reads list i / group, in steps of `threads` where so many threads share it."""

    entries: wp.array(dtype=int)
    number: wp.array(dtype=int)
    inside: wp.array(dtype=int)
    group: int
    threads: int
    row: int
    column: int


@wp.func
def place_of(lists: Lists, g: int, k: int):
    """Threads that share a particle read side by side, and so do the particles of neighbouring threads."""
    step = k / lists.threads
    return g * lists.row + step * lists.column + k - step * lists.threads


@wp.func
def best_skin(last: float, held: float, radius: float):
    """The skin [m] that costs least, where the last one has held for so many substeps or more."""
    return wp.sqrt(RENEWAL * radius * last / (3.0 * wp.max(held, 1.0)))


@wp.kernel
def watch(
    share: wp.vec3i,
    capacity: int,
    count: wp.array(dtype=int),
    position: wp.array(dtype=wp.vec3),
    listed: wp.array(dtype=wp.vec3),
    radius: float,
    thinnest: float,
    # outputs
    skin: wp.array(dtype=wp.vec2),
    outdated: wp.array(dtype=int),
):
    """Mark the lists outdated once a particle has moved half the skin since they were made, or half the skin would do.
    `skin` is its width [m] and the substeps that it has held."""
    i = index_of(share, wp.tid())
    last = skin[0][0]
    half = 0.5 * last
    outgrown = bool(False)
    if i % capacity < count[i / capacity]:
        outgrown = wp.length_sq(position[i] - listed[i]) > half * half
    if i == 0:
        held = skin[0][1] + 1.0
        outgrown = outgrown or (last > thinnest and best_skin(last, held, radius) < half)
        skin[0] = wp.vec2(last, held)
    if outgrown and outdated[0] == 0:
        outdated[0] = OUTGROWN


@wp.kernel
def fit_skin(
    radius: float, thinnest: float, widest: float, outdated: wp.array(dtype=int), skin: wp.array(dtype=wp.vec2)
):
    """The skin of the next lists; where the last one was not outgrown it was wide enough."""
    last = skin[0][0]
    best = best_skin(last, skin[0][1], radius)
    if outdated[0] != OUTGROWN:
        best = wp.min(best, last)
    skin[0] = wp.vec2(wp.clamp(best, thinnest, widest), 0.0)


@wp.func
def among(position: wp.array(dtype=wp.vec3), x: wp.vec3, first: int, last: int, reach2: float):
    """Whether any of the particles from `first` to before `last` has the point x in reach."""
    found = bool(False)
    for i in range(first, last):
        if wp.length_sq(position[i] - x) < reach2:
            found = True
            break
    return found


@wp.func
def around(middle: wp.vec3i, c: int):
    """One of the 27 cells around the middle one."""
    return middle + wp.vec3i(c / 9 - 1, (c / 3) % 3 - 1, c % 3 - 1)


@wp.func
def searched(
    box: Box, position: wp.array(dtype=wp.vec3), shift: int, cell: wp.vec3i, first: int, last: int, width: float
):
    """Whether a cell is one of the 27 around any of the particles from `first` to before `last`."""
    found = bool(False)
    for i in range(first, last):
        away = cell - cell_of(image_position(box, position[i], opposite(shift)), width)
        if wp.max(wp.abs(away)) <= 1:
            found = True
            break
    return found


@wp.func
def either(a: wp.vec3i, b: wp.vec3i):
    return wp.vec3i(a[0] | b[0], a[1] | b[1], a[2] | b[2])


@wp.kernel
def fill_lists(
    share: wp.vec3i,
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    radius: float,
    skin: wp.array(dtype=wp.vec2),
    limit: int,
    cells: Cells,
    position: wp.array(dtype=wp.vec3),
    lists: Lists,
    # outputs
    listed: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
    outdated: wp.array(dtype=int),
):
    """All neighbours within reach of any particle of a group, images included.

    Periodic images are found by asking the cells at the shifted place. Mirror images need no search: a particle is
    never farther away than its image, so they are among the particles just found.
    """
    g = index_of(share, wp.tid())
    begin = g * lists.group
    world = begin / capacity
    end = wp.min(begin + lists.group, world * capacity + count[world])
    reach = radius + skin[0][0]
    reach2 = reach * reach
    n = int(0)
    shifts, mirrors = wp.vec3i(4, 4, 4), wp.vec3i(4, 4, 4)
    low = wp.vec3(FAR, FAR, FAR)
    high = -low
    for i in range(begin, end):
        listed[i] = position[i]
        low = wp.min(low, position[i])
        high = wp.max(high, position[i])
        shifts = either(shifts, near_faces(box, position[i], reach, True))
        mirrors = either(mirrors, near_faces(box, position[i], reach, False))
    most_shifts, most_mirrors = int(1), int(1)
    if shifts[0] + shifts[1] + shifts[2] > 12:
        most_shifts = 27
    if mirrors[0] + mirrors[1] + mirrors[2] > 12:
        most_mirrors = 27
    for shift in range(most_shifts):
        if has_choice(shifts, shift):
            first = n
            for i in range(begin, end):
                # where the particle sees the others when it looks through the face
                middle = cell_of(image_position(box, position[i], opposite(shift)), cells.width)
                for c in range(27):
                    cell = around(middle, c)
                    if not searched(box, position, shift, cell, begin, i, cells.width):
                        bucket = bucket_of(cells, world, cell)
                        start = cells.start[bucket]
                        for m in range(start, start + cells.number[bucket]):
                            spot = place(cells.spot[m])
                            x = image_position(box, spot, shift)
                            own_cell = wp.max(wp.abs(cell_of(spot, cells.width) - cell)) == 0
                            if own_cell and wp.length_sq(x - wp.min(wp.max(x, low), high)) < reach2:
                                j = cells.members[m]
                                if among(position, x, begin, end, reach2):
                                    if n < limit:
                                        lists.entries[place_of(lists, g, n)] = j + (shift << INDEX_BITS)
                                    n += 1
            last = wp.min(n, limit)
            if shift == 0:
                lists.inside[g] = last
            for face in range(1, most_mirrors):
                if has_choice(mirrors, face):
                    code = shift + face
                    for k in range(first, last):
                        j = lists.entries[place_of(lists, g, k)] & INDEX_MASK
                        if among(position, image_position(box, position[j], code), begin, end, reach2):
                            if n < limit:
                                lists.entries[place_of(lists, g, n)] = j + (code << INDEX_BITS)
                            n += 1
    if n > limit:
        raise_fault(fault, FAULT_NEIGHBOURS)
    lists.number[g] = wp.min(n, limit)
    if g == 0:
        outdated[0] = 0


@wp.func
def enlist(lists: Lists, i: int, entry: int, limit: int, n: int):
    """Append an entry of each thread of a team, unless it is negative; how many there are then."""
    found = ranked(entry >= 0, TEAM)
    k = n + (found & 255)
    if entry >= 0 and k < limit:
        lists.entries[place_of(lists, i, k)] = entry
    return n + (found >> 8)


@wp.func
def apart(x: wp.vec3, cell: wp.vec3i, width: float):
    """The squared distance of a point from a cell."""
    low = width * wp.vec3(float(cell[0]), float(cell[1]), float(cell[2]))
    return wp.length_sq(x - wp.min(wp.max(x, low), low + wp.vec3(width, width, width)))


@wp.kernel
def fill_in_teams(
    box: Box,
    capacity: int,
    count: wp.array(dtype=int),
    radius: float,
    skin: wp.array(dtype=wp.vec2),
    limit: int,
    cells: Cells,
    position: wp.array(dtype=wp.vec3),
    lists: Lists,
    # outputs
    listed: wp.array(dtype=wp.vec3),
    fault: wp.array(dtype=int),
    outdated: wp.array(dtype=int),
):
    """`fill_lists` for a GPU: eight threads look through the cells around one particle together. All of a warp take
    the same turns, for they count what they found together."""
    thread = wp.tid()
    i = thread / TEAM
    member = thread - i * TEAM
    world = i / capacity
    active = i - world * capacity < count[world]
    x = position[i]
    if active and member == 0:
        listed[i] = x
    n = int(0)
    reach = radius + skin[0][0]
    reach2 = reach * reach
    shifts = near_faces(box, x, reach, True)
    mirrors = near_faces(box, x, reach, False)
    most_shifts, most_mirrors = int(1), int(1)
    if active and shifts[0] + shifts[1] + shifts[2] > 12:
        most_shifts = 27
    if active and mirrors[0] + mirrors[1] + mirrors[2] > 12:
        most_mirrors = 27
    most_shifts = largest_of_warp(most_shifts)
    most_mirrors = largest_of_warp(most_mirrors)
    for shift in range(most_shifts):
        first = n
        at = image_position(box, x, opposite(shift))
        middle = cell_of(at, cells.width)
        searching = active and has_choice(shifts, shift)
        for c in range(27):
            cell = around(middle, c)
            bucket = bucket_of(cells, world, cell)
            start, number = int(0), int(0)
            if searching and apart(at, cell, cells.width) < reach2:
                start = cells.start[bucket]
                number = cells.number[bucket]
            for base in range(member, largest_of_warp(number) + member, TEAM):
                entry = int(NOBODY)
                if base < number:
                    if wp.length_sq(place(load_vec4(cells.spot, start + base)) - at) < reach2:
                        entry = cells.members[start + base] + (shift << INDEX_BITS)
                n = enlist(lists, i, entry, limit, n)
        last = wp.min(n, limit)
        if shift == 0 and active:
            lists.inside[i] = last
        for face in range(1, most_mirrors):
            code = shift + face
            found = int(0)
            if searching and has_choice(mirrors, face):
                found = last - first
            for base in range(member, largest_of_warp(found) + member, TEAM):
                entry = int(NOBODY)
                if base < found:
                    j = lists.entries[place_of(lists, i, first + base)] & INDEX_MASK
                    if wp.length_sq(image_position(box, position[j], code) - x) < reach2:
                        entry = j + (code << INDEX_BITS)
                n = enlist(lists, i, entry, limit, n)
    if member == 0:
        if n > limit:
            raise_fault(fault, FAULT_NEIGHBOURS)
        lists.number[i] = wp.min(n, limit)
    if thread == 0:
        outdated[0] = 0
