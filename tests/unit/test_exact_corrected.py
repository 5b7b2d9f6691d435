"""Corrected gradients and the strain of a step, by hand: device functions called one by one."""

import math

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from solvers.corrected import (
    SOUND,
    elastic_stress,
    from_before,
    least_eigenvalue,
    spanned,
    strain_by_chords,
    symmetric_inverse,
)

H = 0.01


def thin(least):
    """diag(1, 1, a) with 4 a / (2 + a)^2 = least."""
    return np.diag([1.0, 1.0, (2 - 2 * least - 2 * math.sqrt(1 - 2 * least)) / least])


FULL = np.array([[0.5, 0.1, 0.0], [0.1, 0.75, 0.2], [0.0, 0.2, 1.0]])
PAIR = np.outer([0.3, 0.1, 0.2], [0.3, 0.1, 0.2])
TRIO = PAIR + np.outer([-0.1, 0.3, 0.1], [-0.1, 0.3, 0.1])
MOMENTS = [FULL, thin(0.1), TRIO, PAIR, np.zeros((3, 3))]


def mat(m):
    return wp.mat33(*np.ravel(m).tolist())


def array(m):
    return np.array(m).reshape(3, 3)


def came(moment, deformation, h=H):
    """(rate of strain, velocity gradient over where matter was) of a particle whose neighbours have this moment, after
    a step in which all of them were deformed so."""
    rate = (np.eye(3) - np.linalg.inv(deformation)) / h
    inverse = symmetric_inverse(mat(moment))
    span = spanned(mat(moment), inverse)
    gradient = mat(rate @ moment) * inverse
    strain = strain_by_chords(span, gradient, h)
    return array(strain), array(from_before(strain, span * gradient, h))


def test_a_moment_is_inverted_where_it_is_sound_and_held_back_where_it_is_not():
    """4 det / trace^2 of diag(1, 1, a): from 0.12 on the inverse, up to 0.08 m (m^2 + 0.12^2)^-1."""
    moments = [FULL, thin(0.1), thin(0.079), thin(0.121)]
    least = [least_eigenvalue(mat(m)) for m in moments]
    assert least == pytest.approx([4 * np.linalg.det(FULL) / 2.25**2, 0.1, 0.079, 0.121], rel=1e-4)
    for moment, held in zip(moments, (0.0, 0.5, 1.0, 0.0), strict=True):
        known = moment @ np.linalg.inv(moment @ moment + held * float(SOUND) ** 2 * np.eye(3))
        inverse = symmetric_inverse(mat(moment))
        assert array(inverse) == pytest.approx(known, rel=1e-3, abs=1e-5)
        assert array(spanned(mat(moment), inverse)) == pytest.approx(moment @ known, rel=1e-3, abs=1e-5)
    assert not array(symmetric_inverse(mat(np.zeros((3, 3))))).any()


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_rotation_is_no_strain_whatever_neighbours_span(moment):
    turn = Rotation.from_rotvec([0.06, -0.05, 0.08]).as_matrix()
    strain, gradient = came(moment, turn)
    angle = 0.112
    assert H * strain == pytest.approx(0.0, abs=angle**4)  # without the chords it is the angle squared
    step = np.eye(3) + H * gradient
    assert step @ step.T == pytest.approx(np.eye(3), abs=angle**4)


@pytest.mark.parametrize(
    "deformation",
    [np.diag([1.02, 0.99, 1.01]), np.eye(3) + 0.03 * np.outer([1, 0, 0], [0, 1, 0])],
    ids=["stretch", "shear"],
)
def test_a_strain_is_exact_to_second_order(deformation):
    """The left Cauchy-Green tensor of the step, and its volume: that of a shear is none."""
    strain, gradient = came(FULL, deformation)
    step = np.eye(3) + H * gradient
    assert step @ step.T == pytest.approx(deformation @ deformation.T, abs=0.03**3 * 2)
    assert H * np.trace(strain) == pytest.approx(np.log(np.linalg.det(deformation)), abs=0.03**3 * 2)


def test_stress_of_an_elastic_tensor_by_hand():
    """G dev b - p, with G = 2, b = (1, 2, 6), its mean 3."""
    got = array(elastic_stress(2.0, wp.vec3(1.0, 2.0, 6.0), wp.vec3(0.5, 0.25, 0.125), 10.0))
    assert got == pytest.approx(np.array([[-14.0, 1.0, 0.5], [1.0, -12.0, 0.25], [0.5, 0.25, -4.0]]))
