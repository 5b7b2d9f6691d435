"""Checkpoints of a run, what its own process leaves, and what is estimated before it starts."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from fluidbench.method.verdict import Verdict
from fluidbench.native.simulation import Simulation
from fluidbench.runs import checkpoint
from fluidbench.runs.checkpoint import Checkpoints
from fluidbench.runs.child import perform
from fluidbench.runs.drive import Drive, Outcome
from fluidbench.runs.needs import BASE
from fluidbench.runs.process import Job
from fluidbench.runs.store import read_record
from fluidbench.study.estimate import estimate

from ..conftest import bead, drive, scenario
from .falling import Stepping, falling


def kept(tmp_path, sim, every=5.0, film=None):
    return Checkpoints(tmp_path, every, {"key": "k"}, sim, [], film)


def after(sim, ticks):
    """What a run has cost after so many ticks."""
    driven = Drive(sim, sim.scenario)
    sim.begin()
    for _ in range(ticks):
        driven.leg()
    return driven.outcome


def test_a_checkpoint_is_due_after_its_interval(tmp_path, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: clock[0])
    points = kept(tmp_path, falling())
    assert [points.due() for clock[0] in (104.9, 105.0, 200.0)] == [False, True, True]
    points.write(Outcome())
    assert [points.due() for clock[0] in (204.9, 205.0)] == [False, True]
    assert not kept(tmp_path, falling(), every=0.0).due()


def test_a_checkpoint_is_written_after_every_tick_that_is_due(tmp_path, monkeypatch):
    written = []
    sim = falling(Stepping)
    points = kept(tmp_path, sim)
    monkeypatch.setattr(points, "due", lambda: sim.done % 3 == 0)
    monkeypatch.setattr(points, "write", lambda outcome: written.append((sim.done, outcome.substeps)))
    drive(sim, checkpoints=points)
    assert written == [(3, 9), (6, 18)]
    broken = falling(Stepping)
    broken.pool.fault.fill_(1024)
    points.session, written[:] = broken, []
    monkeypatch.setattr(points, "due", lambda: True)
    assert drive(broken, checkpoints=points).verdict is Verdict.DIVERGED and written == []


def test_a_run_goes_on_as_if_nothing_had_happened(tmp_path):
    whole = falling(Stepping)
    expected = drive(whole)
    first = falling(Stepping)
    points = kept(tmp_path, first, every=1e-9)
    outcome = after(first, 3)
    points.rows.append({"time_s": 0.25})
    points.write(outcome)
    second = falling(Stepping)
    again = kept(tmp_path, second)
    done = drive(second, lambda s, _: again.rows.append({"time_s": s.now}), checkpoints=again)
    assert (done.verdict, done.time, done.substeps, done.binding) == (
        "completed",
        1.0,
        expected.substeps,
        {"told": 1.0},
    )
    assert [row["time_s"] for row in again.rows] == [0.25, 0.5, 0.75, 1.0] and again.resumed == 1
    for name, value in whole.frame().items():
        assert np.array_equal(second.frame()[name], value), name
    assert done.wall > outcome.wall > 0
    third = kept(tmp_path, falling(Stepping))
    third.resumed = 5
    assert third.restore(Outcome()) and third.resumed == 1
    third.discard()
    assert not third.path.exists() and not third.restore(Outcome())
    third.discard()


@pytest.mark.parametrize("change", [{"key": "other"}, {"code": "x"}])
def test_a_checkpoint_is_of_this_very_run(tmp_path, change):
    kept(tmp_path, falling()).write(Outcome())
    other = Checkpoints(tmp_path, 5.0, {"key": "k"} | change, falling(), [])
    assert not other.restore(Outcome()) and other.resumed == 0 and other.session.done == 0


def test_a_torn_checkpoint_is_no_checkpoint(tmp_path):
    points = kept(tmp_path, falling())
    points.write(Outcome())
    whole = points.path.read_bytes()
    for torn in (whole[: len(whole) // 2], b"", b"junk"):
        points.path.write_bytes(torn)
        assert not points.restore(Outcome())
    points.path.write_bytes(whole)
    assert points.restore(Outcome())


def test_the_film_goes_on_with_its_next_picture(tmp_path):
    kept(tmp_path, falling(), film=SimpleNamespace(shots=3, next=0.7)).write(Outcome())
    film = SimpleNamespace(shots=0, next=0.0)
    assert kept(tmp_path, falling(), film=film).restore(Outcome())
    assert (film.shots, film.next) == (3, 0.7)
    kept(tmp_path, falling()).write(Outcome())  # by a run without pictures
    film.shots = 5
    assert kept(tmp_path, falling(), film=film).restore(Outcome()) and film.shots == 5


def test_a_run_that_was_too_slow_goes_on_with_a_larger_limit(tmp_path):
    sim, whole = falling(Stepping), falling(Stepping)
    drive(whole)
    assert drive(sim, checkpoints=kept(tmp_path, sim), wall_limit=0.0).verdict is Verdict.TIMEOUT
    second = falling(Stepping)
    again = kept(tmp_path, second)
    done = drive(second, checkpoints=again, wall_limit=60.0)
    assert (done.verdict, done.reason, done.substeps, again.resumed) == (Verdict.COMPLETED, "", 24, 1)
    assert np.array_equal(second.frame()["position"], whole.frame()["position"])
    again.discard()
    none = falling(Stepping)
    drive(none, checkpoints=kept(tmp_path, none, every=0.0), wall_limit=0.0)
    assert not again.path.exists()  # where none are wanted


# --- a run's own process


def test_a_run_leaves_its_record_series_and_frames(tmp_path):
    s = scenario(duration=0.05, tick=0.01, output_interval=0.025, spacing=0.02)
    told = []
    perform(Job(s.model_dump(mode="json"), "mpm", keep_frames=True, repeat=3), tmp_path, told.append)
    record, why = read_record(tmp_path)
    assert why == "" and (record["verdict"], record["repeat"], record["resumed"]) == ("completed", 3, 0)
    assert set(record["files"]) == {"series.parquet", "final.npz", *(f"frame_000{i}.npz" for i in range(3))}
    assert [t["time"] for t in told] == pytest.approx([0.0, 0.025, 0.05]) and {t["until"] for t in told} == {0.05}
    mass = record["measures"]["mass_kg"]
    assert mass == pytest.approx(1000.0 * 0.08**3, rel=1e-5) and record["print"] is None and record["success"] == []
    with np.load(tmp_path / "frame_0001.npz") as frame, np.load(tmp_path / "final.npz") as last:
        assert float(frame["time"]) == pytest.approx(0.025) and float(last["time"]) == pytest.approx(0.05)
    import pandas as pd

    series = pd.read_parquet(tmp_path / "series.parquet")
    assert series["time_s"].tolist() == pytest.approx([0.0, 0.025, 0.05]) and series["mass_kg"].iloc[
        1
    ] == pytest.approx(mass)
    assert set(record["bounds_s"]) == {"acoustic", "advective"} and record["launches"]["process_per_tick"] == 0
    assert 0 < record["cost"]["total_s"] < 60 and 0 < record["cost"]["wall_s"] < record["cost"]["total_s"]
    assert sum(record["binding_s"].values()) == pytest.approx(0.05) and record["input"] == s.model_dump(mode="json")


def test_launches_of_processes_are_told_by_tick(tmp_path):
    """Growth: births and their number."""
    foam = {"density": 100.0, "youngs_modulus": 2e3, "yield_stress": 20.0, "expansion": {"ratio": 2.0, "time": 0.1}}
    s = scenario(duration=0.04, tick=0.01, output_interval=0.02, spacing=0.02, material=foam)
    perform(Job(s.model_dump(mode="json"), "mpm"), tmp_path, lambda _: None)
    record, _ = read_record(tmp_path)
    sim = Simulation(s, "mpm")
    for _ in range(4):
        sim.advance_tick()
    assert record["launches"]["process_per_tick"] == sim.process_launches == 2
    assert "volume_growth" in record["measures"]


def test_a_run_that_breaks_has_no_measures(tmp_path, monkeypatch):
    monkeypatch.setattr("fluidbench.native.health.Health.broken", lambda self, bits=None: "it broke")
    s = scenario(duration=0.02, tick=0.01, output_interval=0.02, spacing=0.02)
    perform(Job(s.model_dump(mode="json"), "mpm"), tmp_path, lambda _: None)
    record, _ = read_record(tmp_path)
    assert (record["verdict"], record["measures"], record["answers"]) == ("diverged", {}, [])


def test_an_estimate_by_hand():
    """A bead that takes 0.3 of 0.6 s to lay: on average three quarters of the particles are there."""
    s = bead(duration=0.6)

    class Estimated(Stepping):
        dt, typical_rate, typical_bytes = 1e-3, 1e4, 200.0

    tick, ticks, _ = s.schedule
    found = estimate(s, Estimated)
    substeps = math.ceil(tick / 1e-3 - 1e-9) * ticks
    assert (found.method, found.refusal, found.substeps) == ("ballistic", None, substeps)
    assert found.memory_bytes == BASE + 200.0 * found.particles and found.bounds[1].formula == repr(s.reference_speed)
    assert found.wall_s == pytest.approx(substeps * found.particles * 0.75 / 1e4)
    short = estimate(bead(duration=0.2), Estimated)
    assert short.wall_s == pytest.approx(short.substeps * short.particles * 0.5 / 1e4)
    still = estimate(scenario(), Estimated)
    assert still.wall_s == pytest.approx(still.substeps * still.particles / 1e4)


@pytest.mark.parametrize("stop", [4, 15])
def test_a_print_goes_on_with_its_stream_and_its_layers(tmp_path, stop):
    """Emission and laying take up where they were: the same particles, bit for bit."""
    later = {"kind": "box", "center": [0.04, 0.01, 0.004], "size": [0.008] * 3, "start": 0.06}
    s = bead(duration=0.1, tick=0.01, bodies=[later])
    whole, first = Simulation(s, Stepping), Simulation(s, Stepping)
    drive(whole)
    kept(tmp_path, first).write(after(first, stop))
    second = Simulation(s, Stepping)
    drive(second, checkpoints=kept(tmp_path, second))
    assert second.pool.counts == whole.pool.counts and second.done == whole.done == 20
    for name, value in whole.frame().items():
        assert np.array_equal(second.frame()[name], value), name


def test_matter_cures_as_the_run_goes_on():
    """A linear cure of a second, at the start of the last tick, which is at 0.45 s: level 45 of 100."""
    cure = {"kind": "linear", "time": 1.0, "youngs_modulus": 2e4}
    s = scenario(
        duration=0.5,
        tick=0.05,
        output_interval=0.5,
        gravity=[0, 0, 0],
        spacing=0.02,
        material={"density": 1000.0, "youngs_modulus": 1e4, "yield_stress": 9e3, "cure": cure},
    )
    sim = Simulation(s, "mpm")
    drive(sim)
    assert set(sim.frame()["phase"]) == {45}
