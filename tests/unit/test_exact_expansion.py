"""Growth against R(t), and births one by one: how many, when, where, how fast, how heavy and whose."""

import math

import numpy as np
import pytest

from fluidbench.method.frame import CARRIED, FREE
from fluidbench.native.pool import OutOfCapacity, Pool
from fluidbench.native.process.expansion import Growing
from fluidbench.native.process.placement import Placement
from fluidbench.native.scene import Scene
from fluidbench.scenario.expansion import Expansion
from solvers.neighbours import ROOM, room

from ..conftest import scenario

D = 0.01
VELOCITY = [0.1, -0.2, 0.3]


def growing(
    model, side=4, center=(0.05, 0.1, 0.1), generations=3, capacity=20_000, worlds=1, seed=0, tick=None, **fields
):
    """A cube of side^3 particles of 1 cm^3 each, and what makes them grow."""
    body = {"kind": "box", "center": list(center), "size": [D * side] * 3, "velocity": VELOCITY}
    material = {"density": 1000.0, "youngs_modulus": 1e3, "expansion": model}
    walls = {"x_lower": "periodic", "x_upper": "periodic"}
    domain = {"lower": [-0.05, 0.0, 0.0], "upper": [0.15, 0.3, 0.4], "walls": walls}
    timing = {} if tick is None else {"tick": tick, "duration": 10 * tick, "output_interval": 10 * tick}
    s = scenario(bodies=[body], material=material, domain=domain, spacing=D, seed=seed, **timing)
    pool = Pool(Scene([s] * worlds), capacity)
    grown = Growing(pool.scene, pool, side**3, generations)
    Placement(s, pool)
    for name, values in fields.items():
        full = pool.fields[name].numpy().copy()
        full[: side**3] = values
        pool.fields[name].assign(full)
    return grown, pool


@pytest.mark.parametrize(("ratio", "tick"), [(1.0, 0.02), (1.01, 0.02), (2.0, 0.001), (10.0, 0.02), (30.0, 0.1)])
def test_growth_over_a_tick_is_the_ratio_of_the_volumes_at_its_ends(ratio, tick):
    """ln(R(t + tick) / R(t)) / tick at 64 ages: before the onset, across it, in full growth and near the end."""
    births = np.linspace(-4.0, 0.5, 64).astype(np.float32)
    grown, pool = growing({"ratio": ratio, "delay": 0.25, "time": 0.5}, birth_time=births)
    grown.advance(0.6, tick)
    ages = 0.6 - births.astype(float)
    model = grown.model
    expected = [math.log(model.volume_ratio(a + tick) / model.volume_ratio(a)) / tick for a in ages]
    assert pool.growth.numpy()[:64] == pytest.approx(np.array(expected), rel=2e-3, abs=2e-6 * ratio / tick)
    assert pool.counts == [64]


@pytest.mark.parametrize(("ratio", "tick", "tolerance"), [(1.45, 0.001, 2e-4), (1.01, 0.02, 5e-4)])
def test_small_growth_keeps_its_precision(ratio, tick, tolerance):
    """Gains below a thousandth, as large as they come: both of their second-order terms count."""
    births = np.linspace(0.28, 0.33, 64).astype(np.float32)
    grown, pool = growing({"ratio": ratio, "delay": 0.25, "time": 0.5}, birth_time=births)
    grown.advance(0.6, tick)
    volume = grown.model.volume_ratio
    expected = [math.log(volume(0.6 - b + tick) / volume(0.6 - b)) / tick for b in births.astype(float)]
    assert 3e-4 < max(expected) * tick < 1e-3
    assert pool.growth.numpy()[:64] == pytest.approx(np.array(expected), rel=tolerance)


def test_growth_stands_still_in_the_nozzle():
    held = [int(CARRIED)] * 32 + [int(FREE)] * 32
    grown, pool = growing({"ratio": 10.0}, held=held)
    grown.advance(0.5, 0.01)
    rates = pool.growth.numpy()[:64]
    assert not rates[:32].any() and (rates[32:] > 0).all()


