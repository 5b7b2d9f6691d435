"""The pool: capacity, ranges of state, what is placed, moved and read."""

import numpy as np
import pytest
import warp as wp

from fluidbench.errors import UserError
from fluidbench.native.pool import CORE, MOST, OutOfCapacity, Pool, whole_warps
from fluidbench.native.scene import Scene
from fluidbench.scenario.extent import ADDRESSABLE

from ..conftest import scenario
from .made import place, pool_of

wp.set_module_options({"enable_backward": False})

PASTE = {
    "density": 1000.0,
    "youngs_modulus": 2.6e4,
    "yield_stress": 50.0,
    "plastic_viscosity": 3.0,
    "flow_index": 0.5,
    "viscosity": 0.25,
}


def test_capacity_comes_in_whole_warps():
    assert {n: whole_warps(n) for n in (0, 1, 32, 33, 64, 65)} == {0: 32, 1: 32, 32: 32, 33: 64, 64: 64, 65: 96}
    pool = pool_of(scenario(), scenario(seed=1))
    assert (pool.capacity, pool.size, pool.worlds, pool.counts) == (64, 128, 2, [0, 0])
    with pytest.raises(UserError, match=r"1 world\(s\) of 67108865 particles exceed"):
        Pool(Scene(scenario()), ADDRESSABLE + 1)
    with pytest.raises(UserError, match=r"2 world\(s\) of 33554433"):
        Pool(Scene([scenario(), scenario(seed=1)]), ADDRESSABLE // 2 + 1)


def test_ranges_of_what_particles_carry():
    """d^3 = 1e-6: a millionth of that to a thousand times, or 3000 where it grows threefold."""
    plain = pool_of().ranges
    assert plain["volume"] == pytest.approx((1e-12, 1e-3)) and plain["mass"] == pytest.approx((1e-9, 1.0))
    assert (plain["phase"], plain["held"], plain["birth_time"]) == ((0, 0), (0, 2), (0.0, 0.02))
    assert {plain[name] for name in ("position", "velocity", "origin")} == {(-MOST, MOST)} and MOST == 1e18
    cure = {"kind": "stages", "time": 1.0, "stages": 4, "youngs_modulus": 5.2e4}
    assert pool_of(scenario(material=PASTE | {"cure": cure})).ranges["phase"] == (0, 4)
    foam = [scenario(material={"density": rho, "expansion": {"ratio": 3.0}}) for rho in (100.0, 500.0)]
    grown = pool_of(*foam).ranges
    assert grown["volume"] == pytest.approx((1e-12, 3e-3)) and grown["mass"] == pytest.approx((1e-10 / 3, 1.5))
    assert list(CORE) == list(plain)


def test_what_is_placed_is_in_every_world_with_its_own_mass():
    pool = pool_of(scenario(), scenario(material={"density": 3000.0}))
    place(pool, 3)
    pool.stale = False
    x = place(pool, 2, (1.0, 2.0, 3.0), volume=2e-6, birth=0.5)
    assert pool.counts == [5, 5] == pool.count.numpy().tolist() and pool.stale
    for world, density in ((0, 1000.0), (1, 3000.0)):
        frame = pool.snapshot(world)
        assert len(frame["mass"]) == 5 and list(frame["origin"]) == [7, 7, 8, 8, 9]
        late = frame["birth_time"] == 0.5
        assert frame["position"][late] == pytest.approx(x) and frame["velocity"][late].tolist() == [[1.0, 2.0, 3.0]] * 2
        assert frame["mass"][late] == pytest.approx(np.full(2, 2e-6 * density)) and frame["volume"][
            late
        ] == pytest.approx(2e-6)
    pool.need(0, 59)
    with pytest.raises(OutOfCapacity, match="holds 64 particles a world and 65 are needed"):
        pool.need(1, 60)
    with pytest.raises(AttributeError, match="no field 'nothing'"):
        _ = pool.nothing


def test_a_permutation_moves_all_fields_at_once():
    pool = pool_of()
    place(pool, 4, (0.0, 1.0, 0.0))
    extra = pool.add_field("extra", float, 5.0)
    assert extra.numpy().tolist() == [5.0] * 64 and pool.ranges["extra"] == (-MOST, MOST)
    extra.assign(np.arange(64, dtype=np.float32))
    pool.stale = False
    order = np.arange(64, dtype=np.int32)
    order[:4] = [2, 0, 3, 1]
    pool.permute(wp.array(order, dtype=int))
    assert (
        pool.stale
        and pool.extra.numpy()[:5].tolist() == [2, 0, 3, 1, 4]
        and pool.origin.numpy()[:4].tolist() == [9, 7, 10, 8]
    )
    frame = pool.snapshot(values=np.arange(64))
    assert frame["origin"].tolist() == [7, 8, 9, 10] and frame["values"].tolist() == [1, 3, 0, 2]
    assert pool.footprint()["position"] == 64 * 12 and pool.footprint()["held"] == 64 * 4
