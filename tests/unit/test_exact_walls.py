"""Walls, images, contact and stress as the kernels see them, by hand: device functions called one by one."""

import math

import numpy as np
import pytest
import warp as wp

from fluidbench.native.scene import FRICTION, PERIODIC, SLIP, STICK, Box
from solvers import cells, neighbours
from solvers.corrected import mirrored_stress
from solvers.images import (
    contained,
    face_kind,
    has_choice,
    image_code,
    image_gradient,
    image_position,
    image_traction,
    image_velocity,
    near_faces,
    opposite,
    turned_back,
)
from solvers.pbd import walls

wp.set_module_options({"enable_backward": False})

LOW, HIGH = np.array([0.0, -1.0, 2.0]), np.array([1.0, 2.0, 7.0])
V = (1.0, 2.0, 4.0)


def box(*kinds):
    """A box of 1 x 3 x 5 whose axes have these kinds of walls."""
    made = Box()
    made.lower, made.upper = wp.vec3(*LOW), wp.vec3(*HIGH)
    made.lower_kind = made.upper_kind = wp.vec3i(*[int(k) for k in kinds])
    return made


def code_of(*choices):
    return sum(c * 3**axis for axis, c in enumerate(choices))


@wp.kernel
def look(
    b: Box,
    x: wp.vec3,
    v: wp.vec3,
    g: wp.mat33,
    near: wp.vec3i,
    code: wp.array(dtype=int),
    # outputs
    vectors: wp.array2d(dtype=wp.vec3),
    matrices: wp.array2d(dtype=wp.mat33),
    numbers: wp.array2d(dtype=int),
):
    """Everything that image codes mean, as integers of the device understand them."""
    i = wp.tid()
    c = code[i]
    vectors[i, 0] = image_position(b, x, c)
    vectors[i, 1] = image_velocity(b, v, c)
    vectors[i, 2] = image_gradient(b, v, c)
    vectors[i, 3] = image_traction(b, v, c)
    vectors[i, 4] = turned_back(b, c)
    matrices[i, 0] = mirrored_stress(b, g, c)
    for axis in range(3):
        numbers[i, axis] = image_code(c, axis)
        numbers[i, 3 + axis] = face_kind(b, c, axis)
    numbers[i, 6] = opposite(c)
    numbers[i, 7] = int(has_choice(near, c))


X, GRADIENT = np.array([0.25, 0.5, 3.0]), np.arange(1.0, 10.0).reshape(3, 3)


def seen(b, *codes, near=(7, 7, 7)):
    """(vectors, matrices, numbers) of each code, see `look`."""
    n = len(codes)
    out = [wp.zeros((n, 5), dtype=wp.vec3), wp.zeros((n, 1), dtype=wp.mat33), wp.zeros((n, 8), dtype=int)]
    wp.launch(
        look,
        n,
        [b, wp.vec3(*X), wp.vec3(*V), wp.mat33(*GRADIENT.ravel()), wp.vec3i(*near), wp.array(codes, dtype=int)],
        out,
    )
    return [array.numpy() for array in out]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("kind", [SLIP, STICK, FRICTION, PERIODIC])
def test_images_in_each_face(axis, kind):
    """A stress changes sign with what slips, a pull against crooked motion with its normal component, but at no-slip
    walls. Along these velocities are turned back."""
    b = box(*[kind if a == axis else SLIP for a in range(3)])
    for choice, mirror, shift in ((1, 2 * LOW - X, LOW - HIGH), (2, 2 * HIGH - X, HIGH - LOW)):
        choices = [choice if a == axis else 0 for a in range(3)]
        (x, v, g, pull, back), (stress,), numbers = (rows[0] for rows in seen(b, code_of(*choices)))
        expected = X.copy()
        expected[axis] = X[axis] + shift[axis] if kind == PERIODIC else mirror[axis]
        assert x == pytest.approx(expected)
        assert list(numbers[:3]) == choices
        assert list(numbers[3:6]) == [kind if a == axis else PERIODIC for a in range(3)]
        assert numbers[6] == code_of(*[(3 - c) % 3 for c in choices])
        one = np.array([-1.0 if a == axis else 1.0 for a in range(3)])
        turned = {SLIP: one, FRICTION: one, STICK: -np.ones(3), PERIODIC: np.ones(3)}[kind]
        normal = np.ones(3) if kind == PERIODIC else one
        assert v.tolist() == (turned * V).tolist() and g.tolist() == (normal * V).tolist()
        assert pull.tolist() == ((one if kind in (SLIP, FRICTION) else np.ones(3)) * V).tolist()
        assert back.tolist() == ((one + 1.0) if kind == STICK else np.zeros(3)).tolist()
        signs = one if kind in (SLIP, FRICTION) else np.ones(3)
        assert stress == pytest.approx(np.outer(signs, signs) * GRADIENT)