@pytest.mark.parametrize("share", [1, 2])
def test_jitter_moves_the_onset_evenly_and_children_keep_the_clock_of_their_ancestor(share):
    """From the volume after one long tick follows when each began: 0.2 s, give or take 0.1."""
    origin = np.arange(4096) * share  # with share = 2 the second half are children of the first
    grown, pool = growing({"ratio": 4.0, "delay": 0.2, "jitter": 0.1, "time": 0.5}, side=16, origin=origin)
    grown.advance(0.05, 0.35)
    ratio = np.exp(pool.growth.numpy()[:4096].astype(float) * 0.35)
    start = 0.4 + 0.5 * np.log(1 - (ratio - 1) / 3.0)
    assert start.min() > 0.1 - 1e-5 and start.max() < 0.3 + 1e-5
    assert start.min() == pytest.approx(0.1, abs=1e-3) and start.max() == pytest.approx(0.3, abs=1e-3)
    assert start.mean() == pytest.approx(0.2, abs=0.005) and start.std() == pytest.approx(0.2 / 12**0.5, rel=0.05)
    if share == 2:
        assert (start[:2048] == start[2048:]).all()


def test_what_has_outgrown_the_spacing_is_halved_in_place():
    """Beyond 1.5 spacing^3, as often as the generation allows; halves lie 0.5 to 0.63 edges apart about the middle."""
    volume = np.full(64, 1.49 * D**3)
    volume[:8] = 1.51 * D**3
    volume[8] = 4.0 * D**3
    generation = np.zeros(64, int)
    generation[6], generation[7] = 1, 3  # the last has had its three
    origin = np.arange(64)
    origin[6] += 64
    grown, pool = growing({"ratio": 10.0}, volume=volume, generation=generation, origin=origin, worlds=2)
    before = {name: array.numpy()[:64].copy() for name, array in pool.fields.items()}
    grown.advance(0.1, 0.001)
    assert pool.counts == [72, 64]
    for first, count in ((0, 72), (pool.capacity, 64)):  # what is not in use stays as it was
        assert not pool.mass.numpy()[first + count : first + pool.capacity].any()
    after = {name: array.numpy()[:72].copy() for name, array in pool.fields.items()}
    halved = [0, 1, 2, 3, 4, 5, 6, 8]
    same = [i for i in range(64) if i not in halved]
    for name in ("position", "velocity", "mass", "volume", "origin", "generation"):
        assert (after[name][same] == before[name][same]).all()
    children = {int(o): i for i, o in enumerate(after["origin"][64:], 64)}
    assert sorted(children) == [64, 65, 66, 67, 68, 69, 72, 70 + 128]
    for i in halved:
        twin = children[int(before["origin"][i]) + 64 * 2 ** int(before["generation"][i])]
        arm = (after["position"][twin] - after["position"][i]).astype(float)
        assert 0.499 < np.linalg.norm(arm) / volume[i] ** (1 / 3) < 0.631
        middle = (after["position"][twin] + after["position"][i]) / 2
        assert middle == pytest.approx(before["position"][i], abs=1e-7)
        for slot in (i, twin):
            assert after["volume"][slot] == pytest.approx(volume[i] / 2) and after["velocity"][slot].tolist() == (
                before["velocity"][i].tolist()
            )
            assert after["mass"][slot] == pytest.approx(1000.0 * D**3 / 2)
            assert after["generation"][slot] == before["generation"][i] + 1


@pytest.mark.parametrize(
    ("model", "tick", "every"),
    [
        ({"ratio": 10.0, "time": 0.4}, 1e-3, 4),  # 22.5 / s at first
        ({"ratio": 10.0, "time": 0.4}, 5e-3, 1),
        ({"ratio": 32.0, "time": 5.3}, 5e-3, 3),
        ({"ratio": 1.1, "time": 100.0}, 1e-3, 100),
        ({"kind": "spawn", "ratio": 8.0}, 1e-3, 1),
        ({"ratio": 10.0, "time": 0.4, "split": False}, 1e-3, None),
    ],
)
def test_births_wait_until_matter_has_grown_by_a_tenth(model, tick, every):
    grown, _ = growing(model, side=2, tick=tick)
    due = [t for t in range(201) if grown.due(t)]
    assert due == ([] if every is None else list(range(0, 201, every)))


