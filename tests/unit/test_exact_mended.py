"""What was wrong once, and planted errors brought to light."""

import math

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure.reference import answers, table

from ..conftest import scenario
from .test_exact_expansion import growing


def test_the_front_of_a_square_column_is_compared_with_its_own_table():
    """dam_break_martin_moyce_front_n2_1.csv has no column `kind`, by which reference.martin_moyce picks its rows."""
    width, rows = 0.05, table("dam_break_martin_moyce_front_n2_1")
    body = {"kind": "box", "center": [width / 2, 0.1, width / 2], "size": [width, 0.04, width]}
    s = scenario(bodies=[body], gravity=[0, 0, -10.0], reference="martin_moyce_front")
    series = pd.DataFrame({"time_s": rows["T"] / np.sqrt(10.0 / width), "front_x_m": width * rows["Z"]})
    ((answer,), reasons) = answers(s, series, {})
    assert answer.error == pytest.approx(0.0, abs=1e-9) and reasons == []


@pytest.mark.parametrize("ticks", [3.0, 8.0])
def test_foam_that_has_nearly_grown_does_not_shrink_in_a_tick_of_several_time_constants(ticks):
    """Seven time constants after the onset; process/expansion.growth_rates expands 1 - exp(-step) in step, not small.
    The volume falls by 2 % in a tick of 8 time constants."""
    time = 1e-3
    grown, pool = growing({"ratio": 30.0, "time": time}, birth_time=np.full(64, -7.0 * time, np.float32))
    grown.advance(0.0, ticks * time)
    volume = grown.model.volume_ratio
    expected = volume((7.0 + ticks) * time) / volume(7.0 * time)
    assert math.exp(pool.growth.numpy()[0] * ticks * time) == pytest.approx(expected, abs=1e-5)
