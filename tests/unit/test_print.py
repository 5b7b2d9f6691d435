"""The verdict on a print, on synthetic particle sets: sound, broken, collapsed, one stray particle; coarse and fine."""

import numpy as np
import pandas as pd
import pytest

from fluidbench.measure.ledger import lengths
from fluidbench.measure.tower import SECTORS, SHORTEST, Print, measure_tower, success, verdict_of
from fluidbench.method.frame import CARRIED, FREE

from ..conftest import scenario

DIAMETER, RISE, LAYERS = 0.012, 0.009, 3
WIDTH = np.pi / 4 * DIAMETER**2 / RISE  # a layer as wide as its material fills: Q / V over the rise


def wall(length, spacing, **more):
    """Three layers back and forth over one line."""
    return scenario(
        domain={"lower": [-0.03, -0.03, 0.0], "upper": [length + 0.03, 0.03, 0.06]},
        bodies=[],
        material={"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 200.0},
        nozzle={"diameter": DIAMETER, "exit_speed": 0.1, "standoff": 0.01},
        toolpath={
            "kind": "wall",
            "start": [0.0, 0.0],
            "end": [length, 0.0],
            "speed": 0.1,
            "layers": LAYERS,
            "layer_height": RISE,
            "pause": 0.1,
        },
        spacing=spacing,
        duration=3 * length / 0.1 + 1.0,
        **more,
    )


def ring(radius, spacing):
    """Three closed rings."""
    reach = radius + 0.03
    return scenario(
        domain={"lower": [-reach, -reach, 0.0], "upper": [reach, reach, 0.06]},
        bodies=[],
        material={"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 200.0},
        nozzle={"diameter": DIAMETER, "exit_speed": 0.1, "standoff": 0.01},
        toolpath={
            "kind": "ring",
            "center": [0.0, 0.0],
            "radius": radius,
            "speed": 0.1,
            "layers": LAYERS,
            "layer_height": RISE,
            "pause": 0.1,
        },
        spacing=spacing,
        duration=3 * 2 * np.pi * radius / 0.1 + 1.0,
    )


def lattice(low, high, spacing):
    """Points that each own a box of about spacing^3, and that box's volume."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    count = np.maximum(np.rint((high - low) / spacing).astype(int), 1)
    step = (high - low) / count
    axes = [a + (np.arange(n) + 0.5) * h for a, n, h in zip(low, count, step, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3), float(step.prod())


def built(s, ideal=True):
    """(points, volume of each, birth times) of the print as planned: layers of rectangular section along the path."""
    path, track = s.toolpath, s.track
    points, births, volume = [], [], 0.0
    for k in range(path.layers):
        z = k * RISE
        if path.kind == "ring":
            flat, volume = lattice([0, -WIDTH / 2, z], [path.length(), WIDTH / 2, z + RISE], s.spacing)
            turn, r = flat[:, 0] / path.radius, path.radius + flat[:, 1]
            own = np.stack([r * np.cos(turn), r * np.sin(turn), flat[:, 2]], axis=1)
        else:
            own, volume = lattice([0, -WIDTH / 2, z], [path.length(), WIDTH / 2, z + RISE], s.spacing)
        start = track.time[np.flatnonzero(track.layer == k)[0]]
        points.append(own)
        births.append(np.full(len(own), start + 0.01))
    return np.concatenate(points), volume, np.concatenate(births)


def judged(s, points, volume, births, before=None):
    """(verdict, measures, criteria) of particles as they are at the end of the print."""
    frame = {
        "time": s.duration,
        "position": points,
        "velocity": np.zeros_like(points),
        "mass": np.full(len(points), 1000.0 * volume),
        "volume": np.full(len(points), volume),
        "held": np.full(len(points), FREE),
        "birth_time": births,
        "origin": np.arange(len(points)),
        "phase": np.zeros(len(points), int),
        "spin": np.zeros_like(points),
    }
    measures = lengths(frame, s) | measure_tower(frame, s)
    rows = [{"time_s": t, **lengths(frame if before is None else before, s)} for t in (0.0, s.track.end)]
    series = pd.DataFrame([*rows, {"time_s": s.duration, **measures}])
    criteria = success(s, measures, series)
    return verdict_of(criteria), measures, {c.name: c for c in criteria}


SCENARIOS = [
    wall(0.2, 1.5e-3),
    wall(0.08, 1.5e-3),
    wall(0.08, 3e-3),
    wall(0.2, 4.5e-3),
    wall(1.0, 6e-3),
    ring(0.06, 1.5e-3),
    ring(0.1, 4e-3),
]
every_print = pytest.mark.parametrize(
    "s", SCENARIOS, ids=lambda s: f"{s.toolpath.kind}-{s.toolpath.length():.2g}-{s.spacing}"
)


@every_print
def test_a_sound_print_is_sound_and_as_high_as_it_is(s):
    verdict, measures, criteria = judged(s, *built(s))
    assert verdict is Print.SOUND, criteria
    assert measures["print_height_m"] == pytest.approx(LAYERS * RISE, abs=0.26 * s.spacing)
    assert criteria["continuity of the worst layer"].measured == 1.0
    for k in range(LAYERS):
        assert measures[f"layer_{k + 1}_level_m"] == pytest.approx((k + 0.5) * RISE, abs=0.51 * s.spacing)
        assert measures[f"layer_{k + 1}_width_m"] == pytest.approx(WIDTH, abs=1.2 * s.spacing)


@every_print
def test_jitter_of_the_particles_changes_no_verdict(s):
    points, volume, births = built(s)
    shaken = points + np.random.default_rng(4).uniform(-0.3, 0.3, points.shape) * s.spacing
    shaken[:, 2] = np.abs(shaken[:, 2])
    assert judged(s, shaken, volume, births)[0] is Print.SOUND


@every_print
def test_one_stray_particle_changes_nothing(s):
    """On top of a collapsed print it does not make a tower, and beside a sound one it breaks nothing."""
    points, volume, births = built(s)
    plain = judged(s, points, volume, births)
    stray = points.copy()
    stray[0] = [points[:, 0].mean() + 0.5 * s.spacing, s.toolpath.corners()[0, 1], 0.055]
    verdict, measures, criteria = judged(s, stray, volume, births)
    assert verdict is Print.SOUND
    for name, criterion in criteria.items():
        assert criterion.measured == pytest.approx(plain[2][name].measured, abs=0.02, nan_ok=True)
    fallen = points * [1.0, 1.0, 0.3]
    fallen[0] = stray[0]
    verdict, measures, _ = judged(s, fallen, volume, births)
    assert verdict is Print.COLLAPSED and measures["print_height_m"] < 0.5 * LAYERS * RISE


@every_print
@pytest.mark.parametrize("left", [0.0, 0.04, 0.2])
def test_a_gap_in_a_layer_breaks_the_print(s, left):
    """A layer of which a tenth of the path, four sectors at least, holds 20 % of its mass, 4 %, or nothing."""
    points, volume, births = built(s)
    path = s.toolpath
    if path.kind == "ring":
        share, middle = np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) % 1.0, 1.0
    else:
        share, middle = points[:, 0] / path.length(), 1.0 - 2.0 * min(DIAMETER / path.length(), 0.25)
    gap = max(0.1, 4 * SHORTEST * s.spacing / path.length())
    inside = (births < s.track.time[np.flatnonzero(s.track.layer == 1)[0]]) & (abs(share - 0.5) < gap / 2)
    keep = ~inside | (np.random.default_rng(2).random(len(points)) < left)
    verdict, _, criteria = judged(s, points[keep], volume, births[keep])
    assert verdict is not Print.SOUND and not criteria["continuity of the worst layer"].met
    sectors = min(SECTORS, middle * path.length() / (SHORTEST * s.spacing))
    assert criteria["continuity of the worst layer"].measured == pytest.approx(1.0 - gap / middle, abs=2.0 / sectors)


@every_print
def test_half_of_a_print_that_fell_has_collapsed(s):
    """One half of the path stands as planned, the other lies flat beside it: the highest particle tells nothing."""
    points, volume, births = built(s)
    fallen = points.copy()
    half = points[:, 0] > points[:, 0].mean()
    fallen[half, 2] *= 0.25
    verdict, _, criteria = judged(s, fallen, volume, births)
    assert verdict is Print.COLLAPSED
    assert criteria["share of the path that stands"].measured == pytest.approx(0.5, abs=0.12)


@pytest.mark.parametrize("factor", [0.5, 0.7])
def test_a_print_that_sank_evenly_has_collapsed(factor):
    s = SCENARIOS[1]
    points, volume, births = built(s)
    verdict, _, criteria = judged(s, points * [1, 1, factor], volume, births)
    assert verdict is Print.COLLAPSED
    assert criteria["height over plan"].measured == pytest.approx(factor, abs=0.03)


def test_a_print_that_stands_but_sinks_is_deformed():
    s = SCENARIOS[1]
    points, volume, births = built(s)
    fresh = {
        "time": 0.0,
        "position": points,
        "volume": np.full(len(points), volume),
        "mass": np.full(len(points), volume * 1000.0),
        "held": np.full(len(points), FREE),
        "phase": np.zeros(len(points), int),
        "birth_time": births,
    }
    verdict, _, criteria = judged(s, points * [1, 1, 0.9], volume, births, before=fresh)
    assert verdict is Print.DEFORMED
    assert criteria["sunk after the last layer"].measured == pytest.approx(0.1, abs=0.01)


def test_a_ring_that_spreads_is_deformed_and_its_radius_is_told():
    s = SCENARIOS[5]
    points, volume, births = built(s)
    wide = points * [1.15, 1.15, 1.0]
    _, _, criteria = judged(s, wide, volume, births)
    assert criteria["worst radius error"].measured == pytest.approx(0.15, abs=0.005)
    assert not criteria["worst radius error"].met


def test_a_missing_layer_is_incomplete_whatever_else_holds():
    s = SCENARIOS[1]
    points, volume, births = built(s)
    last = births > s.track.time[np.flatnonzero(s.track.layer == 2)[0]]
    assert judged(s, points[~last], volume, births[~last])[0] is Print.INCOMPLETE


def test_what_is_still_in_the_nozzle_belongs_to_no_layer():
    s = SCENARIOS[1]
    points, volume, births = built(s)
    frame = {
        "position": points,
        "mass": np.full(len(points), volume),
        "birth_time": births,
        "held": np.where(points[:, 2] > 2 * RISE, CARRIED, FREE),
    }
    assert "layer_3_level_m" not in measure_tower(frame, s) and "layer_2_level_m" in measure_tower(frame, s)
