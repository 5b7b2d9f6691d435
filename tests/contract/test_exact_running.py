"""The loop by hand, with the smallest method there is: ticks, outputs, bounds, verdicts, limits of time, resumption."""

import itertools
import re
from types import SimpleNamespace

import numpy as np
import pytest

from fluidbench.method.verdict import Verdict
from fluidbench.native import sorting
from fluidbench.native.simulation import Simulation
from fluidbench.runs import drive as loop
from fluidbench.runs.drive import Drive, Outcome

from ..conftest import NATIVE, bead, drive, scenario
from .falling import FALLING, Stepping, falling


def test_outputs_come_at_their_ticks_and_the_first_before_all():
    sim, seen = falling(Stepping), []
    outcome = drive(sim, lambda s, vital: seen.append((s.now, s.done, vital.speed)))
    assert [row[:2] for row in seen] == [(0.0, 0), (0.25, 2), (0.5, 4), (0.75, 6), (1.0, 8)]
    assert [row[2] for row in seen] == pytest.approx([9.81 * t for t in (0, 0.25, 0.5, 0.75, 1.0)], rel=1e-5)
    assert (outcome.verdict, outcome.reason, outcome.time, sim.done) == (Verdict.COMPLETED, "", 1.0, 8)
    assert outcome.substeps == 24 and outcome.particle_substeps == 24 * 8 and outcome.peak_particles == 8
    assert outcome.binding == {"told": 1.0} and outcome.wall > 0 and outcome.cpu >= 0 and outcome.prepare_wall >= 0
    assert sim.substep_launches == 1 and sim.scenario.schedule == (0.125, 8, 2)


def test_clocks_run_only_while_the_loop_does(monkeypatch):
    """Clocks that go on by 1 and by 0.5 at every look: twice in preparing, and twice a tick."""
    wall, cpu = itertools.count(), itertools.count()
    clocks = SimpleNamespace(perf_counter=lambda: 1.0 * next(wall), process_time=lambda: 0.5 * next(cpu))
    monkeypatch.setattr(loop, "time", clocks)
    outcome = drive(falling(Stepping), lambda *_: next(wall))
    assert (outcome.prepare_wall, outcome.wall, outcome.cpu) == (1.0, 8.0, 4.0)


def test_the_last_tick_is_an_output_even_between_two():
    sim, seen = falling(duration=0.85, output_interval=0.375), []
    drive(sim, lambda s, _: seen.append(s.done))
    assert sim.scenario.schedule[1:] == (7, 3) and seen == [0, 3, 6, 7]


def test_bounds_allow_a_quarter_more_speed_than_was_last_seen():
    sim = falling(Stepping)
    own = sim.scenario.reference_speed
    assert [b.formula for b in sim.bounds()] == ["", repr(1.25 * own)]
    sim.pool.velocity.fill_((3.0, 4.0, 0.0))
    assert sim.look().speed == pytest.approx(5.0) and sim.speed == pytest.approx(5.0)
    assert sim.bounds()[1].formula == repr(1.25 * sim.speed)
    sim.pool.velocity.fill_((0.0, 0.0, 0.0))
    sim.look()
    assert sim.speed == pytest.approx(0.1 * own)  # what rests may start again


def test_bounds_are_of_the_material_that_will_be_there_after_the_tick():
    cure = {"kind": "jump", "delay": 0.2, "youngs_modulus": 4e4}
    s = scenario(
        material={"density": 1000.0, "youngs_modulus": 1e4, "cure": cure},
        duration=0.64,
        tick=0.01,
        output_interval=0.01,
        gravity=[0, 0, 0],
    )
    sim = Simulation(s, "mpm")
    early = min(b.dt for b in sim.bounds())
    sim.done = 18  # ends at 0.19; materials are known at multiples of 10 ms, and that of 0.2 from there on
    assert min(b.dt for b in sim.bounds()) == early
    sim.done = 19
    late = min(b.dt for b in sim.bounds())
    c, v = s.wave_speed, 1.25 * s.reference_speed
    assert late == pytest.approx(early * (c + v) / (2 * c + v)) and len(sim.bounds()) == 4


