"""Short runs with known answers for what kernels do alone: wrapping, sliding, friction, feedback, faults."""

import numpy as np
import pytest

from fluidbench.method.verdict import Verdict
from fluidbench.native.pool import FAULT_ASTRAY, FAULT_STATE
from fluidbench.native.simulation import Simulation

from ..conftest import PERIODIC, drive, scenario

METHODS = ["mpm", "sph", "pbd"]
SOLID = {"density": 1000.0, "youngs_modulus": 2e4}
PASTE = {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": 100.0}


@pytest.mark.parametrize(
    "material", [{"density": 1000.0, "sound_speed": 4.0}, PASTE, SOLID], ids=["liquid", "paste", "solid"]
)
@pytest.mark.parametrize("method", METHODS)
def test_what_crosses_a_periodic_face_comes_in_at_the_other(method, material):
    """A full period of matter that flies through its three periodic axes keeps its lattice and its velocity."""
    edge, v = 0.12, np.array([0.5, -0.25, 0.125])
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [edge] * 3, "walls": PERIODIC},
        gravity=[0, 0, 0],
        duration=0.1,
        bodies=[{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3, "velocity": v.tolist()}],
        material=material,
        spacing=0.02,
        tick=0.01,
    )
    sim = Simulation(s, method)
    before = sim.frame()["position"].astype(float)
    assert drive(sim).verdict is Verdict.COMPLETED
    after = sim.frame()
    apart = (after["position"] - before - v * sim.now + edge / 2) % edge - edge / 2
    assert np.abs(apart).max() < 1e-4 * edge and np.abs(after["velocity"] - v).max() < 1e-3
    assert (after["position"] >= 0).all() and (after["position"] <= edge).all()


def sliding(method, walls, gravity=-10.0, top=False, speed=0.4, duration=0.03, material=SOLID):
    """(mean velocity, time) at the end of a block that lies on the floor, or under the ceiling, and slides."""
    body = {
        "kind": "box",
        "center": [0.16, 0.1, 0.16 if top else 0.04],
        "size": [0.08, 0.08, 0.08],
        "velocity": [speed, 0, 0],
    }
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.4, 0.2, 0.2], "walls": walls},
        gravity=[0, 0, gravity],
        bodies=[body],
        material=material,
        duration=duration,
        spacing=0.01,
    )
    sim = Simulation(s, method)
    assert drive(sim).verdict is Verdict.COMPLETED
    frame = sim.frame()
    return np.average(frame["velocity"].astype(float), axis=0, weights=frame["mass"]), sim.now


@pytest.mark.parametrize("top", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_a_block_slides_freely_on_a_smooth_face_whatever_the_other_is(method, top):
    faces = ("stick", "slip") if top else ("slip", "stick")
    after, _ = sliding(method, dict(zip(("z_lower", "z_upper"), faces, strict=True)), 10.0 if top else -10.0, top)
    assert after[0] == pytest.approx(0.4, rel=1e-3)


@pytest.mark.parametrize("top", [False, True])
@pytest.mark.parametrize("method", ["mpm", "sph"])
def test_a_block_on_a_rough_face_slows_down_by_coulombs_law(method, top):
    """What it loses along the face is mu times what the face has pushed, on either face; the other one would hold it or
    let it go."""
    faces = ({"friction": 0.0}, {"friction": 0.3}) if top else ({"friction": 0.3}, {"friction": 0.0})
    walls = dict(zip(("z_lower", "z_upper"), faces, strict=True))
    gravity = 10.0 if top else -10.0
    (early, then), (late, now) = (sliding(method, walls, gravity, top, 0.9, t) for t in (0.1, 0.2))
    pushed = abs(late[2] - early[2] - gravity * (now - then))
    assert early[0] - late[0] == pytest.approx(0.3 * pushed, rel=0.02)


@pytest.mark.parametrize("top", [False, True])
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_a_sheet_of_pbd_on_a_rough_face_slows_down_by_coulombs_law(friction, top):
    """A single layer, whose particles carry nothing but themselves."""
    faces = ({"friction": 0.9}, {"friction": friction})
    walls = dict(zip(("z_lower", "z_upper"), faces if top else faces[::-1], strict=True))
    speeds = []
    for duration in (0.1, 0.2):
        z = 0.195 if top else 0.005
        body = {"kind": "box", "center": [0.16, 0.1, z], "size": [0.08, 0.08, 0.01], "velocity": [0.9, 0, 0]}
        s = scenario(
            domain={"lower": [0, 0, 0], "upper": [0.4, 0.2, 0.2], "walls": walls},
            bodies=[body],
            gravity=[0, 0, 10.0 if top else -10.0],
            material=SOLID,
            duration=duration,
        )
        sim = Simulation(s, "pbd")
        assert drive(sim).verdict is Verdict.COMPLETED
        speeds.append(float(sim.frame()["velocity"][:, 0].mean()))
    assert speeds[0] - speeds[1] == pytest.approx(10.0 * friction * 0.1, rel=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_a_viscous_block_on_a_sticking_face_is_held(method):
    syrup = {"density": 1000.0, "viscosity": 100.0, "sound_speed": 4.0}
    assert abs(sliding(method, {"z_lower": "stick"}, duration=0.15, material=syrup)[0][0]) < 0.1
    assert abs(sliding(method, {"z_lower": "slip"}, duration=0.15, material=syrup)[0][0]) == pytest.approx(
        0.4, rel=1e-3
    )


def test_the_volume_of_what_rests_is_left_alone_by_mpm():
    """In a full period at rest nothing but strain may change J or move a particle, however crowded it says it is."""
    edge = 0.16
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [edge] * 3, "walls": PERIODIC},
        gravity=[0, 0, 0],
        bodies=[{"kind": "box", "center": [edge / 2] * 3, "size": [edge] * 3}],
        spacing=0.01,
        material={"density": 1000.0, "sound_speed": 4.0, "youngs_modulus": 1e3, "yield_stress": 9.0},
    )
    sim = Simulation(s, "mpm")
    places = sim.pool.position.numpy()
    for start in (1.05, 0.97):
        sim.pool.volume_ratio.fill_(start)
        sim.march(1e-4, 1)
        assert sim.pool.volume_ratio.numpy()[: sim.pool.counts[0]] == pytest.approx(start, abs=2e-7)
    assert sim.pool.position.numpy() == pytest.approx(places, abs=1e-8)


