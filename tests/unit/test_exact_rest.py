"""Whether matter has come to rest: series made by hand, and runs that end when it has."""

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure.rest import at_rest, creep, moving, patience
from fluidbench.method.verdict import Verdict
from fluidbench.runs.child import perform
from fluidbench.runs.process import Job

from ..conftest import NATIVE, bead, scenario

BOX = scenario()  # spacing 0.01 m: what rests goes by no more than 0.5 mm


def rows(n=11, **columns):
    still = {f"center_{axis}_m": 0.0 for axis in "xyz"} | {f"momentum_{axis}_kg_m_s": 0.0 for axis in "xyz"}
    return pd.DataFrame({"time_s": np.linspace(0.0, 10.0, n), "mass_kg": 2.0, **still, "top_m": 0.1, **columns})


TIME = rows()["time_s"].to_numpy()
LATE = np.clip(TIME - 8.0, 0.0, None)


def test_creep_is_the_fastest_length_of_the_last_fifth():
    series = rows(top_m=1.0 - 0.01 * TIME, center_z_m=5.0 * TIME, resolution_m=0.1, spread_m=0.03 * LATE)
    assert creep(series, BOX) == {"creep_m_per_s": pytest.approx(0.03)}
    assert creep(series.iloc[:1], BOX) == {} and creep(series[["time_s", "center_z_m"]], BOX) == {}


def test_a_length_creeps_over_what_of_the_time_it_is_known_for():
    late = rows(bead_width_m=np.where(TIME < 9.0, np.nan, 0.1 + 0.03 * (TIME - 9.0)))
    assert creep(late, BOX) == {"creep_m_per_s": pytest.approx(0.03)}  # over the last second of two


def test_a_length_that_comes_back_has_moved_too():
    assert creep(rows(top_m=0.1 + 0.004 * (TIME == 9.0)), BOX) == {"creep_m_per_s": pytest.approx(0.002)}


@pytest.mark.parametrize(
    ("column", "values", "moved"),
    [
        ("top_m", 0.1 + 2.4e-4 * LATE, False),
        ("top_m", 0.1 + 2.6e-4 * LATE, True),
        ("slump", 0.2 + 2.4e-4 / 0.09 * LATE, False),  # of the box, which reaches to 0.09 m
        ("slump", 0.2 + 2.6e-4 / 0.09 * LATE, True),
        ("bead_area_m2", (0.1 + 2.4e-4 * LATE) ** 2, False),
        ("bead_area_m2", (0.1 + 2.6e-4 * LATE) ** 2, True),
        ("bead_width_m", np.where(TIME < 9.0, np.nan, 0.1 + 6e-4 * (TIME - 9.0)), True),
        ("bead_width_m", np.where(TIME < 10.0, np.nan, 0.1), False),
        ("bead_continuity", TIME, False),
        ("resolution_m", TIME, False),
    ],
)
def test_a_length_moves_that_goes_by_more_than_a_twentieth_of_a_spacing(column, values, moved):
    series = rows(**{column: values})
    assert moving(series, BOX) == ((column,) if moved else ())
    assert at_rest(series, BOX) is not moved


@pytest.mark.parametrize(("speed", "rests"), [(2.4e-4, True), (2.6e-4, False)])
def test_where_positions_wrap_the_centre_goes_with_its_momentum(speed, rests):
    walls = {"x_lower": "periodic", "x_upper": "periodic"}
    channel = scenario(domain={"lower": [0.0, 0.0, 0.0], "upper": [0.2, 0.2, 0.2], "walls": walls})
    assert at_rest(rows(momentum_x_kg_m_s=2.0 * speed), channel) is rests
    assert at_rest(rows(center_y_m=speed * LATE), BOX) is rests
    assert at_rest(rows(center_x_m=TIME), channel)  # wraps


def test_nothing_rests_before_two_outputs_nor_while_anything_is_to_come():
    assert not at_rest(rows().iloc[:2], BOX) and at_rest(rows().iloc[:3], BOX)
    assert not at_rest(rows().iloc[:0], BOX)
    late = {"kind": "box", "center": [0.05, 0.05, 0.15], "size": [0.08, 0.08, 0.02], "start": 8.5}
    assert not at_rest(rows(), scenario(bodies=[late], duration=10.0))
    assert at_rest(rows(), scenario(bodies=[late | {"start": 7.9}], duration=10.0))
    grows = {"density": 1000.0, "expansion": {"kind": "growth", "ratio": 2.0, "time": 0.1, "delay": 8.5}}
    assert not at_rest(rows(), scenario(material=grows, duration=10.0))


@pytest.mark.parametrize(
    ("material", "gravity", "seconds"),
    [
        ({"density": 1000.0}, -9.81, 0.04515),  # sqrt(2 * 0.01 / 9.81)
        ({"density": 1000.0, "viscosity": 1e3}, -9.81, 0.04515 + 0.30581),  # 3 * 1 * 0.01 / (9.81 * 0.1^2)
        ({"density": 1000.0, "viscosity": 1e3}, 0.0, 0.0),
    ],
)
def test_rest_is_believed_after_the_time_in_which_what_nothing_holds_goes_by_a_spacing(material, gravity, seconds):
    made = scenario(material=material, gravity=[0.0, 0.0, gravity])
    assert patience(made, 0.1) == pytest.approx(seconds, rel=1e-4)
    for share, rests in ((0.99, False), (1.01, True)):
        assert at_rest(rows(time_s=TIME * 0.5 * share * seconds), made) is (rests or not seconds)


def test_matter_that_cures_rests_as_soon_as_fresh_matter_would_show_that_it_does_not():
    """What a thousandfold viscosity would need to sink by a spacing, no run waits for."""
    fresh = {"density": 1000.0, "viscosity": 1e3}
    cures = fresh | {"cure": {"kind": "linear", "time": 0.1, "viscosity": 1e6}}
    assert patience(scenario(material=cures), 0.1) == patience(scenario(material=fresh), 0.1)


@pytest.mark.parametrize(
    ("expansion", "ends"),
    [
        (None, 0.3),
        ({"kind": "growth", "ratio": 2.0, "delay": 0.5, "jitter": 0.1}, 0.9),
        ({"kind": "spawn", "ratio": 4.0, "delay": 0.5, "passes": 3, "interval": 0.2}, 1.2),
    ],
)
def test_the_last_event_is_what_the_last_matter_does(expansion, ends):
    base = bead()
    grown = bead(material=base.material.model_dump(exclude_unset=True) | {"expansion": expansion})
    assert base.events_end == pytest.approx(0.3)  # 30 mm at 0.1 m/s
    assert grown.events_end == pytest.approx(ends)


@pytest.mark.parametrize("method", NATIVE)
@pytest.mark.parametrize(("gravity", "rests"), [(0.0, True), (-1.0, False)])
def test_a_run_ends_when_matter_rests_and_says_so_when_it_does_not(method, gravity, rests, tmp_path):
    made = scenario(until="rest", gravity=[0.0, 0.0, gravity], duration=0.2, spacing=0.02)
    record = perform(Job(made.model_dump(mode="json"), method), tmp_path, lambda event: None)
    assert record.verdict is Verdict.COMPLETED and record.cost is not None
    assert record.cost.simulated_s == pytest.approx(0.02 if rests else 0.2, rel=1e-3)
    assert record.moving == (() if rests else ("top_m", "front_x_m", "height_m"))
    assert [w for w in record.warnings if "at rest" in w] == (
        [] if rests else ["still moves after 0.2 s, and was to be at rest"]
    )
