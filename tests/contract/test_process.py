"""Curing and expansion through every method: mass, momentum, identity, and what a feature that is off costs."""

import numpy as np
import pytest

from fluidbench.errors import UserError
from fluidbench.native.simulation import Simulation
from fluidbench.registry import method_names
from fluidbench.scenario.library import validate

from ..conftest import drive

METHODS = [m for m in method_names() if m in ("mpm", "sph", "pbd")]


def foam(material, duration=0.2, spacing=0.01, **more):
    """A small cube of foam floating free, moving and turning."""
    return validate(
        {
            "name": "foam",
            "domain": {"lower": [-0.2] * 3, "upper": [0.2] * 3},
            "duration": duration,
            "spacing": spacing,
            "gravity": [0, 0, 0],
            "tick": duration / 10,
            "bodies": [
                {
                    "kind": "box",
                    "center": [0, 0, 0],
                    "size": [0.04] * 3,
                    "velocity": [0.1, 0.05, 0.0],
                    "angular_velocity": [0, 0, 1.0],
                }
            ],
            "material": {"density": 100.0, "youngs_modulus": 2e3, "yield_stress": 20.0, **material},
            **more,
        },
        "foam",
    )


def ran(scenario, method):
    sim = Simulation(scenario, method)
    before = sim.frame()
    outcome = drive(sim)
    assert outcome.verdict == "completed", outcome.reason
    return before, sim.frame(), sim


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("jitter", [0.0, 0.03])
@pytest.mark.parametrize("ratio", [1.0, 2.5, 10.0, 30.0])
def test_growth_conserves_mass_and_reaches_its_volume(method, ratio, jitter):
    model = {"ratio": ratio, "time": 0.5, "delay": 0.04, "jitter": jitter}
    before, after, _ = ran(foam({"expansion": model}), method)
    mass = before["mass"].astype(float).sum()
    assert after["mass"].astype(float).sum() == pytest.approx(mass, rel=1e-6)
    grown = after["volume"].astype(float).sum() / before["volume"].astype(float).sum()
    assert grown == pytest.approx(1 + (ratio - 1) * (1 - np.exp(-0.16 / 0.5)), rel=0.01 if jitter == 0 else 0.05)
    assert len(np.unique(after["origin"])) == len(after["origin"])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("jitter", [0.0, 0.03])
@pytest.mark.parametrize("ratio", [1.0, 2.5, 10.0, 30.0])
def test_spawning_splits_mass_exactly(method, ratio, jitter):
    passes = {1.0: 1, 2.5: 3, 10.0: 6, 30.0: 9}[ratio]
    model = {"kind": "spawn", "ratio": ratio, "passes": passes, "interval": 0.03, "delay": 0.04, "jitter": jitter}
    before, after, _ = ran(foam({"expansion": model}, duration=0.4), method)
    assert after["mass"].astype(float).sum() == pytest.approx(before["mass"].astype(float).sum(), rel=1e-6)
    assert after["volume"].astype(float).sum() == pytest.approx(ratio * before["volume"].astype(float).sum(), rel=1e-5)
    assert abs(len(after["mass"]) / len(before["mass"]) / ratio - 1) < 0.25


def test_spawned_foam_keeps_its_momentum_and_is_not_flung():
    """In free flight, children of several rest densities and volumes: what PBD pushes apart it does not throw."""
    model = {"kind": "spawn", "ratio": 5.0, "passes": 5, "interval": 0.03, "delay": 0.02}
    before, after, _ = ran(foam({"expansion": model}, duration=0.2), "pbd")
    sums = [(f["mass"].astype(float)[:, None] * f["velocity"]).sum(axis=0) for f in (before, after)]
    assert len(after["mass"]) > 3 * len(before["mass"])
    assert sums[1] == pytest.approx(sums[0], rel=1e-5, abs=1e-9)
    assert np.linalg.norm(after["velocity"], axis=1).max() < 0.2


