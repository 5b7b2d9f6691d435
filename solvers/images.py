"""Walls and periodic axes as images: a neighbour is a particle, or its image in a face.

An entry of a list holds the particle's index in its low 26 bits and the image's code cx + 3 cy + 9 cz above them, c = 0
for none, 1 for the lower face's image, 2 for the upper one's. A mirror image completes the kernel at a wall exactly; a
periodic image is a shift.
"""

import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, STICK, Box

wp.set_module_options({"enable_backward": False})
INDEX_BITS = wp.constant(26)
INDEX_MASK = wp.constant(2**26 - 1)
WALL_INSET = wp.constant(0.2)  # closest approach to a wall, in particle spacings; at rest the first layer is at 0.5


@wp.func
def image_code(code: int, axis: int):
    """0, 1 or 2: which image the code means on one axis."""
    digit = code
    if axis == 1:
        digit = code / 3
    elif axis == 2:
        digit = code / 9
    return digit % 3


@wp.func
def image_position(box: Box, x: wp.vec3, code: int):
    """The image of a point; undoing a periodic shift needs the opposite code."""
    out = x
    for axis in range(3):
        c = image_code(code, axis)
        if c == 1:
            if box.lower_kind[axis] == PERIODIC:
                out[axis] = x[axis] - (box.upper[axis] - box.lower[axis])
            else:
                out[axis] = 2.0 * box.lower[axis] - x[axis]
        elif c == 2:
            if box.upper_kind[axis] == PERIODIC:
                out[axis] = x[axis] + (box.upper[axis] - box.lower[axis])
            else:
                out[axis] = 2.0 * box.upper[axis] - x[axis]
    return out


@wp.func
def face_kind(box: Box, code: int, axis: int):
    """Kind of the wall that the code mirrors in on this axis; PERIODIC where it mirrors in none."""
    c = image_code(code, axis)
    kind = int(PERIODIC)
    if c == 1:
        kind = box.lower_kind[axis]
    elif c == 2:
        kind = box.upper_kind[axis]
    return kind


@wp.func
def mirroring_faces(box: Box, code: int):
    """1 for each axis on which the code mirrors in a wall."""
    mirrors = wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        if face_kind(box, code, axis) != PERIODIC:
            mirrors[axis] = 1.0
    return mirrors


@wp.func
def kinds_of_faces(box: Box, code: int):
    """1 for each axis on which the code mirrors in a friction wall, -1 where in a no-slip wall."""
    kinds = wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind == FRICTION:
            kinds[axis] = 1.0
        elif kind == STICK:
            kinds[axis] = -1.0
    return kinds


@wp.func
def image_velocity(box: Box, v: wp.vec3, code: int):
    """A velocity seen in the walls: slip and friction mirror the normal component, stick turns all of them round."""
    out = v
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind == STICK:
            out = -out
        elif kind != PERIODIC:
            out[axis] = -out[axis]
    return out


@wp.func
def turned_back(box: Box, code: int):
    """Per axis, 2 where the derivative along it is of an image's velocity turned round once more, else 0: along no-slip
    walls, across which alone velocities are turned.

    Stress is seen in such walls as it is, for flow goes on along them, so derivatives along them must be of velocities
    as they are: stress does exactly the work of the strain then (see `corrected.py`). With derivatives of velocities
    turned round along walls, too, what lies near them hardly stretched, and what rested on a floor fed on the
    difference.
    """
    turns, back = float(1.0), wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        if face_kind(box, code, axis) == STICK:
            turns = -turns
    for axis in range(3):
        back[axis] = 1.0 - wp.where(face_kind(box, code, axis) == STICK, -turns, turns)
    return back


@wp.func
def image_gradient(box: Box, g: wp.vec3, code: int):
    """The gradient of a scalar seen in the walls: mirrors turn its normal component round."""
    out = g
    for axis in range(3):
        if face_kind(box, code, axis) != PERIODIC:
            out[axis] = -out[axis]
    return out


@wp.func
def image_traction(box: Box, g: wp.vec3, code: int):
    """What pulls matter back to its neighbours' linear flow, seen in the walls. No-slip walls leave it as it is: a flow
    that is bent at the wall is bent on behind it, and mirrored it would drag."""
    out = g
    for axis in range(3):
        kind = face_kind(box, code, axis)
        if kind != PERIODIC and kind != STICK:
            out[axis] = -out[axis]
    return out


@wp.func
def walled(box: Box, x: wp.vec3, inset: float):
    """A position kept `inset` in front of walls, so it never meets its own image."""
    out = x
    for axis in range(3):
        if box.lower_kind[axis] != PERIODIC:
            out[axis] = wp.clamp(x[axis], box.lower[axis] + inset, box.upper[axis] - inset)
    return out


@wp.func
def contained(box: Box, x: wp.vec3, inset: float):
    """The same, wrapped along periodic axes, too. Lists name images by the side on which they were: they must be made
    anew before the next sum over them."""
    out = walled(box, x, inset)
    for axis in range(3):
        low, high = box.lower[axis], box.upper[axis]
        if box.lower_kind[axis] == PERIODIC:
            if x[axis] < low:
                out[axis] = x[axis] + (high - low)
            elif x[axis] >= high:
                out[axis] = x[axis] - (high - low)
    return out


@wp.func
def near_faces(box: Box, x: wp.vec3, reach: float, periodic: bool):
    """Per axis, bits 1 and 2 for the lower and upper face whose images (periodic, or mirrored) may come within reach;
    bit 4, always set, for no image."""
    near = wp.vec3i(4, 4, 4)
    for axis in range(3):
        if (box.lower_kind[axis] == PERIODIC) == periodic:
            if x[axis] - box.lower[axis] < reach:
                near[axis] = near[axis] + 1
            if box.upper[axis] - x[axis] < reach:
                near[axis] = near[axis] + 2
    return near


@wp.func
def has_choice(near: wp.vec3i, code: int):
    """Whether all of the faces that a code uses are near."""
    zero = (code % 3 == 0) or (near[0] & (code % 3)) != 0
    one = ((code / 3) % 3 == 0) or (near[1] & ((code / 3) % 3)) != 0
    two = (code / 9 == 0) or (near[2] & (code / 9)) != 0
    return zero and one and two


@wp.func
def undoing(box: Box, code: int):
    """The code that undoes an image: of a mirror the same, of a periodic shift the opposite."""
    back = int(0)
    power = int(1)
    for axis in range(3):
        c = image_code(code, axis)
        if c > 0 and face_kind(box, code, axis) == PERIODIC:
            c = 3 - c
        back += c * power
        power *= 3
    return back


@wp.func
def opposite(code: int):
    """The code that undoes a periodic shift."""
    back = int(0)
    power = int(1)
    for axis in range(3):
        back += ((3 - image_code(code, axis)) % 3) * power
        power *= 3
    return back