def test_a_tick_is_cut_into_equal_substeps_of_the_bound():
    """Three of a 24th of a second: v = -g t, z falls by g dt^2 (1 + 2 + 3)."""
    sim = falling(Stepping)
    before = sim.frame()["position"]
    steps = sim.advance_tick()
    assert (steps.substeps, steps.dt, steps.binding.name, sim.done, sim.now) == (3, 0.125 / 3, "told", 1, 0.125)
    after = sim.frame()
    assert after["velocity"][:, 2] == pytest.approx(np.full(8, -9.81 * 0.125), rel=1e-6)
    assert before[:, 2] - after["position"][:, 2] == pytest.approx(np.full(8, 9.81 * 6 * (0.125 / 3) ** 2), rel=1e-4)
    sim.march(0.01, 2)
    assert sim.frame()["velocity"][:, 2] == pytest.approx(np.full(8, -9.81 * 0.145), rel=1e-6) and sim.done == 1


def test_every_32nd_tick_sorts_the_pool():
    """By keys that turn the order round: at the first tick, and in what is replayed later."""
    import warp as wp

    class Sorting(Stepping):
        dt = 9.0

        def sort_keys(self):
            keys = np.zeros(2 * self.pool.size, np.int64)
            keys[: self.pool.size] = [7 - i if i < 8 else i for i in range(self.pool.size)]
            self.kept = wp.array(keys, dtype=wp.int64)  # a recording needs them again
            return self.kept

    sim, turned = falling(Sorting, duration=8.125), []
    assert sim.ticks == 65 and sorting.EVERY == 32
    for _ in range(65):
        before = sim.pool.origin.numpy()[:8].tolist()
        sim.advance_tick()
        if sim.pool.origin.numpy()[:8].tolist() == before[::-1]:
            turned.append(sim.done - 1)
    assert turned == [0, 32, 64]


def test_the_order_of_a_sort_is_that_of_the_keys():
    import warp as wp

    sim = falling()
    keys = np.zeros(2 * sim.pool.size, np.int64)
    keys[: sim.pool.size] = np.arange(sim.pool.size)
    keys[:3] = [2, 1, 0]
    sim.sorting.reorder(wp.array(keys, dtype=wp.int64))
    assert sim.pool.origin.numpy()[:5].tolist() == [2, 1, 0, 3, 4]
    sim.sorting.reorder(wp.array(keys, dtype=wp.int64))
    assert sim.pool.origin.numpy()[:5].tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("wall", "done", "limit", "late"),
    [
        (10.1, 99, 10.0, True),  # over the limit
        (9.9, 99, 10.0, False),
        (8.1, 40, 10.0, True),  # after 8 s: 20.25 s expected, more than twice
        (8.1, 41, 10.0, False),  # 19.8 s
        (7.9, 1, 10.0, False),  # too early to tell
        (3.1, 1, 3.0, True),
        (0.5, 1, 0.4, True),
        (0.3, 1, 0.4, False),
    ],
)
def test_a_run_is_stopped_when_it_cannot_make_it(wall, done, limit, late):
    made = SimpleNamespace(schedule=(0.01, 100, 10))
    words = Drive(SimpleNamespace(now=done / 100), made, wall_limit=limit, outcome=Outcome(wall=wall)).too_slow()
    assert Drive(SimpleNamespace(now=done / 100), made, outcome=Outcome(wall=wall)).too_slow() is None
    assert (words is not None) is late
    if late:
        assert words is not None
        found = re.fullmatch(r"stopped at t = (\S+) s after (\S+) s: .* at least (\S+) s, the limit is (\S+) s", words)
        assert found is not None and float(found[1]) == done / 100
        told = [float(text) for text in found.groups()[1:]]
        assert told == pytest.approx([wall, wall * 100 / done, limit], rel=0.05)


