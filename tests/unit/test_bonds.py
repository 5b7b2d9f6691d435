"""Bonds of PBD solids: the lattice of springs has the modulus it stands for."""

import itertools

import numpy as np
import pytest

from solvers.pbd.laws import bond_stiffness, conveyed_modulus


def test_the_lattice_of_bonds_is_isotropic_with_the_right_modulus():
    """C11 = 3 C12 = 3 C44 and E = 5/2 C44 from the energy of all bonds under uniform strain (Cauchy's relations)."""
    youngs, d = 2.0e5, 0.01
    c11 = c12 = 0.0
    for cell in itertools.product((-1, 0, 1), repeat=3):
        arm = d * np.array(cell, float)
        rest = float(np.linalg.norm(arm))
        if rest > 0:
            n = arm / rest
            weight = 0.5 * bond_stiffness(youngs, d, rest) * rest**2 / d**3
            c11 += weight * n[0] ** 4
            c12 += weight * n[0] ** 2 * n[1] ** 2
    assert c11 == pytest.approx(3 * c12, rel=1e-6)
    assert 2.5 * c12 == pytest.approx(youngs, rel=1e-6)


def test_limits_of_what_a_time_step_conveys():
    assert conveyed_modulus(1e3, 0.5, 1000.0, 0.01, 1e-6) == pytest.approx(1e3, rel=1e-3)
    assert conveyed_modulus(1e12, 0.5, 1000.0, 0.01, 1e-3) == pytest.approx(0.5 * 1000.0 * 10.0**2, rel=1e-3)
