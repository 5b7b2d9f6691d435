"""Heights over a path, progress, families and the criteria of a print, each by hand."""

import math

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure import tower
from fluidbench.measure.deposit import Deposit
from fluidbench.measure.tower import Print, family_spread, progress, success, verdict_of
from fluidbench.method.frame import CARRIED, CLAMPED, FREE

from .made import PASTE, RING, D, wall


def frame(position, birth, mass=1.0, held=FREE, **more):
    n = len(position)
    columns = {
        "position": np.array(position, float),
        "mass": np.broadcast_to(mass, n).astype(float),
        "birth_time": np.broadcast_to(birth, n).astype(float),
        "held": np.broadcast_to(held, n),
    }
    return columns | {key: np.broadcast_to(value, n).astype(float) for key, value in more.items()}


def field(heights, s, width=0):
    """A deposit of columns along the wall's path, as high as `heights(share of the path)` in cells, `width` cells to
    either side of it; in its own field of 2 cells more to all sides."""
    length = s.toolpath.length()
    nx, ny, nz = round(length / D) + 5, 2 * width + 5, 30
    fill = np.zeros((nx, ny, nz))
    for i in range(nx):
        fill[i, 2 : 3 + 2 * width, : heights((i - 2) * D / length)] = 1.0
    return Deposit(np.array([-2 * D, -(width + 2) * D, -0.01 + D / 2]), D, fill)


def test_height_is_that_of_most_columns_of_a_sector():
    s = wall()
    assert tower.path_heights(field(lambda share: 18, s), s) == pytest.approx(np.full(38, 18 * D))
    steps = tower.path_heights(field(lambda share: 18 if share < 0.5 else 9, s), s)
    assert (steps[:18] == pytest.approx(18 * D)) and (steps[20:] == pytest.approx(9 * D))
    assert tower.path_heights(field(lambda share: 0, s), s) == pytest.approx(np.zeros(38))


@pytest.mark.parametrize(("share", "cells"), [(0.5, 19.5 + 1 / 14), (0.45, 9.5 + 13 / 16)])
def test_a_height_between_columns_is_where_the_field_is_half_full(share, cells):
    """One sector, the middle half of 40 mm, holds 13 columns: 7 or 5 of them are 20 cells high, the others 10. Beyond
    cell 10 it is 7/13 full, which falls to nothing, or 5/13: (7/13 - 1/2) / (7/13), and (1 - 1/2) / (1 - 5/13)."""
    s = wall(0.04, spacing=6e-3)
    assert tower.path_heights(field(lambda at: 20 if at < share else 10, s), s) == pytest.approx([cells * D])


def test_the_best_line_within_a_quarter_of_the_nozzle_counts():
    """A quarter of 12.8 mm is 3.2 mm: the second line of cells beside the path is in, the third is not."""
    s = wall()
    for line, height in ((-3, 0), (-2, 12), (0, 12), (2, 12), (3, 0)):
        deposit = field(lambda share: 0, s, width=3)
        deposit.fill[:, 5 + line, :12] = 1.0
        assert tower.path_heights(deposit, s) == pytest.approx(np.full(38, height * D)), line