@pytest.mark.parametrize(
    ("wall", "limit", "words"),
    [
        (0.0234, 0.01, "after 0.023 s: at this pace the run takes at least 0.023 s, the limit is 0.01 s"),
        (9.94, 2.5, "after 9.9 s: at this pace the run takes at least 9.9 s, the limit is 2.5 s"),
        (123.4, 60.0, "after 123 s: at this pace the run takes at least 123 s, the limit is 60 s"),
    ],
)
def test_times_are_told_in_digits_that_mean_something(wall, limit, words):
    made = SimpleNamespace(schedule=(0.01, 100, 10))
    told = Drive(SimpleNamespace(now=1.0), made, wall_limit=limit, outcome=Outcome(wall=wall)).too_slow()
    assert told == f"stopped at t = 1 s {words}"


@pytest.mark.parametrize(("wall", "late"), [(8.1, False), (9.9, False), (10.1, True)])
def test_a_run_that_may_rest_at_any_time_has_its_whole_limit(wall, late):
    made = SimpleNamespace(schedule=(0.01, 100, 10))
    drive = Drive(SimpleNamespace(now=0.01), made, wall_limit=10.0, outcome=Outcome(wall=wall), rests=lambda: False)
    assert (drive.too_slow() is not None) is late


def test_a_run_without_time_times_out_and_shows_no_more():
    for interval, shown in ((0.25, [0]), (0.125, [0, 1])):  # what is due at its end is shown still
        sim, seen = falling(output_interval=interval), []
        outcome = drive(sim, lambda s, _, seen=seen: seen.append(s.done), wall_limit=0.0)
        assert outcome.verdict is Verdict.TIMEOUT and outcome.time == 0.125 and sim.done == 1 and seen == shown
        assert re.match(r"stopped at t = 0\.125 s after \S+ s: .* the limit is 0 s", outcome.reason)


def test_what_breaks_ends_the_run_with_its_time_and_its_reason():
    class Full(Stepping):
        faults = {1: "too full", 4: "too long", 2: "not this"}

    assert drive(falling(Full)).verdict is Verdict.COMPLETED
    sim = falling(Full)
    sim.pool.fault.fill_(5)
    outcome = drive(sim)
    assert (outcome.verdict, outcome.reason) == (Verdict.OUT_OF_CAPACITY, "at t = 0.125 s too full; too long")
    sim = falling(Full)
    sim.pool.fault.fill_(1 | 2048)  # a blow-up goes before what it filled
    assert drive(sim).verdict is Verdict.DIVERGED
    late = falling(Full)
    outcome = drive(
        late, camera=SimpleNamespace(next=0.9, shoot=lambda s: s.pool.fault.fill_(1024))
    )  # broken after the last look, and found all the same
    assert outcome.verdict is Verdict.DIVERGED and outcome.reason.startswith("at t = 1 s a particle was thrown")
    last = falling(Full)
    camera = SimpleNamespace(next=0.9, shoot=lambda s: s.pool.volume.fill_(float("nan")))
    assert drive(last, camera=camera).verdict is Verdict.DIVERGED


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_what_finds_no_room_ends_the_run(start):
    small = falling()
    small.emission = SimpleNamespace(
        expect=lambda: small.pool.need(0, 99 if small.now >= start else 0) or True, feed=lambda: None
    )
    outcome = drive(small)
    assert outcome.verdict is Verdict.OUT_OF_CAPACITY and "and 107 are needed" in outcome.reason


class Told(Stepping):
    """Notes what it is told between substeps."""

    def __init__(self, *args):
        super().__init__(*args)
        self.told = []
        self.backend = SimpleNamespace(name="other", wait=lambda: self.told.append("wait"))

    def prepare(self):
        self.told.append("prepare")

    def refresh(self):
        self.told.append("refresh")

    def resume(self):
        self.told.append("resume")