@pytest.mark.parametrize("method", METHODS)
def test_births_come_every_few_ticks_and_to_the_same_replayed_launched_and_resumed(method):
    model = {"ratio": 8.0, "time": 1.0, "delay": 0.03, "jitter": 0.03}
    grows = foam({"expansion": model}, tick=0.004, output_interval=0.02)
    ends = []
    for graphs in (True, False):
        sim = Simulation(grows, method, graphs=graphs)
        sim.prepare()
        sim.begin()
        assert sim.growing is not None and sim.growing.every == 3
        counts = []
        while sim.done < 50:
            if graphs and sim.done == 25:  # between births
                kept = sim.state()
                sim = Simulation(grows, method)
                sim.prepare()
                sim.resume(*kept)
            sim.advance_tick()
            counts.append(sim.pool.counts[0])
        born = np.flatnonzero(np.diff(counts)) + 1
        assert counts[-1] > counts[0] and len(born) > 3 and (born % 3 == 0).all()
        ends.append(sim.frame())
    assert all((ends[0][name] == ends[1][name]).all() for name in ("position", "velocity", "volume", "origin"))


@pytest.mark.parametrize("method", METHODS)
def test_growth_without_splitting_keeps_its_particles(method):
    before, after, _ = ran(foam({"expansion": {"ratio": 1.4, "time": 0.05, "split": False}}), method)
    assert len(after["mass"]) == len(before["mass"]) and (after["mass"] == before["mass"]).all()
    grown = after["volume"].astype(float).sum() / before["volume"].astype(float).sum()
    assert grown == pytest.approx(1.4, rel=0.02)


def test_the_same_seed_gives_the_same_offspring_for_every_method():
    model = {"kind": "spawn", "ratio": 2.5, "passes": 3, "interval": 0.01, "delay": 0.04, "jitter": 0.03}
    litters = [ran(foam({"expansion": model}), method)[1] for method in METHODS]
    for other in litters[1:]:
        assert (other["origin"] == litters[0]["origin"]).all()
        assert other["mass"] == pytest.approx(litters[0]["mass"])
    fresh = ran(foam({"expansion": model}, seed=1), METHODS[0])[1]
    assert len(fresh["origin"]) != len(litters[0]["origin"]) or (fresh["origin"] != litters[0]["origin"]).any()


@pytest.mark.parametrize("method", METHODS)
def test_a_birth_keeps_momentum_and_center(method):
    model = {"kind": "spawn", "ratio": 2.5, "passes": 3, "delay": 0.04, "impulse": 0.5, "noise": 0.2}
    sim = Simulation(foam({"expansion": model}), method)
    before = sim.frame()
    assert sim.growing is not None
    sim.growing.advance(0.05, 0.001)
    after = sim.frame()
    assert len(after["mass"]) > len(before["mass"])
    for field in ("velocity", "position"):
        sums = [(f["mass"].astype(float)[:, None] * f[field]).sum(axis=0) for f in (before, after)]
        assert sums[1] == pytest.approx(sums[0], abs=1e-6 * float(before["mass"].sum()))


@pytest.mark.parametrize("method", METHODS)
def test_curing_changes_no_momentum_and_follows_age_alone(method):
    """Hardening a pool in place leaves position and velocity bit for bit; the level is that of the age, at any tick."""
    cure = {"kind": "first_order", "rate": 5.0, "delay": 0.02, "youngs_modulus": 2e4, "yield_stress": 2e3}
    sim = Simulation(foam({"cure": cure}), method)
    drive(sim)
    before = sim.frame()
    assert sim.curing is not None
    sim.curing.advance(0.6)
    after = sim.frame()
    assert (after["velocity"] == before["velocity"]).all() and (after["position"] == before["position"]).all()
    assert (after["phase"] > before["phase"]).all()
    expected = round(100 * (1 - np.exp(-5.0 * 0.58)))
    assert set(after["phase"].tolist()) <= {expected - 1, expected, expected + 1}
    fine = ran(foam({"cure": cure}, tick=0.005), method)[1]
    assert abs(int(fine["phase"][0]) - int(before["phase"][0])) <= 8  # the last tick's start