@pytest.mark.parametrize(
    ("method", "field", "value"),
    [
        *[("mpm", "volume_ratio", value) for value in (1e7, 1e-7, -1.0)],
        *[("sph", "density", value) for value in (1e8, -5e3)],
        *[(method, "elastic_normal", value) for method in METHODS for value in (-5.0, 1e7)],
    ],
)
def test_a_state_that_no_matter_has_is_found_after_the_substep_that_meets_it(method, field, value):
    """Broken between two substeps: the pass that advances it, or the audit that follows, marks it."""
    sim = Simulation(scenario(material=PASTE, spacing=0.016), method, graphs=False)
    sim.prepare()
    sim.advance_tick()
    assert sim.health.broken() is None
    values = sim.pool.fields[field].numpy().copy()
    values[5] = value
    sim.pool.fields[field].assign(values)
    sim._run(1)
    sim.health.audit()
    assert sim.health.broken() is not None


@pytest.mark.parametrize("density", [1.1e6, -1.1e3])
def test_sph_marks_densities_before_it_mends_them(density):
    """It keeps a density above a tenth of that at rest, which would hide what is broken from any audit."""
    sim = Simulation(scenario(material=PASTE, spacing=0.016), "sph", graphs=False)
    sim.prepare()
    sim.advance_tick()
    values = sim.pool.density.numpy().copy()
    values[5] = density
    sim.pool.density.assign(values)
    sim._run(1)
    assert int(sim.pool.fault.numpy()[0]) & int(FAULT_STATE)


@pytest.mark.parametrize("method", METHODS)
def test_a_particle_that_leaves_is_marked_by_the_pass_that_moves_it(method):
    sim = Simulation(scenario(material=PASTE, spacing=0.016), method, graphs=False)
    sim.prepare()
    sim.advance_tick()
    assert sim.health.broken() is None
    v = sim.pool.velocity.numpy().copy()
    v[5] = [0.0, 0.0, 1e9]
    sim.pool.velocity.assign(v)
    sim._run(1)
    assert int(sim.pool.fault.numpy()[0]) & int(FAULT_ASTRAY)


@pytest.mark.parametrize("gap", [1.05, 1.3])
def test_pbd_leaves_what_is_not_crowded_alone(gap):
    """A lattice at rest, and a thinner one, stay as they are without gravity; a denser one spreads."""
    s = scenario(gravity=[0, 0, 0], duration=0.005, tick=1e-3)
    sim = Simulation(s, "pbd")
    for scale, moves in ((1.0, False), (gap, False), (1 / gap, True)):
        x = sim.frame()["position"].astype(float)
        middle = x.mean(axis=0)
        positions = sim.pool.position.numpy().copy()
        n = sim.pool.counts[0]
        start = middle + scale * (
            np.stack(np.meshgrid(*[np.arange(8) - 3.5] * 3, indexing="ij"), -1).reshape(-1, 3) * 0.01
        )
        assert n == len(start)
        positions[:n] = start
        sim.pool.position.assign(positions.astype(np.float32))
        sim.pool.velocity.zero_()
        sim.pool.stale = True
        sim.march(1e-3, 1)
        shift = np.abs(sim.pool.position.numpy()[:n] - start).max()
        assert bool(shift > 1e-5) is moves, scale