def test_a_method_is_told_once_of_what_changed_outside_a_substep():
    sim = falling(Told)
    for _ in range(2):
        sim.advance_tick()
    assert sim.solver.told == ["refresh"]
    sim.pool.stale = True
    sim.march(0.01, 1)
    assert sim.solver.told == ["refresh", "refresh"]
    sim.resume(*sim.state())
    assert sim.solver.told[2:] == ["resume"]


def test_a_method_is_prepared_and_refreshed_before_the_first_look():
    sim, seen = falling(Told), []
    drive(sim, lambda s, _: seen.append(list(s.solver.told)))
    assert seen[0] == ["prepare", "refresh"] and seen[-1] == seen[0]


def test_launches_are_captured_or_waited_for():
    sim = Simulation(scenario(**FALLING), Told, graphs=False)
    sim.advance_tick()
    assert sim.solver.told == ["refresh", "wait", "wait"] and sim.substep_launches == 1
    assert list(sim.scene.crew.graphs) == ["audit"] and list(falling().scene.crew.graphs) == []
    captured = falling(Stepping)
    captured.advance_tick()
    assert list(captured.scene.crew.graphs) == ["audit", 1] and captured._use_graphs
    captured.advance_tick()
    assert list(captured.scene.crew.graphs) == ["audit", 1, (True, False, False, -1)]


@pytest.mark.parametrize("graphs", [True, False])
def test_particles_are_arranged_every_so_many_ticks_of_the_run(graphs):
    """At ticks 0, 3, 6, by turns; and a run that goes on at tick 4 does it next at 6."""

    class Arranging(Stepping):
        dt, arranges, turns = 9.0, 3, 2

        def arrange(self, turn):
            self.pool.birth_time.fill_(7.0 + turn)

    def arranged(done, until):
        sim, at = Simulation(scenario(**FALLING), Arranging, graphs=graphs), []
        sim.prepare()
        sim.begin()
        sim.done = done
        while sim.done < until:
            sim.pool.birth_time.fill_(0.0)
            sim.advance_tick()
            turn = int(sim.pool.birth_time.numpy()[0]) - 7
            if turn >= 0:
                at.append((sim.done - 1, turn))
        return at

    assert arranged(0, 8) == [(0, 0), (3, 1), (6, 0)] and arranged(4, 8) == [(6, 0)]


def test_layers_come_at_their_time_and_carry_no_spin():
    body = FALLING["bodies"][0]
    later = body | {"center": [0.2, 0.2, 0.9], "start": 0.5}
    sim, count = falling(Stepping, bodies=[body, later], gravity=[0, 0, 0]), []
    drive(sim, lambda s, _: count.append(s.pool.counts[0]))
    assert count == [8, 8, 8, 16, 16] and not sim.frame()["spin"].any() and sim.frame()["spin"].shape == (16, 3)
    assert "stress" not in sim.frame() and (sim.frame()["density"] == 1000.0).all()
    assert set(sim.arrays()) == {f"pool.{name}" for name in (*sim.pool.fields, "count", "fault")}
    assert sim.footprint() == {f"pool.{name}": size for name, size in sim.pool.footprint().items()}


def test_what_is_laid_at_the_start_is_seen_at_the_start():
    s = bead(duration=0.1)
    sim, seen = Simulation(s, Stepping), []
    drive(sim, lambda x, _: seen.append(len(x.frame()["mass"])))
    assert seen[0] > 0 and seen == sorted(seen)  # the nozzle is filled before the first look


@pytest.mark.parametrize("name", NATIVE)
def test_no_sort_key_has_more_bits_than_are_sorted_by(name):
    """Nor many fewer: of two worlds, the last of whose unused slots have the largest key of all."""
    s = bead(duration=0.4)
    sim = Simulation([s, s], name)
    sim.prepare()
    sim.begin()
    largest = int(sim.solver.sort_keys().numpy()[: sim.pool.size].max())
    assert largest.bit_length() == sim.solver.sort_bits < 64