@pytest.mark.parametrize("method", METHODS)
def test_the_step_follows_the_stiffest_material_that_can_be_there(method):
    cure = {"kind": "jump", "delay": 0.1, "youngs_modulus": 2e5, "yield_stress": 2e4}
    sim = Simulation(foam({"cure": cure}), method)
    early = min(b.dt for b in sim.bounds())
    while sim.done < sim.ticks:
        sim.advance_tick()
    late = min(b.dt for b in sim.bounds())
    assert late < 0.3 * early if method != "pbd" else late <= early


@pytest.mark.parametrize("method", METHODS)
def test_a_strand_that_grows_across_a_periodic_axis_stays_where_it_is_and_keeps_its_shape(method):
    """It can grow by its section alone; its halves, that leave through one face and come back through the other, fill
    it evenly: 2.83 times as wide and as high, and not a crowd of families. (MPM to 1 %, PBD 10 % too large; SPH 25 %,
    not understood, of which this asks no more.)"""
    walls = {"y_lower": "periodic", "y_upper": "periodic"}
    body = {"kind": "box", "center": [0, 0.04, 0], "size": [0.06, 0.08, 0.04]}
    model = {"ratio": 8.0, "delay": 0.1, "jitter": 0.05, "time": 0.3}
    material = {"yield_stress": 100.0, "plastic_viscosity": 20.0, "expansion": model}
    domain = {"lower": [-0.3, 0.0, -0.3], "upper": [0.3, 0.08, 0.3], "walls": walls}
    before, after, _ = ran(foam(material, duration=1.2, domain=domain, bodies=[body]), method)
    mass = after["mass"].astype(float)
    assert np.abs(mass @ after["velocity"]).max() / mass.sum() < 1e-5
    across = after["position"][:, ::2].astype(float)
    assert mass @ across / mass.sum() == pytest.approx(np.zeros(2), abs=5e-4)
    (x, z), (u, w) = across.T, after["velocity"][:, ::2].astype(float).T
    turning = mass @ (x * w - z * u) / (mass @ (x * x + z * z))
    assert abs(turning) < (0.12 if method == "sph" else 0.01)  # rad/s; PBD spun up exponentially, to 0.7
    section = np.sqrt(np.linalg.det(np.cov(across.T, aweights=mass)))
    start = np.sqrt(np.linalg.det(np.cov(before["position"][:, ::2].astype(float).T)))
    grown = float(after["volume"].sum() / before["volume"].sum())
    assert 0.85 < section / start / grown < (1.3 if method == "sph" else 1.15)


def test_lists_that_children_would_overfill_are_refused():
    model = {"kind": "spawn", "ratio": 10.0}
    for method in ("sph", "pbd"):
        with pytest.raises(UserError, match="passes = 6 or more"):
            Simulation(foam({"expansion": model}), method)


@pytest.mark.parametrize("method", METHODS)
def test_a_feature_that_is_off_allocates_nothing(method):
    cure = {"delay": 0.1, "youngs_modulus": 2e4}
    variants = {"plain": {}, "curing": {"cure": cure}, "expansion": {"expansion": {"ratio": 2.0}}}
    made = {name: Simulation(foam(material), method) for name, material in variants.items()}
    plain = made["plain"]
    assert plain.curing is None and plain.growing is None and plain.contact is None
    assert not {"growth", "generation"} & set(plain.pool.fields)
    for sim in made.values():
        sim.advance_tick()
    assert plain.process_launches == 0
    assert made["curing"].process_launches >= 2 and made["expansion"].process_launches >= 2
    assert made["expansion"].substep_launches > plain.substep_launches
    assert not [name for name in plain.footprint() if name.startswith(("curing", "expansion", "contact"))]


