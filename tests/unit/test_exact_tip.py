"""A nozzle that is a body: what its bore holds and lets out, and what is told of it."""

import numpy as np
import pandas as pd
import pytest

from fluidbench.errors import UserError
from fluidbench.measure.feed import fed, feeding, is_out
from fluidbench.measure.reference import answers
from fluidbench.measure.tower import layer_of
from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import Pool
from fluidbench.native.process.emission import Emission
from fluidbench.native.scene import Scene
from fluidbench.scenario.bore import Bore
from fluidbench.scenario.layout import capacity_of
from fluidbench.scenario.stream import Stream

from ..conftest import bead

D, U, BORE, SPACING = 0.012, 0.1, 0.018, 0.002
ROOM = {"lower": [-0.02, -0.02, 0.0], "upper": [0.05, 0.02, 0.06]}
LIQUID = {"density": 1000.0, "viscosity": 50.0}


def pressed(**more):
    nozzle = {"diameter": D, "exit_speed": U, "standoff": 0.010, "tip": "flat", "bore": BORE, **more.pop("nozzle", {})}
    return bead(**{"domain": ROOM, "material": LIQUID, "nozzle": nozzle, "duration": 0.5, **more})


@pytest.mark.parametrize(
    "more", [{}, {"spacing": 0.0017}, {"nozzle": {"profile": "plug"}}, {"nozzle": {"walls": "slip"}}]
)
def test_the_bore_is_full_at_the_start_and_what_is_fed_comes_on_time(more):
    """Flow rate exact to one layer: at any time what was let go is the bore and U t, within half a disc each."""
    s = pressed(**more)
    stream, disc = Stream(s), 1000.0 * s.nozzle.area * s.spacing
    filling = round(BORE / s.spacing)
    assert stream.mass(0.0) == pytest.approx(filling * disc)
    for t in (*np.linspace(0.0, 0.3, 41), 0.31, 0.5, 9.0):
        assert abs(stream.mass(t) - filling * disc - 1000.0 * s.nozzle.rate * min(t, 0.3)) <= 0.5001 * disc
    at = stream.release_point[stream.release_time < 0]
    assert at[:, 2] == pytest.approx(np.full(len(at), 0.010 + BORE))


OPENING = {"tip": "none", "bore": None, "profile": "developed"}


@pytest.mark.parametrize("nozzle", [{}, OPENING], ids=["body", "opening"])
@pytest.mark.parametrize("spacing", [0.001, 0.0015, 0.002])
def test_particles_go_down_as_fast_as_the_law_says(spacing, nozzle):
    """To second order in the spacing: the flow rate that rings carry is exact, so each is as much too fast as a law
    that is curved has less at their middles. (A lattice's outermost would lie on the wall, and never come.)"""
    stream = Stream(pressed(spacing=spacing, nozzle=nozzle))
    assert stream.points == 1 and stream.paces.mean() == pytest.approx(1.0, abs=1e-12)
    r = np.linalg.norm(stream.offset, axis=1)
    assert np.abs(stream.pace - 2.0 * (1.0 - (2.0 * r / D) ** 2)).max() < 3.0 * (spacing / D) ** 2
    assert -stream.velocity[:, 2] == pytest.approx(U * stream.pace)
    assert np.abs(stream.offset.mean(axis=0)).max() < 0.02 * D and r.max() < D / 2


def test_a_plug_enters_in_discs():
    stream = Stream(pressed(nozzle={"profile": "plug"}))
    assert stream.points == len(stream.offsets) and (stream.pace == 1.0).all()


def test_what_is_in_the_bore_leaves_the_nozzle_when_it_has_come_down():
    """At its own speed; what the path's end leaves in there would go on as before, and what is above never comes in:
    five discs' worth."""
    stream = Stream(pressed())
    going = np.isfinite(stream.release_time)
    late = stream.birth_time[going] - stream.release_time[going]
    assert late == pytest.approx(BORE / (U * stream.pace[going]), abs=1e-9)
    assert (~going).sum() == pytest.approx(5 * len(stream.offsets), abs=len(stream.offsets) / 2)
    assert np.isfinite(stream.birth_time).all() and np.isfinite(stream.release_point).all()


def device_frames(s, *times):
    scene = Scene(s)
    pool = Pool(scene, capacity_of(s))
    emission = Emission(scene, pool)
    frames = []
    for now in times:
        emission.advance(now, 0.004)
        frames.append({"time": np.array(now), **pool.snapshot()})
    return frames


def test_the_bore_is_filled_evenly_and_a_column_stands_above_it():
    """Three slices of a spacing hold three discs' worth, within a tenth."""
    (frame,) = device_frames(pressed(), 0.0)
    n, x = len(Stream(pressed()).offsets), frame["position"].astype(float)
    inside = frame["held"] == FREE
    assert set(frame["held"][x[:, 2] > 0.010 + BORE]) == {int(CARRIED)}
    assert inside.sum() == n * BORE / SPACING
    slices = np.histogram(x[:, 2] - 0.010, bins=np.arange(0.0, BORE + 1e-9, 3 * SPACING))[0]
    assert np.abs(slices / (3 * n) - 1.0).max() < 0.1
    assert x[inside, 2].min() > 0.010 and np.hypot(x[:, 0], x[:, 1]).max() < D / 2
    assert x[~inside, 2].max() < pressed().fed_from


