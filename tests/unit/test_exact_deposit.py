"""The deposited field, its surface and its sections against fields written down cell by cell."""

import math

import numpy as np
import pytest
from scipy.ndimage import map_coordinates, spline_filter

from fluidbench.measure.deposit import Deposit, Section, cut
from fluidbench.scenario import Domain

D = 0.5
BOX = Domain(lower=(-1.0, 0.0, 2.0), upper=(4.0, 6.0, 9.0))  # 10 x 12 x 14 cells


def spread(points, volumes, domain=BOX, spacing=D):
    return Deposit.of(np.array(points, float), np.array(volumes, float), domain, spacing)


def value(deposit, domain, i, j, k):
    """Fill of cell (i, j, k), counted from the domain's lower corner."""
    first = np.rint((deposit.origin - np.asarray(domain.lower)) / deposit.spacing - 0.5).astype(int)
    place = np.array([i, j, k]) - first
    return deposit.fill[tuple(place)] if (place >= 0).all() and (place < deposit.fill.shape).all() else 0.0


def test_a_particle_in_a_cells_middle_fills_27_cells_by_the_quadratic_spline():
    deposit = spread([[-1.0 + 4.5 * D, 5.5 * D, 2.0 + 6.5 * D]], [0.7])
    for i in range(-2, 3):
        for j in range(-2, 3):
            for k in range(-2, 3):
                weights = [{0: 0.75, 1: 0.125}.get(abs(n), 0.0) for n in (i, j, k)]
                expected = 0.7 / D**3 * math.prod(weights)
                assert value(deposit, BOX, 4 + i, 5 + j, 6 + k) == pytest.approx(expected, abs=1e-12)
    assert deposit.volume() == pytest.approx(0.7) and deposit.spacing == D
    for axis in range(3):  # the outermost cells are empty, since the field extends as they are
        assert not deposit.fill.take([0, -1], axis=axis).any()


def test_a_particle_off_the_middle_leans_to_the_nearer_cell():
    """A quarter of a cell: (1.5 - 1.25)^2 / 2, 3/4 - 1/16, (1.25 - 0.5)^2 / 2 to either side; and nearly half."""
    quarter, half = (0.03125, 0.6875, 0.28125), (0.5 * 0.01**2, 0.75 - 0.49**2, 0.5 * 0.99**2)
    for shift, weights in ((0.25, quarter), (-0.25, quarter[::-1]), (0.49, half), (-0.49, half[::-1])):
        deposit = spread([[-1.0 + (4.5 + shift) * D, 5.5 * D, 2.0 + 6.5 * D]], [D**3])
        assert [value(deposit, BOX, i, 5, 6) for i in (3, 4, 5)] == pytest.approx([w * 0.75**2 for w in weights])