@pytest.mark.parametrize("stretched", [0, 1, 2])
def test_halves_go_where_there_is_room(stretched):
    """Between lattice planes that growth has moved apart, whatever the axis."""
    gap = np.ones(3)
    gap[stretched] = 1.5
    place = (np.array([0.05, 0.1, 0.1]) + D * gap * (np.indices((4, 4, 4)).reshape(3, -1).T - 1.5)).astype(np.float32)
    grown, pool = growing({"ratio": 10.0}, volume=np.full(64, 1.51 * D**3), position=place)
    grown.advance(0.1, 0.001)
    twin = np.argsort(pool.origin.numpy()[64:128])
    arm = np.abs(pool.position.numpy()[64:128][twin] - pool.position.numpy()[np.argsort(pool.origin.numpy()[:64])])
    inner = ((place > place.min(axis=0)) & (place < place.max(axis=0))).all(axis=1)
    assert inner.sum() == 8
    assert (arm[inner].argmax(axis=1) == stretched).all()


def test_halves_keep_away_from_walls_as_from_neighbours():
    """A layer on the floor and below the ceiling of a low domain: its halves lie beside each other."""
    place = np.indices((4, 4, 4)).reshape(3, -1).T * np.array([4.0, 4.0, 0.0]) * D + np.array([0.0, 0.02, 0.5 * D])
    place[:, 0] += 0.7 * D * (np.arange(64) % 4)
    grown, pool = growing({"ratio": 10.0}, volume=np.full(64, 1.51 * D**3), position=place.astype(np.float32))
    grown.advance(0.1, 0.001)
    arm = pool.position.numpy()[:128, 2] - 0.5 * D
    assert np.abs(arm).max() < 0.35 * D


def test_particles_that_may_not_split_only_grow():
    grown, pool = growing({"ratio": 10.0, "split": False}, volume=np.full(64, 9 * D**3))
    grown.advance(0.1, 0.001)
    assert pool.counts == [64] and "generation" not in pool.fields and grown.footprint() == {}


SPAWN = {"kind": "spawn", "ratio": 8.0, "delay": 0.2}


def families(pool, ancestors):
    """(slots of the children, of shape (ancestors, offspring_count)), all litters being of one size."""
    origin = pool.origin.numpy()[: pool.counts[0]]
    assert len(np.unique(origin)) == len(origin)
    return np.argsort(origin % ancestors, kind="stable").reshape(ancestors, -1)


def test_a_litter_shares_mass_and_volume_in_a_ball_about_its_parent():
    """8 children of 1 cm^3 in a ball of 0.7 edges of 8 cm^3, 1.4 cm; less their mean, 7/8 of 3/5 r^2."""
    grown, pool = growing({**SPAWN, "radius": 0.7, "impulse": 0.5}, side=8, center=(0.05, 0.15, 0.2), generations=1)
    parents = pool.position.numpy()[:512].astype(float)
    grown.advance(0.1999, 0.001)
    assert pool.counts == [512]
    grown.advance(0.2001, 0.001)
    assert pool.counts == [4096]
    family = families(pool, 512)
    position, velocity = pool.position.numpy().astype(float), pool.velocity.numpy().astype(float)
    assert position[family].mean(axis=1) == pytest.approx(parents, abs=1e-7)
    out = position[family] - parents[:, None]
    assert np.mean(out**2) == pytest.approx(0.014**2 * 3 / 5 * 7 / 8 / 3, rel=0.02)
    assert np.mean(out**2, axis=(0, 1)) == pytest.approx(np.full(3, np.mean(out**2)), rel=0.05)  # in all directions
    assert np.linalg.norm(out - out[:, :1], axis=2).max() <= 0.028
    assert velocity[family] - VELOCITY == pytest.approx(0.5 / 0.014 * out, abs=1e-5)  # 0.5 m/s at the rim
    assert pool.mass.numpy()[family] == pytest.approx(np.full((512, 8), 1000.0 * D**3 / 8))
    assert pool.volume.numpy()[family] == pytest.approx(np.full((512, 8), D**3))
    assert (pool.generation.numpy()[family] == 1).all() and pool.counts == [4096]
    grown.advance(9.0, 0.001)
    assert pool.counts == [4096]


