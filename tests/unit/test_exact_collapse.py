"""Walls of particles that stand, lean over or squash, made by hand."""

import numpy as np
import pytest

from fluidbench.measure.collapse import Collapse, Mode, collapse_of, posture


def layers_of(count: int, lean: float = 0.0, widen: float = 1.0):
    """Layers 20 mm wide and 10 mm high, of 40 x 20 points; each lies `lean` farther off than the one below it."""
    x, z = np.meshgrid(-9.75e-3 + 0.5e-3 * np.arange(40), 0.25e-3 + 0.5e-3 * np.arange(20), indexing="ij")
    across = np.concatenate([widen * x.ravel() + k * lean for k in range(count)])
    up = np.concatenate([z.ravel() / widen + k * 10e-3 / widen for k in range(count)])
    return across, up, np.full(across.shape, 2.0), np.repeat(np.arange(count), x.size)


def test_posture_of_a_wall():
    found = posture(*layers_of(3, lean=2e-3))
    assert found["wall_lean_m"] == pytest.approx(4e-3)
    assert found["foot_width_m"] == pytest.approx(20e-3, rel=1e-3)
    assert found["wall_top_m"] == pytest.approx(30e-3, rel=1e-3)


def test_posture_weighs_by_mass_and_leaves_out_what_is_not_laid():
    across, up = np.array([0.0, 1.0, 9.0]), np.array([0.0, 0.0, 5.0])
    found = posture(across, up, np.array([3.0, 1.0, 1.0]), np.array([0, 0, -1]))
    assert found == pytest.approx({"wall_lean_m": 0.25, "foot_width_m": (12 * 0.1875) ** 0.5, "wall_top_m": 0.0})
    assert posture(across, up, np.ones(3), np.full(3, -1)) == {"wall_lean_m": 0, "foot_width_m": 0, "wall_top_m": 0}


@pytest.mark.parametrize(
    ("lean", "foot", "top", "expected"),
    [
        ([0.0, 0.009], [0.02, 0.021], [0.01, 0.02], None),  # within half a width, within a quarter of the height
        ([0.0, 0.010], [0.02, 0.021], [0.01, 0.02], Mode.BUCKLING),
        ([0.0, 0.001], [0.02, 0.028], [0.01, 0.0150], Mode.YIELDING),
        ([0.0, 0.001], [0.02, 0.028], [0.01, 0.0151], None),
        ([0.0, 0.005], [0.02, 0.028], [0.01, 0.0150], Mode.BUCKLING),  # it spread by 4 mm to either side
    ],
)
def test_what_comes_down_and_how(lean, foot, top, expected):
    found = collapse_of([1.0, 2.0], [1, 2], 0.01, lean, foot, top)
    assert found == (None if expected is None else Collapse(2.0, 2, expected))


def test_nothing_collapses_before_anything_is_laid():
    assert collapse_of([0.0, 1.0], [0, 1], 0.01, [0.0, 0.0], [0.0, 0.02], [0.0, 0.01]) is None
    assert collapse_of([], [], 0.01, [], [], []) is None
    assert collapse_of([0.0, 1.0], [1, 1], 0.01, [0.1, 0.0], [0.0, 0.02], [0.0, 0.01]) is None