def test_what_lies_beyond_the_field_is_empty():
    s = wall()
    whole = field(lambda share: 18, s)
    half = Deposit(whole.origin, D, whole.fill[: len(whole.fill) // 2])
    heights = tower.path_heights(half, s)
    assert heights[:17] == pytest.approx(np.full(17, 18 * D)) and heights[20:] == pytest.approx(np.zeros(18))
    late = Deposit(whole.origin + np.array([72 * D, 0, 0]), D, whole.fill[72:])  # from the first column of sector 20 on
    aside = Deposit(whole.origin + np.array([0, 2 * D, 0]), D, whole.fill[:, 2:])  # the path is over its first column
    assert tower.path_heights(aside, s) == pytest.approx(np.full(38, 18 * D))
    heights = tower.path_heights(late, s)
    assert heights[:17] == pytest.approx(np.zeros(17)) and heights[20:] == pytest.approx(np.full(18, 18 * D))


@pytest.mark.parametrize(("cells", "stands"), [(14, 1.0), (13, 0.0)])
def test_a_path_stands_from_three_quarters_of_the_plan(cells, stands):
    """27 mm are planned: 13.5 cells are three quarters."""
    s = wall()
    row = tower.standing(field(lambda share: cells, s), s)
    assert row == {"print_height_m": pytest.approx(cells * D), "print_standing": stands}
    row = tower.standing(field(lambda share: 18 if share < 0.3 else cells, s), s)
    assert row["print_height_m"] == pytest.approx(cells * D)
    assert row["print_standing"] == (1.0 if stands else pytest.approx(0.3, abs=0.06))


def test_progress_is_of_mass_outside_the_nozzle():
    cure = {"kind": "linear", "time": 1.0, "youngs_modulus": 1e5}
    s = wall(material={**PASTE, "cure": cure, "expansion": {"ratio": 4.0}})
    made = frame(
        np.zeros((4, 3)),
        0.0,
        [1.0, 4.0, 1.0, 6.0],
        [FREE, CLAMPED, FREE, CARRIED],
        phase=[95, 94, 100, 0],
        volume=[2e-3, 2e-3, 4e-3, 9.0],
    )
    assert progress(made, s) == pytest.approx(
        {"mean_cure": (95 + 376 + 100) / 600, "cured_share": 1 / 3, "volume_growth": 8e-3 * 1000.0 / 6.0}
    )
    assert progress(made, wall()) == {} and progress(made | {"held": np.full(4, CARRIED)}, s) == {}


def test_families_spread_about_their_own_centres():
    """Of two families that stay together, one of masses 1 and 3 that are 4 m apart: rms sqrt(3/4 1^2 + 1/4 3^2)."""
    made = frame([[0, 0, 0], [0, 0, 4], [9, 9, 9], [5, 5, 5]], 0.0, [1.0, 3.0, 5.0, 7.0])
    made["origin"] = np.array([0, 10, 1, 11])
    made["held"] = np.array([FREE, FREE, FREE, CARRIED])
    assert family_spread(made, 10) == pytest.approx(math.sqrt(3.0))
    made["held"] = np.full(4, FREE)  # masses 5 and 7, 4 sqrt(3) m apart
    second = 5 * 7 / 12**2 * 48
    assert family_spread(made, 10) == pytest.approx(math.sqrt((4 * 3.0 + 12 * second) / 16))
    assert family_spread(made, 100) == 0.0


LEVELS = {f"layer_{k}_{what}": value for k in (1, 2, 3) for what, value in (("level_m", 0.01), ("continuity", 1.0))}
GOOD = {**LEVELS, "print_height_m": 0.027, "print_standing": 1.0, "wall_lean_m": 0.0, "foot_width_m": 0.02}


def judged(made=None, after=(1.0, 1.0), end=20.0, **changes):
    """(verdict, criteria by name) of a print; `after` are heights from the end of the path on."""
    s = made or wall()
    measures = {key: value for key, value in {**GOOD, **changes}.items() if value is not None}
    times = [0.0, *np.linspace(s.track.end, end, len(after))] if end > s.track.end else [0.0, end]
    heights = [9.0, *after] if end > s.track.end else [9.0, 1.0]
    criteria = success(s, measures, pd.DataFrame({"time_s": times, "print_height_m": heights}))
    return verdict_of(criteria), {c.name: c for c in criteria}


def failed(**changes):
    verdict, criteria = judged(**changes)
    return verdict, [name for name, c in criteria.items() if not c.met]


HEIGHT, STANDS, LAID = "height over plan", "share of the path that stands", "layers laid"
LEANS = "lean over the foot's width"


@pytest.mark.parametrize(
    ("changes", "verdict", "unmet"),
    [
        ({}, Print.SOUND, []),
        ({"print_height_m": 1.2499 * 0.027}, Print.SOUND, []),
        ({"print_height_m": 1.2501 * 0.027}, Print.DEFORMED, [HEIGHT]),
        ({"print_height_m": 0.7501 * 0.027}, Print.SOUND, []),
        ({"print_height_m": 0.7499 * 0.027}, Print.COLLAPSED, [HEIGHT]),
        ({"print_standing": 0.95}, Print.SOUND, []),
        ({"print_standing": 0.949}, Print.COLLAPSED, [STANDS]),
        ({"wall_lean_m": 0.0099}, Print.SOUND, []),
        ({"wall_lean_m": 0.0100}, Print.COLLAPSED, [LEANS]),
        ({"layer_2_continuity": 0.95}, Print.SOUND, []),
        ({"layer_2_continuity": 0.949}, Print.BROKEN, ["continuity of the worst layer"]),
        ({"layer_3_level_m": None}, Print.INCOMPLETE, [LAID]),
        ({"after": (1.0, 2.0, 0.9501)}, Print.SOUND, []),
        ({"after": (1.0, 2.0, 0.9499)}, Print.DEFORMED, ["sunk after the last layer"]),
        ({"after": (1.0,)}, Print.SOUND, ["sunk after the last layer"]),
        ({"after": (0.0, 0.0)}, Print.SOUND, ["sunk after the last layer"]),
        ({"end": 6.2 * (1 - 1.1e-6)}, Print.INCOMPLETE, ["path travelled", "sunk after the last layer"]),
        ({"end": 6.2 * (1 - 0.9e-6)}, Print.SOUND, ["sunk after the last layer"]),
        (
            {"print_standing": 0.1, "layer_1_continuity": 0.1},
            Print.COLLAPSED,
            [STANDS, "continuity of the worst layer"],
        ),
        (
            {"layer_1_continuity": 0.1, "after": (1.0, 0.5)},
            Print.BROKEN,
            ["continuity of the worst layer", "sunk after the last layer"],
        ),
    ],
)
def test_every_condition_alone_and_the_worst_is_the_verdict(changes, verdict, unmet):
    assert failed(**changes) == (verdict, unmet)


def test_criteria_say_what_was_measured_and_what_is_wanted():
    _, criteria = judged(print_height_m=0.0135, print_standing=0.5, layer_2_continuity=0.7, after=(2.0, 1.6))
    assert {name: (pytest.approx(c.measured), c.wanted) for name, c in criteria.items()} == {
        LAID: (3, "3"),
        "path travelled": (1.0, "1"),
        HEIGHT: (0.5, "1 ± 0.25"),
        STANDS: (0.5, ">= 0.95"),
        "continuity of the worst layer": (0.7, ">= 0.95"),
        LEANS: (0.0, "< 0.5"),
        "sunk after the last layer": (0.2, "<= 0.05"),
    }
    assert judged(end=3.1)[1]["path travelled"].measured == pytest.approx(0.5)
    none = judged(**{f"layer_{k}_level_m": None for k in (1, 2, 3)})[1]
    assert none["continuity of the worst layer"].measured == 0.0


def test_posture_is_that_of_the_middle_of_the_path():
    """Of layer 2 of a wall 200 mm long: half of it 4 mm off the path, its start 1 m, and what is not laid farther."""
    s = wall(0.2)
    start = s.track.time[:-1][s.track.layer == 1][0]
    made = frame([[0.1, 0.0, 0.0], [0.1, 0.01, 0.0], [0.1, 0.004, 0.0], [0.15, 0.004, 0.0], [0.0, 1.0, 0.0]], 0.0)
    made["birth_time"][2:] = start + 0.01
    found = tower.wall_posture(made, s)
    assert found == pytest.approx({"wall_lean_m": 0.005, "foot_width_m": math.sqrt(12.0) * 0.005})
    assert tower.is_wall(s) and not tower.is_wall(RING)


def test_a_wall_collapses_under_the_layers_that_lie_whole():
    s = wall()
    ends = [s.track.time[1:][s.track.layer == k][-1] for k in range(3)]
    times = [0.0, 0.5 * ends[0], 1.01 * ends[0], 1.01 * ends[1], 1.1 * ends[2]]
    standing = {"time_s": times, "foot_width_m": [0.0, 0.02, 0.02, 0.02, 0.02], "wall_lean_m": [0.0] * 5}
    heights = [0.0, 0.0, 0.009, 0.018, 0.027]
    assert tower.wall_collapse(s, pd.DataFrame(standing | {"print_height_m": heights})) is None
    fallen = tower.wall_collapse(s, pd.DataFrame(standing | {"print_height_m": [*heights[:3], 0.013, 0.01]}))
    assert fallen is not None and (fallen.time, fallen.layers) == (times[3], 2)


@pytest.mark.parametrize(("radius", "met"), [(0.0549, True), (0.0551, False), (0.0451, True), (0.0449, False)])
def test_a_ring_keeps_its_radius_to_a_tenth(radius, met):
    rings = dict.fromkeys(("layer_1_radius_m", "layer_3_radius_m"), 0.05) | {"layer_2_radius_m": radius}
    verdict, criteria = judged(RING, **rings)
    criterion = criteria["worst radius error"]
    assert (criterion.met, criterion.wanted) == (met, "<= 0.1")
    assert criterion.measured == pytest.approx(abs(radius / 0.05 - 1))
    assert verdict is (Print.SOUND if met else Print.DEFORMED)
    assert "worst radius error" not in judged()[1]
    none = judged(RING, **{f"layer_{k}_level_m": None for k in (1, 2, 3)})[1]["worst radius error"]
    assert (none.measured, none.met) == (1.0, False)


def test_verdicts_are_ordered_from_the_worst():
    assert [str(p) for p in Print] == ["incomplete", "collapsed", "broken", "deformed", "sound"]
    assert verdict_of([]) is Print.SOUND