@pytest.mark.parametrize("model", [{**SPAWN, "ratio": 2.5, "noise": 0.1}, {"ratio": 9.0}])
def test_worlds_give_birth_alike(model):
    grown, pool = growing(model, worlds=3, capacity=4096)
    pool.volume.assign(1.7 * pool.volume.numpy())
    grown.advance(0.2001, 0.001)
    assert len(set(pool.counts)) == 1 and pool.counts[0] >= 128
    frames = [pool.snapshot(world) for world in range(3)]
    for name in frames[0]:
        assert (frames[0][name] == frames[1][name]).all() and (frames[0][name] == frames[2][name]).all()


def test_children_that_find_no_room_end_the_run():
    grown, pool = growing(SPAWN, capacity=512)
    grown.advance(0.2001, 0.001)
    assert pool.counts == [512]
    grown, _ = growing(SPAWN, capacity=511 - 31)
    with pytest.raises(OutOfCapacity, match="holds 480 particles a world and 512 are needed"):
        grown.advance(0.2001, 0.001)


def test_noise_has_its_size_in_every_direction_and_no_mean():
    grown, pool = growing({**SPAWN, "noise": 0.3}, side=8, center=(0.05, 0.15, 0.2))
    grown.advance(0.2001, 0.001)
    noise = pool.velocity.numpy()[families(pool, 512)].astype(float) - VELOCITY
    assert noise.mean(axis=1) == pytest.approx(np.zeros((512, 3)), abs=1e-7)
    assert np.square(noise).mean(axis=(0, 1)) == pytest.approx(np.full(3, 0.09 / 3 * 7 / 8), rel=0.05)
    assert np.linalg.norm(noise[:, 0] - noise[:, 1], axis=1).max() <= 0.6 + 1e-6
    position = pool.position.numpy()[families(pool, 512)].astype(float)
    out = position - position.mean(axis=1, keepdims=True)
    assert abs(np.sum(noise * out)) < 0.05 * np.linalg.norm(noise) * np.linalg.norm(out)  # wherever they lie


def test_passes_come_at_their_interval_and_no_more_than_there_are():
    """Twice two: at 0.2 and 0.5 s; what is carried waits, and children inherit when they were born."""
    births = np.zeros(64)
    births[0] = 0.1
    held = np.zeros(64, int)
    held[1] = int(CARRIED)
    model = {**SPAWN, "ratio": 4.0, "passes": 2, "interval": 0.3}
    grown, pool = growing(model, generations=2, birth_time=births, held=held)
    counts = []
    for now in (0.19, 0.21, 0.29, 0.31, 0.49, 0.51, 0.59, 0.61, 5.0):
        grown.advance(now, 0.001)
        counts.append(pool.counts[0])
    assert counts == [64, 126, 126, 127, 127, 251, 251, 253, 253]
    assert pool.mass.numpy().astype(float).sum() == pytest.approx(64 * 1000.0 * D**3)
    origin = pool.origin.numpy()[:253]
    assert len(np.unique(origin)) == 253 and (np.bincount(origin % 64) == [4, 1] + [4] * 62).all()
    assert sorted(origin[origin % 64 == 5]) == [5, 5 + 64, 5 + 128, 5 + 192]
    assert (pool.birth_time.numpy()[:253][origin % 64 == 0] == np.float32(0.1)).all()