def test_particles_add_up_and_edges_of_cells_do_not_matter():
    place = [-1.0 + 4.0 * D, 5.5 * D, 2.0 + 6.5 * D]  # on a face between two cells
    deposit = spread([place, place], [D**3, 3.0 * D**3])
    assert [value(deposit, BOX, i, 5, 6) for i in (2, 3, 4, 5)] == pytest.approx([0, 2.25 / 2, 2.25 / 2, 0], abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("upper", [False, True])
def test_walls_mirror_what_would_lie_behind_them(axis, upper):
    """A particle in the middle of a wall's cell: what the spline puts behind the wall returns to that cell."""
    cells = np.array([10, 12, 14])
    at = np.array([4, 5, 6])
    at[axis] = cells[axis] - 1 if upper else 0
    deposit = spread([np.asarray(BOX.lower) + (at + 0.5) * D], [D**3])
    inward = at.copy()
    inward[axis] += -1 if upper else 1
    assert value(deposit, BOX, *at) == pytest.approx(0.75**2 * 0.875)
    assert value(deposit, BOX, *inward) == pytest.approx(0.75**2 * 0.125)
    assert deposit.volume() == pytest.approx(D**3)
    low = deposit.origin - D / 2
    assert (low >= np.asarray(BOX.lower) - 1e-12).all()
    assert (low + D * np.array(deposit.fill.shape) <= np.asarray(BOX.upper) + 1e-12).all()


@pytest.mark.parametrize("away", range(6))
def test_the_field_never_reaches_beyond_the_walls(away):
    """However many cells from them the only particle lies; 0.3 / 0.05 is a little more than 6: no cell more."""
    six = Domain(lower=(0.1, 0.1, 0.1), upper=(0.4, 0.4, 0.4))
    for cell in ([away] * 3, [5 - away] * 3):
        deposit = spread([0.1 + 0.05 * (np.array(cell) + 0.5)], [1e-3], six, 0.05)
        low = (deposit.origin - 0.1) / 0.05 - 0.5
        assert (low > -0.01).all() and (low + deposit.fill.shape < 6.01).all()
        assert deposit.volume() == pytest.approx(1e-3)


def test_a_full_box_is_full_to_its_walls():
    """Particles on a lattice of half cells; also where the field of the particles is as wide as the box."""
    small = Domain(lower=(0, 0, 0), upper=(1.5, 1.0, 2.0))
    axes = [np.arange(D / 4, length, D / 2) for length in small.upper]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    deposit = spread(points, np.full(len(points), D**3 / 8), small)
    assert deposit.fill.shape == (3, 2, 4) and deposit.fill == pytest.approx(np.ones((3, 2, 4)))
    assert deposit.origin.tolist() == [D / 2] * 3


def test_nothing_is_an_empty_field_at_the_lower_corner():
    deposit = spread(np.empty((0, 3)), [])
    assert deposit.fill.shape == (3, 3, 3) and not deposit.fill.any() and deposit.volume() == 0.0
    assert deposit.origin.tolist() == [-0.75, 0.25, 2.25] and deposit.top() == 0.0


def columns(profiles):
    """A deposit of 3 x 2 columns; profiles[i][j] is the fill from below, origin (1, 2, 3)."""
    return Deposit(np.array([1.0, 2.0, 3.0]), D, np.array(profiles, float))


STEPS = columns(
    [
        [[1, 1, 0, 0], [1, 0.5, 0, 0]],
        [[1, 1, 0.8, 0.2], [0, 0, 0, 0]],
        [[0.4, 0, 0, 0], [1, 1, 1, 0.9]],
    ]
)


def test_columns_hold_their_material_as_if_it_were_solid():
    x, y, height = STEPS.column_heights()
    assert x.tolist() == [1.0, 1.5, 2.0] and y.tolist() == [2.0, 2.5]
    assert height == pytest.approx(np.array([[1.0, 0.75], [1.5, 0.0], [0.2, 1.95]]))
    assert STEPS.volume() == pytest.approx(height.sum() * D**2)


def test_the_top_lies_where_half_of_the_space_is_filled():
    """From 0.8 to 0.2 the half is in the middle; above the last cell there is nothing."""
    assert STEPS.top() == pytest.approx(3.0 + (3 + 0.4 / 0.9) * D)
    assert STEPS.top(1.5, 2.0, within=0.1) == pytest.approx(3.0 + 2.5 * D)
    assert STEPS.top(1.0, 2.0, within=0.0) == pytest.approx(3.0 + 1.5 * D)
    assert STEPS.top(1.0, 2.5, within=0.1) == pytest.approx(3.0 + 1.0 * D)
    assert STEPS.top(2.0, 2.0, within=0.1) == 0.0
    assert STEPS.top(1.0, 2.0, within=0.5) == pytest.approx(3.0 + 2.5 * D)  # both neighbours at 0.5 are within
    assert STEPS.top(2.0, 2.0, within=0.5) == STEPS.top()
    fine = Deposit(np.zeros(3), 0.04, np.array([[[1.0, 0.0]], [[1.0, 1.0]]]))
    assert fine.top(0.0, 0.0) == pytest.approx(0.02) and fine.top(0.04, 0.0) == pytest.approx(0.06)
    assert STEPS.top(x=1.0) == STEPS.top(y=2.0, within=0.1) == STEPS.top()  # an axis needs both


def test_the_level_of_a_profile_and_the_column_of_a_point():
    assert STEPS.level(np.array([1.0, 0.2, 0.7, 0.3])) == pytest.approx(3.0 + 2.5 * D)  # the last fall counts
    assert STEPS.level(np.array([0.49, 0.2, 0.0, 0.0])) == -np.inf
    assert STEPS.level(np.array([0.49, 0.2, 0.0, 0.0]), 7.0) == 7.0
    for point, column in (((1.0, 2.0), (0, 0)), ((1.7, 2.3), (1, 1)), ((2.3, 1.7), (3, -1)), ((0.7, 2.2), (-1, 0))):
        assert STEPS.place(np.array(point)).tolist() == list(column)


def grid_deposit(function, n=48, spacing=0.1):
    """A field of n^3 cells whose values are a function of place; the box starts at (0, -2, 1)."""
    origin = np.array([0.0, -2.0, 1.0]) + spacing / 2
    places = np.stack(np.meshgrid(*[spacing * np.arange(n)] * 3, indexing="ij"), axis=-1) + origin
    return Deposit(origin, spacing, function(places))


def test_planes_are_exact_for_polynomials_and_empty_beyond_the_faces():
    deposit = grid_deposit(lambda p: 1 + 2 * p[..., 0] - 3 * p[..., 1] + 0.5 * p[..., 2] ** 2)
    points, up = np.array([[[2.43, 0.37]], [[2.2, 0.11]]]), np.array([3.31, 3.47, 3.6])
    expected = 1 + 2 * points[..., 0] - 3 * points[..., 1] + 0.5 * up**2
    assert deposit.plane(points, up) == pytest.approx(expected, rel=1e-9)
    full = grid_deposit(lambda p: np.ones(p.shape[:-1]))
    for inside in (0.001, 4.799):
        assert full.plane(np.array([[[inside, -2.0 + inside]]]), np.array([1.0 + inside])) == pytest.approx(
            1.0, abs=1e-9
        )
    for beyond in ((-0.001, 0.0, 2.0), (1.0, 2.801, 2.0), (1.0, 0.0, 0.999), (1.0, 0.0, 9.0)):
        assert full.plane(np.array([[beyond[:2]]]), np.array(beyond[2:])).tolist() == [[0.0]]


def test_what_is_no_number_fills_nothing_and_a_field_without_cells_is_empty():
    fill = np.full((4, 4), 1.0)
    fill[1] = np.nan
    assert section(fill).solid.sum() == 12 and section(np.full((4, 4), np.nan)).width == 0.0
    nothing = Deposit(np.zeros(3), 0.5, np.zeros((3, 4, 0)))
    assert nothing.plane(np.zeros((2, 5, 2)), np.zeros(3)).tolist() == [[0.0] * 3] * 2


def test_planes_are_what_scipy_makes_of_the_same_cells():
    """At places up to the faces of the field, which mirror it, averaged over three points each."""
    rng = np.random.default_rng(4)
    deposit = Deposit(np.array([0.1, -0.2, 0.3]), 0.5, rng.random((7, 4, 5)))
    points, up = rng.uniform((-0.15, -0.45), (3.35, 1.55), (11, 3, 2)), rng.uniform(0.05, 2.55, 6)
    places = np.empty((11, 3, 6, 3))
    places[..., :2], places[..., 2] = points[:, :, None], up
    index = np.moveaxis((places - deposit.origin) / 0.5, -1, 0)
    coefficients = spline_filter(deposit.fill, order=3, mode="reflect")
    expected = map_coordinates(coefficients, index, order=3, mode="reflect", prefilter=False).mean(axis=1)
    assert deposit.plane(points, up) == pytest.approx(expected, abs=1e-12)


def test_a_cut_lies_square_to_its_direction_and_rises_from_the_floor():
    """In the frame of the path: linear across and up, square along it; five planes have mean square 9/8 spacing^2."""
    point, direction, floor = np.array([2.3, 0.5]), np.array([0.8, 0.6]), 2.0

    def field(p):
        arm = p[..., :2] - point
        along, across = arm @ direction, arm @ [-0.6, 0.8]
        return 7 * across + 11 * (p[..., 2] - floor) + 5 * along + 100 * along**2

    section = cut(grid_deposit(field), point, direction, 0.55, 0.9, floor)
    step = 0.1 / 4
    assert section.across == pytest.approx(-0.55 + step * (np.arange(44) + 0.5))
    assert section.up == pytest.approx(step * (np.arange(36) + 0.5))
    expected = 7 * section.across[:, None] + 11 * section.up + 100 * 1.125 * 0.1**2
    assert section.fill == pytest.approx(expected, abs=1e-6)


def section(fill, across=0.2, up=0.1):
    fill = np.array(fill, float)
    return Section(across * (np.arange(fill.shape[0]) + 0.5) - 1.0, up * (np.arange(fill.shape[1]) + 0.5), fill)


def test_a_section_encloses_its_holes_and_has_its_extents():
    """Across runs along rows: five columns from 1 to 4 filled, the third with a hole, the last overhanging."""
    made = section(
        [
            [0.49, 0, 0, 0, 0],
            [0.5, 1, 1, 0, 0],
            [1, 0.1, 1, 0, 0],
            [1, 1, 1, 0, 0],
            [0, 0, 0.6, 0.7, 0],
            [0, 0, 0, 0, 0],
        ]
    )
    assert made.solid.sum() == 11 and made.solid[2, 1] and not made.solid[0, 0]
    assert made.area == pytest.approx((11 + 2 * np.pi) * 0.2 * 0.1)  # its blur takes 16 pi / 8 cells of what stands
    assert made.matter == pytest.approx(9.39 * 0.2 * 0.1)
    assert made.width == pytest.approx(4 * 0.2) and made.height == pytest.approx(4 * 0.1)
    empty = section(np.full((4, 4), 0.49))
    assert (empty.area, empty.width, empty.height) == (0.0, 0.0, 0.0) and empty.matter == pytest.approx(7.84 * 0.02)