def test_what_is_in_the_bore_is_not_laid():
    frame = {
        "time": np.array(0.1),
        "held": np.array([FREE, FREE, FREE, CARRIED, FREE]),
        "position": np.array(
            [[0.01, 0, 0.011], [0.01, 0, 0.009], [0.01, 0.0061, 0.012], [0.01, 0, 0.03], [0.02, 0, 0.011]]
        ),
    }
    assert is_out(frame, pressed()).tolist() == [False, True, True, False, True]
    assert is_out(frame, bead()).tolist() == [True, True, True, False, True]


def column(gradient, offset=0.0, **more):
    """A bore's length of particles whose pressure falls by this much a metre towards the exit, and some beside it."""
    z = np.linspace(0.0, BORE, 60)
    place = np.stack([np.full(60, 0.01), np.zeros(60), 0.010 + z], axis=1)
    beside = place + np.array([0.02, 0.0, 0.0])
    pressure = np.concatenate([gradient * z + offset, np.full(60, 9e9)])
    frame = {"time": np.array(0.1), "held": np.full(120, FREE), "position": np.concatenate([place, beside])}
    return frame | {"pressure": pressure} | more


def test_the_inlet_pressure_is_that_of_a_line_through_the_bores():
    assert feeding(column(5e5, 300.0), pressed()) == pytest.approx({"inlet_pressure_Pa": 5e5 * BORE + 300.0})
    spoilt = column(5e5)
    spoilt["pressure"][:12] = spoilt["pressure"][55:60] = 1e8  # at its mouth and its feed
    assert feeding(spoilt, pressed()) == pytest.approx({"inlet_pressure_Pa": 5e5 * BORE})


def test_there_is_no_inlet_pressure_without_a_bore_a_pressure_or_a_flow():
    frame = column(5e5)
    assert feeding(frame, bead()) == {} and feeding(column(5e5, time=np.array(0.31)), pressed()) == {}
    travels = {"kind": "polyline", "points": [[0.0, 0.0], [0.03, 0.0], [0.03, 0.01]], "speed": 0.1, "flows": [0.0, 1.0]}
    assert feeding(frame, pressed(toolpath=travels)) == {}
    frame.pop("pressure")
    assert feeding(frame, pressed()) == {}


def test_a_bore_needs_room_above_it():
    """Exit at 10 mm, a bore of 18, and five discs of 2."""
    assert pressed().fed_from == pytest.approx(0.038)
    low = {**ROOM, "upper": [0.05, 0.02, 0.037]}
    with pytest.raises(UserError, match=r"nozzle \(standoff, layers, bore and what feeds it\) spans z = 0.01 .. 0.038"):
        pressed(domain=low)


def test_a_developed_profile_is_that_of_the_law():
    paste = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "yield_stress": 60.0}
    s = pressed(material=paste | {"plastic_viscosity": 2.0})
    stream = Stream(s)
    exact = Bore(s.material, D, U).profile(np.linalg.norm(stream.offsets, axis=1))
    assert stream.paces == pytest.approx(exact / exact.mean()) and 1.0 < stream.paces.max() < 1.8


def test_a_run_is_fed_at_the_median_of_the_later_half():
    series = pd.DataFrame({"inlet_pressure_Pa": [9.0, 8.0, 1.0, 2.0, 30.0, np.nan]})
    assert fed(series) == {"inlet_pressure_Pa": 2.0}
    assert fed(pd.DataFrame({"time_s": [0.0]})) == {} and fed(pd.DataFrame({"inlet_pressure_Pa": [np.nan]})) == {}


def test_emitted_mass_is_held_against_what_was_fed_and_filled_the_bore():
    """9 discs of 2 mm fill 18 mm; 0.3 s feed 15 more. One disc too few is an error of one."""
    s = pressed()
    disc = 1000.0 * s.nozzle.area * 0.002
    series = pd.DataFrame({"time_s": [0.0, 0.5]})
    (answer, *_), _ = answers(s, series, {"mass_kg": 23 * disc, "bead_area_m2": 1.0, "bead_matter_m2": 1.0})
    assert answer.reference == pytest.approx(24 * disc) and answer.error == pytest.approx(1.0)
    assert answer.source == "rho Q t, and the bore"
    (answer, *_), _ = answers(
        bead(duration=0.5), series, {"mass_kg": 15 * disc, "bead_area_m2": 1.0, "bead_matter_m2": 1.0}
    )
    assert answer.error == pytest.approx(0.0, abs=1e-9) and answer.source == "rho Q t"


def test_layers_and_cure_are_those_of_what_has_left_the_nozzle():
    path = {"kind": "ring", "center": [0.01, 0.0], "radius": 0.005, "speed": 0.1, "layers": 2, "layer_height": 0.005}
    s = pressed(toolpath=path, duration=1.0)
    exit_at = s.track.at(0.1)
    frame = {
        "time": np.array(0.1),
        "held": np.array([FREE, FREE, CARRIED]),
        "position": exit_at + np.array([[0.0, 0.0, -0.005], [0.0, 0.0, 0.005], [0.0, 0.0, 0.02]]),
        "birth_time": np.array([0.05, 0.15, 0.3]),
    }
    assert layer_of(frame, s).tolist() == [0, -1, -1]