def under_a_hammer(method, friction):
    """A block of paste; a box that sweeps over it at 0.2 m/s with the nozzle."""
    return validate(
        {
            "name": "hammer",
            "domain": {"lower": [-0.2, -0.1, 0.0], "upper": [0.2, 0.1, 0.2]},
            "duration": 0.8,
            "spacing": 0.01,
            "material": {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 200.0},
            "bodies": [{"kind": "box", "center": [0.05, 0, 0.03], "size": [0.06, 0.06, 0.06]}],
            "nozzle": {"diameter": 0.02, "exit_speed": 1e-3, "standoff": 0.1},  # what it carries stays out of the block
            "toolpath": {"start": [-0.1, 0.0], "end": [0.1, 0.0], "speed": 0.2},
            "collider": {
                "parts": [{"kind": "box", "center": [0, 0.06, -0.05], "size": [0.04, 0.08, 0.04]}],
                "friction": friction,
            },
        },
        "hammer",
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_collider_pushes_what_it_meets_and_nothing_else(method):
    sim = Simulation(under_a_hammer(method, 0.3), method)
    rest = sim.frame()
    outcome = drive(sim)
    assert outcome.verdict == "completed", outcome.reason
    after, scenario = sim.frame(), sim.scenario
    body = after["held"] == 0
    assert scenario.collider is not None and scenario.track is not None
    inside = scenario.collider.distance(after["position"][body] - scenario.track.at(sim.now))
    assert inside.min() > -1.0 * scenario.spacing
    n = len(rest["position"])
    pushed = after["position"][:n, 0] - rest["position"][:, 0]
    met = rest["position"][:, 1] > 0.022
    assert pushed[met & (rest["position"][:, 2] > 0.03)].mean() > 0.005
    assert np.abs(pushed[rest["position"][:, 1] < -0.015]).mean() < 0.3 * pushed[met].mean()


def test_a_collider_inside_the_material_or_the_jet_is_refused():
    table = under_a_hammer("mpm", 0.3).model_dump(mode="json", exclude_none=True)
    for center, words in (
        ([0.12, 0.0, -0.05], "starts inside bodies.0"),
        ([0.0, 0.0, 0.0], "starts inside the material"),
    ):
        table["collider"]["parts"] = [{"kind": "sphere", "center": center, "radius": 0.03}]
        with pytest.raises(UserError, match=words):
            validate(table, "hammer")


@pytest.mark.parametrize("method", METHODS)
def test_a_layer_is_laid_at_its_time_and_stays_where_it_was_put(method):
    layers = [
        {"kind": "box", "center": [0.02, 0.02, z], "size": [0.04, 0.04, 0.02], "start": start}
        for z, start in ((0.03, 0.1), (0.01, 0.0))
    ]
    scenario = foam({}, bodies=layers, domain={"lower": [0, 0, 0], "upper": [0.04, 0.04, 0.08]})
    sim = Simulation(scenario, method)
    count = []
    drive(sim, lambda s, _: count.append((round(s.now, 6), sum(s.pool.counts))))
    assert {n for t, n in count if t < 0.1 - 1e-6} == {32} and {n for t, n in count if t > 0.1 + 1e-6} == {64}
    frame = sim.frame()
    assert list(frame["origin"]) == list(range(64))
    assert set(frame["birth_time"][:32]) == {0.0} and frame["birth_time"][32:] == pytest.approx(0.1)
    assert frame["mass"].astype(float).sum() == pytest.approx(100.0 * 0.04**3, rel=1e-6)
    assert np.ptp(frame["position"][32:, 2]) < 0.012 and frame["position"][32:, 2].min() > 0.022


def test_a_layer_that_would_come_after_the_end_is_refused():
    late = [{"kind": "box", "center": [0, 0, 0], "size": [0.04] * 3, "start": 0.3}]
    with pytest.raises(UserError, match=r"bodies\.0: start = 0\.3 s is not before the last tick"):
        foam({}, bodies=late)