def test_images_in_corners_combine():
    (x, v, g, pull, back), (stress,), numbers = (rows[0] for rows in seen(box(SLIP, STICK, PERIODIC), code_of(1, 2, 1)))
    assert (
        x == pytest.approx([-0.25, 3.5, -2.0]) and v.tolist() == [1.0, -2.0, -4.0] and g.tolist() == [-1.0, -2.0, 4.0]
    )
    assert list(numbers) == [1, 2, 1, SLIP, STICK, PERIODIC, code_of(2, 1, 2), 1]
    assert pull.tolist() == (np.array([-1, 1, 1]) * V).tolist() and back.tolist() == [2.0, 0.0, 2.0]
    assert seen(box(STICK, STICK, SLIP), code_of(1, 1, 0))[0][0, 4].tolist() == [2.0, 2.0, 0.0]
    assert stress == pytest.approx(np.outer([-1, 1, 1], [-1, 1, 1]) * GRADIENT)


def test_the_upper_wall_has_its_own_kind():
    b = box(SLIP, SLIP, SLIP)
    b.upper_kind = wp.vec3i(STICK, FRICTION, SLIP)
    numbers = seen(b, code_of(2, 2, 2), code_of(1, 1, 1))[2]
    assert numbers[:, 3:6].tolist() == [[STICK, FRICTION, SLIP], [SLIP] * 3]


def test_codes_use_faces_that_are_near():
    allowed = seen(box(SLIP, SLIP, SLIP), *range(27), near=(5, 4, 7))[2][:, 7]
    assert set(np.flatnonzero(allowed)) == {code_of(a, 0, c) for a in (0, 1) for c in (0, 1, 2)}
    allowed = seen(box(SLIP, SLIP, SLIP), *range(27), near=(4, 6, 4))[2][:, 7]
    assert set(np.flatnonzero(allowed)) == {code_of(0, b, 0) for b in (0, 2)}


def test_particles_stay_in_front_of_walls_and_wrap():
    b = box(SLIP, PERIODIC, STICK)
    for x, inside in (
        ((-1.0, 0.0, 1.0), (0.1, 0.0, 2.1)),
        ((5.0, 2.0, 9.0), (0.9, -1.0, 6.9)),
        ((0.5, -1.01, 3.0), (0.5, 1.99, 3.0)),
        ((0.05, -1.0, 6.95), (0.1, -1.0, 6.9)),
        ((0.5, 2.5, 3.0), (0.5, -0.5, 3.0)),
    ):
        assert list(contained(b, wp.vec3(*x), 0.1)) == pytest.approx(inside)
    assert list(walls.pushed(b, wp.vec3(-1.0, 2.5, 3.0), wp.vec3(0.1, -0.5, 3.0))) == pytest.approx([1.1, 0.0, 0.0])


def test_faces_that_are_near_and_codes_that_use_them():
    b = box(SLIP, PERIODIC, SLIP)
    for x, periodic, bits in (
        ((0.05, -0.9, 4.0), False, (5, 4, 4)),
        ((0.05, -0.9, 4.0), True, (4, 5, 4)),
        ((0.95, 1.9, 6.9), False, (6, 4, 6)),
        ((0.95, 1.9, 6.9), True, (4, 6, 4)),
        ((0.5, 0.0, 4.0), False, (4, 4, 4)),
        ((0.3, 0.0, 4.0), False, (4, 4, 4)),
    ):
        assert tuple(near_faces(b, wp.vec3(*x), 0.2, periodic)) == bits
    assert tuple(near_faces(b, wp.vec3(0.5, 0.0, 4.0), 0.6, False)) == (7, 4, 4)


def test_lists_have_room_for_matter_that_is_1_7_times_as_dense():
    for ratio in (1.2, 2.0, 3.0):
        most = 1.7 * 4 / 3 * math.pi * ratio**3
        assert most <= neighbours.room(ratio) < most + 24 and neighbours.room(ratio) % 16 == 8


def test_few_particles_are_shared_by_more_threads_as_long_as_each_has_enough_to_do():
    assert [neighbours.threads_for(n, 200) for n in (10**9, 2**16, 2**15, 2**14, 2**13, 1)] == [4, 4, 8, 16, 16, 16]
    assert [neighbours.threads_for(1, n) for n in (10, 60, 100, 250, 1000)] == [4, 4, 8, 16, 32]


def test_a_grid_of_cells_covers_the_domain_or_repeats_itself():
    assert cells.sides_for([1.0, 6.0, 14.0], 10**6) == [4, 8, 16] and cells.sides_for([14.1], 10**6) == [32]
    assert cells.sides_for([1000.0, 1000.0, 3.0], 1000) == [8, 16, 8] and cells.sides_for([1e6] * 3, 1) == [
        4,
        4,
        4,
    ]


# --- rubbing of PBD


def test_what_rubs_on_a_face():
    table = {(FRICTION, 0.9): True, (FRICTION, 1.1): False, (STICK, 0.9): False, (SLIP, 0.9): False}
    assert {key: bool(walls.rubbing(int(key[0]), key[1], 1.0)) for key in table} == table
