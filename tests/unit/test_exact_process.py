"""Feeding, laying, curing and chance on the device against closed forms, with no method in sight."""

import numpy as np
import pytest
import warp as wp

from fluidbench.method.frame import CARRIED, CLAMPED, FREE
from fluidbench.native.pool import OutOfCapacity, Pool
from fluidbench.native.process.chance import Chance, chance_of, direction, uniform
from fluidbench.native.process.curing import Curing
from fluidbench.native.process.emission import Emission
from fluidbench.native.process.placement import Placement
from fluidbench.native.scene import Scene
from fluidbench.scenario.layout import capacity_of
from fluidbench.scenario.stream import Stream

from ..conftest import bead, scenario

wp.set_module_options({"enable_backward": False})

BLOCK = {"kind": "box", "center": [0.03, 0.0, 0.004], "size": [0.008, 0.008, 0.008], "clamped": True}
FULL = 1000.0 * np.pi * 0.006**2 * 0.002  # mass of a disc


def fed(*densities, **more):
    """A nozzle above a clamped block of 64 particles, in a world for each density: (pool, emission, stream)."""
    made = [bead(duration=0.5, bodies=[BLOCK], material={"density": rho}, **more) for rho in densities]
    scene = Scene(made)
    pool = Pool(scene, capacity_of(made[0]))
    Placement(made[0], pool)
    return pool, Emission(scene, pool), Stream(made[0])


def turned(points, disc):
    """Places (n, 2) of a disc's points, of which each disc turns on by a golden angle, 137.5 degrees."""
    angle = np.radians(137.50776405003785) * disc
    x, y = np.asarray(points).T
    return np.column_stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])


def test_discs_stand_in_the_nozzle_a_spacing_apart_and_move_on_with_it():
    """After 0.5 ms: five discs, the first 0.95 mm above the exit at z = 10 mm; nozzle and piston move at 0.1 m/s."""
    pool, emission, stream = fed(1000.0, 2500.0)
    emission.advance(0.0005, 0.004)
    n = len(stream.offsets)
    assert pool.counts == [64 + 5 * n] * 2
    for world, density in enumerate((1000.0, 2500.0)):
        frame = {name: values[64:] for name, values in pool.snapshot(world).items()}
        disc, point = np.divmod(np.arange(5 * n), n)
        x, y = turned(stream.offsets[point], disc).T
        place = np.column_stack([5e-5 + x, y, 0.01095 + 0.002 * disc])
        assert frame["position"] == pytest.approx(place, abs=1e-8)
        assert frame["velocity"] == pytest.approx(np.tile([0.1, 0.0, -0.1], (5 * n, 1)), abs=1e-5)
        assert set(frame["held"]) == {int(CARRIED)} and list(frame["origin"]) == list(range(64, 64 + 5 * n))
        assert frame["mass"] == pytest.approx(np.full(5 * n, FULL * density / 1000.0 / n))
        assert frame["volume"] == pytest.approx(np.full(5 * n, FULL / 1000.0 / n))
        assert frame["birth_time"] == pytest.approx(0.01 + 0.02 * disc)


def test_discs_leave_at_their_time_and_have_flown_since():
    """At 30.5 ms the first left 20.5 ms ago at x = 1 mm, the second 0.5 ms ago at x = 3 mm, both at 0.1 m/s."""
    pool, emission, stream = fed(1000.0)
    n = len(stream.offsets)
    for now in (0.0, 0.0305):
        emission.advance(now, 0.004)
    frame = {name: values[64:] for name, values in pool.snapshot().items()}
    assert list(frame["held"]) == [int(FREE)] * 2 * n + [int(CARRIED)] * (len(frame["held"]) - 2 * n)
    for disc, (left, late) in enumerate([(0.001, 0.0205), (0.003, 0.0005)]):
        part = slice(disc * n, (disc + 1) * n)
        x, y = turned(stream.offsets, disc).T
        place = np.column_stack([left + 0.1 * late + x, y, np.full(n, 0.01 - 0.1 * late)])
        assert frame["position"][part] == pytest.approx(place, abs=1e-8)
        assert frame["velocity"][part] == pytest.approx(np.tile([0.1, 0.0, -0.1], (n, 1)), abs=1e-6)
    block = pool.snapshot()
    assert set(block["held"][:64]) == {int(CLAMPED)} and not block["velocity"][:64].any()