def test_chance_decides_the_fraction_and_a_family_keeps_one_clock():
    """Two and a half children each: two or three. With jitter, at 0.4 s of 0.2 +- 0.1 and an interval of 0.2, half of
    the ancestors have had both passes and the others one: a family is of one size or of the square of it."""
    grown, pool = growing({**SPAWN, "ratio": 2.5}, side=16, center=(0.05, 0.15, 0.2))
    grown.advance(0.2001, 0.001)
    sizes = np.bincount(pool.origin.numpy()[: pool.counts[0]] % 4096)
    assert set(sizes) == {2, 3} and sizes.mean() == pytest.approx(2.5, abs=0.03)
    again, twice = growing({**SPAWN, "ratio": 6.25, "passes": 2}, side=8, center=(0.05, 0.15, 0.2), generations=2)
    for now in (0.21, 0.31):
        again.advance(now, 0.001)
    origin = twice.origin.numpy()[: twice.counts[0]]
    assert len(np.unique(origin)) == len(origin) > 512 * 6
    volume = np.bincount(pool.origin.numpy()[: pool.counts[0]] % 4096, pool.volume.numpy()[: pool.counts[0]])
    assert volume == pytest.approx(np.full(4096, 2.5 * D**3))
    model = {**SPAWN, "ratio": 4.0, "passes": 2, "interval": 0.2, "jitter": 0.1}
    grown, pool = growing(model, side=10, generations=2)
    grown.advance(0.101, 0.001)
    assert pool.counts[0] - 1000 < 30
    for now in (0.299, 0.4):
        grown.advance(now, 0.001)
    sizes = np.bincount(pool.origin.numpy()[: pool.counts[0]] % 1000)
    assert set(sizes) <= {1, 2, 4} and (sizes == 1).sum() < 30
    assert (sizes == 4).mean() == pytest.approx(0.5, abs=0.06)


def test_parents_of_one_child_still_grow():
    """A ratio of 1.001: seed 0 gives none of 64 a second child."""
    grown, pool = growing({**SPAWN, "ratio": 1.001})
    grown.advance(0.21, 0.001)
    assert pool.counts == [64] and (pool.generation.numpy()[:64] == 1).all()
    assert pool.volume.numpy()[:64] == pytest.approx(np.full(64, 1.001 * D**3), rel=1e-6)


def test_children_stay_inside_the_walls_and_come_back_at_periodic_ones():
    """At least half a spacing above the floor when spawned, a quarter from other walls and when halved."""
    low = np.full((64, 3), 0.1 * D) - [0.05, 0.0, 0.0]
    low[32:] = [0.15 - 0.1 * D, 0.3 - 0.1 * D, 0.4 - 0.1 * D]
    for model, floor, extra in (
        ({**SPAWN, "margin": 0.6}, 0.6, {}),
        ({"ratio": 9.0}, 0.25, {"volume": np.full(64, 8 * D**3)}),
    ):
        grown, pool = growing(model, position=low, **extra)
        grown.advance(0.21, 0.001)
        position = pool.position.numpy()[: pool.counts[0]].astype(float) / D
        assert len(position) >= 128
        assert position[:, 2].min() == pytest.approx(floor, abs=1e-4)
        assert position[:, 2].max() == pytest.approx(40 - 0.25, abs=1e-4)
        assert position[:, 1].min() == pytest.approx(0.25, abs=1e-4)
        assert position[:, 1].max() == pytest.approx(30 - 0.25, abs=1e-4)
        x = position[:, 0] + 5
        assert 0 <= x.min() < 0.25 and 20 - 0.25 < x.max() <= 20 and ((x < 4) | (x > 16)).all()
        from_low = pool.origin.numpy()[: pool.counts[0]] % 64 < 32
        assert (x[from_low] > 16).any() and (x[from_low] < 4).any()


def test_lists_have_the_same_margin_for_what_has_just_split():
    """A particle splits at 1.5 spacings^3: each half then takes three quarters of one."""
    splits = Expansion(kind="growth", ratio=8.0)
    assert splits.least_volume == 0.75
    assert Expansion(kind="growth", ratio=8.0, split=False).least_volume == 1.0
    assert Expansion(kind="spawn", ratio=8.0).least_volume == 1.0
    lattice = 4.0 / 3.0 * math.pi * 3.375**3
    assert ROOM * lattice / 0.75 <= room(3.375, splits.least_volume) < ROOM * lattice / 0.75 + 24