def test_carried_discs_head_for_their_place_at_the_next_tick_wherever_they_lag():
    """After 50 ms the nozzle is at (4, 1) mm; a new disc starts from 3 mm in x, one that was left behind from 0."""
    path = {"kind": "polyline", "points": [[0, 0], [0.004, 0], [0.004, 0.012]], "speed": 0.1}
    pool, emission, stream = fed(1000.0, toolpath=path)
    n = len(stream.offsets)
    emission.advance(0.0, 0.002)
    emission.advance(0.03, 0.02)
    frame = {name: values[64:] for name, values in pool.snapshot().items()}
    assert (frame["held"][: 2 * n] == int(FREE)).all() and (frame["held"][2 * n :] == int(CARRIED)).all()
    on_time = frame["position"][n : 2 * n, :2] - turned(stream.offsets, 1)  # released at this very moment
    assert on_time == pytest.approx(np.tile([0.003, 0.0], (n, 1)), abs=1e-8)
    assert frame["velocity"][2 * n : 3 * n] == pytest.approx(np.tile([0.2, 0.05, -0.25], (n, 1)), abs=1e-5)
    assert frame["velocity"][-n:] == pytest.approx(np.tile([0.05, 0.05, -0.1], (n, 1)), abs=1e-5)


def test_every_disc_comes_once_and_solvers_hear_of_it():
    pool, emission, stream = fed(1000.0)
    pool.stale = False
    for tick in range(100):
        emission.advance(0.004 * tick + 1e-5, 0.004)
        assert pool.counts[0] == 64 + stream.entered(0.004 * tick + 1e-5) * len(stream.offsets)
        if tick in (1, 99):
            assert not pool.stale  # nothing came, nothing left
        if tick in (3, 5, 73):
            assert pool.stale  # the first left, then a sixth came; the last leaves at 0.29 s
        pool.stale = False
    frame = pool.snapshot()
    assert list(frame["origin"]) == list(range(64 + stream.particles)) and not (frame["held"] == int(CARRIED)).any()
    assert frame["mass"][64:].astype(float).sum() == pytest.approx(15 * FULL)


def test_a_disc_that_finds_no_room_ends_the_run():
    made = bead(duration=0.5, bodies=[BLOCK])
    pool = Pool(Scene(made), 96)
    Placement(made, pool)
    with pytest.raises(OutOfCapacity, match="holds 96 particles a world and"):
        Emission(pool.scene, pool).advance(0.0, 0.004)


def copied(pool, other):
    """What a checkpoint carries of a pool, put into another one."""
    for name, array in pool.fields.items():
        other.fields[name].assign(array.numpy())
    other.set_count(0, pool.counts[0])


def test_feeding_goes_on_from_where_another_one_came_to():
    (pool, emission, stream), (other, second, _) = fed(1000.0), fed(1000.0)
    for now in (0.0, 0.0305):
        emission.advance(now, 0.004)
    assert emission.progress() == [stream.entered(0.0305) * len(stream.offsets), 2]
    copied(pool, other)
    second.go_on(emission.progress())
    for each in (emission, second):
        each.advance(0.0705, 0.004)
    assert second.progress() == emission.progress() and other.counts == pool.counts
    once, again = pool.snapshot(), other.snapshot()
    assert all((once[name] == again[name]).all() for name in once)


def test_laying_goes_on_from_where_another_one_came_to():
    bodies = [{**BLOCK, "start": start} for start in (0.0, 0.1, 0.2)]
    s = bead(bodies=bodies, duration=0.5)
    pools = [Pool(Scene(s), capacity_of(s)) for _ in range(2)]
    first, second = (Placement(s, pool) for pool in pools)
    first.advance(0.15)
    assert first.progress() == [1, 128 + Stream(s).particles]
    copied(*pools)
    second.go_on(first.progress())
    for each in (first, second):
        each.advance(0.15)
        each.advance(0.25)
    once, again = (pool.snapshot() for pool in pools)
    assert len(once["mass"]) == 192 and all((once[name] == again[name]).all() for name in once)


def test_bodies_are_laid_at_their_start_in_order_after_the_stream():
    def box(x, start, **more):
        return {"kind": "box", "center": [x, 0.0, 0.004], "size": [0.004] * 3, "start": start, **more}

    bodies = [box(0.03, 0.2, velocity=[1, 2, 3]), box(0.02, 0.0), box(0.01, 0.04, clamped=True)]
    s = bead(bodies=bodies, duration=0.5)
    pool = Pool(Scene(s), capacity_of(s))
    laying, fed = Placement(s, pool), Stream(s).particles
    counts = pool.counts.copy()
    for now in (0.0, 0.0399, 0.04, 0.15, 0.2 - 1e-11, 0.3):  # rounding lays nothing a tick late
        laying.advance(now)
        counts.append(pool.counts[0])
    assert counts == [8, 8, 8, 16, 16, 24, 24] and laying.placed == 24 + fed
    frame = pool.snapshot()
    assert list(frame["origin"]) == [*range(8), *range(8 + fed, 24 + fed)]
    assert frame["birth_time"] == pytest.approx(np.repeat([0.0, 0.04, 0.2], 8))
    assert frame["position"][:, 0].reshape(3, 8).mean(axis=1) == pytest.approx([0.02, 0.01, 0.03])
    assert list(frame["held"]) == [int(FREE)] * 8 + [int(CLAMPED)] * 8 + [int(FREE)] * 8
    assert frame["velocity"].reshape(3, 8, 3).tolist() == [[[0, 0, 0]] * 8, [[0, 0, 0]] * 8, [[1, 2, 3]] * 8]
    assert frame["mass"] == pytest.approx(np.full(24, 1000.0 * 0.002**3))


def test_without_a_nozzle_bodies_are_numbered_throughout():
    cube = {"kind": "box", "center": [0.05] * 3, "size": [0.02] * 3}
    s = scenario(bodies=[{**cube, "start": 0.005}, cube])
    pool = Pool(Scene(s), capacity_of(s))
    Placement(s, pool).advance(0.005)
    assert list(pool.snapshot()["origin"]) == list(range(16))


KINDS = {
    "jump": {},
    "stages": {"time": 2.0, "stages": 5},
    "linear": {"time": 2.0},
    "first_order": {"rate": 1.0},
    "kamal_sourour": {"rate": 0.1, "rate_autocatalytic": 2.0},
    "avrami": {"rate": 0.5, "exponent": 2.5},
}


def curing(now, births, held=None, phase=None, jitter=0.0, seed=0, **cure):
    """The level that each particle, born at its time, is due at `now`."""
    side = round(len(births) ** (1 / 3))
    cube = {"kind": "box", "center": [0.1, 0.1, 0.1], "size": [0.01 * side] * 3}
    material = {"density": 1e3, "youngs_modulus": 1e4, "cure": {"delay": 1.0, "jitter": jitter, "youngs_modulus": 1e5}}
    material["cure"] |= cure
    domain = {"lower": [-0.1] * 3, "upper": [0.3] * 3}
    s = scenario(bodies=[cube], material=material, domain=domain, seed=seed)
    pool = Pool(Scene(s), capacity_of(s))
    Placement(s, pool)
    for name, values in (("birth_time", births), ("held", held), ("phase", phase)):
        if values is not None:
            full = pool.fields[name].numpy().copy()
            full[: pool.counts[0]] = values
            pool.fields[name].assign(full)
    heard = []
    Curing(pool.scene, pool, lambda due: heard.append(due.numpy()[: pool.counts[0]].copy())).advance(now)
    (due,) = heard
    assert len(due) == len(births)
    return due, s.material.cure


@pytest.mark.parametrize("kind", KINDS)
def test_the_level_is_the_nearest_to_the_degree_of_cure_at_the_age(kind):
    births = np.linspace(0.001, 7.9, 125)
    due, model = curing(8.0, births, kind=kind, **KINDS[kind])
    degrees = np.array([model.degree(8.0 - birth) for birth in births]) * model.levels
    near = np.abs(degrees % 1.0 - 0.5) < 1e-4
    expected = np.floor(degrees + (0.5 if model.levels == 100 else 1e-6))
    assert near.sum() <= 2 and (due == expected)[~near].all() and due.max() == model.levels > due.min() == 0


def test_a_level_is_reached_at_its_very_age():
    births = np.array([1.0, 1.001, 0.999, 0.5, 0.499, 0.501, 0.0, -1.0])
    assert curing(2.0, births, kind="jump")[0].tolist() == [1, 0, 1, 1, 1, 1, 1, 1]
    assert curing(2.0, births, kind="stages", time=1.0, stages=2)[0].tolist() == [0, 0, 0, 1, 1, 0, 2, 2]


def test_what_is_in_the_nozzle_does_not_cure_and_nothing_softens_again():
    births = np.array([6.0] * 4 + [-2.0] * 4)
    held = [int(FREE), int(CARRIED), int(CLAMPED), int(FREE)] * 2
    due, _ = curing(8.0, births, held, phase=[0, 7, 0, 60] * 2, kind="linear", time=2.0)
    assert due.tolist() == [50, 7, 50, 60, 100, 7, 100, 100]


def test_jitter_moves_the_onset_evenly_both_ways():
    """All 1.5 s old, levels of 20 ms: from 5 levels early to 5 late; others for another seed."""
    births = np.full(4096, 6.5)
    due, _ = curing(8.0, births, jitter=0.1, kind="linear", time=2.0)
    assert due.min() == 20 and due.max() == 30 and set(due) == set(range(20, 31))
    assert due.mean() == pytest.approx(25.0, abs=0.15) and due.std() == pytest.approx(10 / np.sqrt(12), rel=0.03)
    other, _ = curing(8.0, births, jitter=0.1, kind="linear", time=2.0, seed=1)
    assert (other != due).mean() > 0.5


@wp.kernel
def draws(chance: Chance, at: wp.array2d(dtype=int), number: wp.array(dtype=float), way: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    number[i] = uniform(chance, at[i, 0], at[i, 1], at[i, 2])
    way[i] = direction(chance, at[i, 0], at[i, 1], at[i, 2])


def drawn(particle, generation=0, draw=0, seed=0, purpose="test"):
    at = np.stack(np.broadcast_arrays(np.asarray(particle), generation, draw), axis=1).astype(np.int32)
    number, way = wp.zeros(len(at), dtype=float, device="cpu"), wp.zeros(len(at), dtype=wp.vec3, device="cpu")
    wp.launch(
        draws, len(at), [chance_of(seed, purpose), wp.array(at, dtype=int, device="cpu"), number, way], device="cpu"
    )
    return number.numpy().astype(float), way.numpy().astype(float)


def test_chance_is_even_and_depends_on_everything_that_it_is_asked_for():
    n = np.arange(40_000)
    first, way = drawn(n)
    assert 0.0 <= first.min() < 1e-3 and 0.999 < first.max() < 1.0
    assert np.histogram(first, 10, (0, 1))[0] == pytest.approx(np.full(10, 4000), abs=250)
    assert (drawn(n[::-1])[0] == first[::-1]).all()  # the particle counts, not its place
    others = {"generation": 1, "draw": 1, "seed": 1, "purpose": "other"}
    for name, value in others.items():
        again, _ = drawn(n, **{name: value})
        assert abs(np.corrcoef(first, again)[0, 1]) < 0.02
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.02
    assert all(0 <= chance_of(seed, "test").key < 2**31 for seed in range(50))
    turn = 2 * np.pi * drawn(n, draw=1)[0]  # a direction takes two draws: its height and its turn
    assert way[:, 2] == pytest.approx(2 * first - 1, abs=1e-6)
    flat = np.sqrt(1 - way[:, 2] ** 2)
    assert way[:, 0] == pytest.approx(flat * np.cos(turn), abs=2e-3)
    assert way[:, 1] == pytest.approx(flat * np.sin(turn), abs=2e-3)
    assert np.linalg.norm(way, axis=1) == pytest.approx(np.ones(len(n)), abs=1e-5)
    assert way.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.015)
    assert way.T @ way / len(n) == pytest.approx(np.eye(3) / 3, abs=0.01)
    for axis in range(3):  # each component of a direction on the sphere is even in -1 .. 1
        assert np.histogram(way[:, axis], 8, (-1, 1))[0] == pytest.approx(np.full(8, 5000), abs=300)


def test_curing_draws_its_own_lots():
    """Those of its purpose for each particle, early for a high lot: not those of the expansion, or both would go
    together."""
    due, _ = curing(8.0, np.full(4096, 6.5), jitter=0.1, kind="linear", time=2.0)
    level = 50.0 * (0.5 + 0.1 * (2.0 * drawn(np.arange(4096), purpose="curing")[0] - 1.0)) + 0.5
    clear = np.abs(level - np.rint(level)) > 1e-3
    assert (due == np.floor(level))[clear].all() and clear.mean() > 0.99
