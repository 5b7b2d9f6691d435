"""What every method must do, registered or not."""

import numpy as np
import pytest

from fluidbench.method.frame import CLAMPED
from fluidbench.method.verdict import Verdict
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.scenario.numerics import configure
from fluidbench.scenario.stream import Stream

from ..conftest import NATIVE, G, bead, center_of_mass, drive, scenario
from .ballistic import Ballistic

METHODS = [*map(get_method, NATIVE), Ballistic]
every_method = pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)


def drop(**table):
    """A liquid sphere in free flight, far from all walls."""
    body = {"kind": "sphere", "center": [0.3, 0.3, 0.6], "radius": 0.05, "velocity": [1.0, 0.0, 2.0]}
    return scenario(
        domain={"lower": [0.0, 0.0, 0.0], "upper": [1.0, 0.6, 1.2]}, bodies=[body], spacing=0.01, duration=0.2, **table
    )


@every_method
def test_free_fall_is_exact_but_for_the_integrator(method):
    """x = x0 + v0 t + g (t^2 + sum dt^2) / 2 for symplectic Euler, and the shape is kept (references.md, A)."""
    sim = Simulation(drop(), method)
    before = sim.pool.snapshot()
    sim.prepare()
    squares = 0.0
    while sim.done < sim.ticks:
        plan = sim.advance_tick()
        squares += plan.substeps * plan.dt**2
        sim.look()
    after, t = sim.pool.snapshot(), sim.now
    moved = center_of_mass(after) - center_of_mass(before)
    expected = np.array([t, 0.0, 2.0 * t - G * (t * t + squares) / 2])
    assert np.abs(moved - expected).max() < 2e-4 * G * t * t / 2 + 1e-6
    shape = [f["position"] - center_of_mass(f) for f in (before, after)]
    assert np.abs(shape[1] - shape[0]).max() / 0.05 < 5e-3
    assert np.allclose(after["velocity"].mean(axis=0), [1.0, 0.0, 2.0 - G * t], atol=1e-3)


@every_method
def test_mass_and_momentum_are_conserved_in_free_flight(method):
    """sum m is exact; P = P0 + M g t to single precision, with internal forces at work (a spinning, straining drop)."""
    body = {
        "kind": "sphere",
        "center": [0.5, 0.5, 0.5],
        "radius": 0.05,
        "velocity_gradient": [[5.0, -8.0, 0.0], [8.0, 5.0, 0.0], [0.0, 0.0, -10.0]],
    }
    s = scenario(domain={"lower": [0, 0, 0], "upper": [1, 1, 1]}, bodies=[body], duration=0.02)
    sim = Simulation(s, method)
    m = sim.pool.snapshot()["mass"].astype(float)
    start = m @ sim.pool.snapshot()["velocity"].astype(float)
    assert drive(sim).verdict is Verdict.COMPLETED
    end = sim.pool.snapshot()
    momentum = end["mass"].astype(float) @ end["velocity"].astype(float)
    impulse = np.array([0.0, 0.0, -G * sim.now]) * m.sum()
    assert end["mass"].sum() == m.astype(np.float32).sum()
    assert np.abs(momentum - start - impulse).max() < 1e-3 * np.abs(impulse).max()


@every_method
def test_emission_is_exact_in_mass_and_the_same_for_all(method):
    """Mass rho Q t to half a disc at any time; the released stream equals the host's schedule bit for bit."""
    s = bead()
    sim, stream = Simulation(s, method), Stream(s)
    sim.prepare()
    seen: dict[int, tuple] = {}
    while sim.done < sim.ticks:
        sim.advance_tick()
        sim.look()
        sim.emission.advance(sim.now, sim.tick)
        frame = sim.pool.snapshot()
        free = frame["held"] == 0
        exact = s.material.density * s.nozzle.rate * float(s.track.extruded(sim.now))
        disc = s.material.density * s.nozzle.area * s.spacing
        assert abs(frame["mass"][free].astype(float).sum() - exact) <= 0.501 * disc
        for i in np.flatnonzero(free):
            seen.setdefault(int(frame["origin"][i]), (*frame["position"][i], *frame["velocity"][i]))
    expected = stream.release_time[np.arange(len(seen)) // len(stream.offsets)].astype(np.float32)
    assert np.array_equal(sim.pool.snapshot()["birth_time"][: len(seen)], expected)
    reference = Simulation(s, Ballistic)
    reference.prepare()
    other: dict[int, tuple] = {}
    while reference.done < reference.ticks:
        reference.advance_tick()
        reference.emission.advance(reference.now, reference.tick)
        frame = reference.pool.snapshot()
        for i in np.flatnonzero(frame["held"] == 0):
            other.setdefault(int(frame["origin"][i]), (*frame["position"][i], *frame["velocity"][i]))
    assert seen == other


@every_method
def test_same_seed_same_bits(method):
    """Two runs on the CPU agree to the last bit, jitter included."""
    frames = []
    for _ in range(2):
        sim = Simulation(scenario(jitter=0.2, seed=3), method)
        drive(sim)
        frames.append(sim.pool.snapshot())
    assert all(np.array_equal(frames[0][key], frames[1][key]) for key in frames[0])


@every_method
def test_worlds_agree_with_single_runs(method):
    """Four yield stresses in one launch give the same answers as four runs."""

    def paste(stress):
        material = {"density": 1000.0, "youngs_modulus": 2e4, "yield_stress": stress, "plastic_viscosity": 5.0}
        return scenario(material=material, duration=0.03, spacing=0.016)

    scenarios = [paste(stress) for stress in (20.0, 60.0, 180.0, 540.0)]
    together = Simulation(scenarios, method)
    drive(together)
    for world, single in enumerate(scenarios):
        alone = Simulation(single, method)
        drive(alone)
        a, b = together.pool.snapshot(world), alone.pool.snapshot()
        assert np.allclose(a["position"], b["position"], atol=1e-3 * single.spacing)


@every_method
def test_graph_and_eager_execution_agree(method):
    """Capturing changes nothing."""
    ends = []
    for graphs in (True, False):
        sim = Simulation(scenario(), method, graphs=graphs)
        drive(sim)
        ends.append(sim.pool.snapshot()["position"])
    assert np.array_equal(*ends)


@every_method
def test_nothing_leaves_the_domain(method):
    """A jet against walls and corners stays inside."""
    body = {"kind": "box", "center": [0.05, 0.05, 0.05], "size": [0.06, 0.06, 0.06], "velocity": [-2.0, -2.0, -2.0]}
    s = scenario(bodies=[body], duration=0.1)
    sim = Simulation(s, method)
    assert drive(sim).verdict is Verdict.COMPLETED
    if method is not Ballistic:  # which knows no side walls
        assert s.domain.contains(sim.pool.snapshot()["position"]).all()


@every_method
def test_bounds_are_named_and_explained(method):
    s = scenario(material={"density": 1000.0, "viscosity": 10.0})
    bounds = method.bounds(s, configure(method, s), 1.0)
    assert bounds and all(b.dt > 0 and b.name and b.formula and b.source for b in bounds)


@every_method
def test_footprint_counts_bytes(method):
    sim = Simulation(scenario(), method)
    found, own = sim.footprint(), sim.solver.footprint()
    assert found["pool.position"] == 12 * sim.pool.size == sim.pool.position.capacity
    assert {name for name in found if name.startswith("solver.")} == {f"solver.{name}" for name in own}
    assert all(size > 0 for size in found.values()) and bool(own) == (method is not Ballistic)


@every_method
def test_a_force_field_makes_a_drop_swing(method):
    """In a pull -Omega^2 (x - x0) the centre of a drop swings as cos(Omega t), whatever happens inside."""
    omega, centre = 20.0, np.array([0.2, 0.2, 0.2])
    s = scenario(
        domain={"lower": [0, 0, 0], "upper": [0.4, 0.4, 0.4]},
        gravity=[0.0, 0.0, 0.0],
        duration=0.1,
        bodies=[{"kind": "sphere", "center": [0.24, 0.2, 0.2], "radius": 0.04}],
        body_force_gradient=np.diag([-(omega**2)] * 3).tolist(),
        body_force_center=centre.tolist(),
    )
    sim = Simulation(s, method)
    start = center_of_mass(sim.pool.snapshot()) - centre
    assert drive(sim).verdict is Verdict.COMPLETED
    end = center_of_mass(sim.pool.snapshot()) - centre
    assert np.abs(end - start * np.cos(omega * sim.now)).max() < 0.02 * np.linalg.norm(start)


@every_method
def test_a_clamped_body_keeps_its_velocity(method):
    """A clamp moves on at its own speed through gravity, and through what leans on it."""
    bodies = [
        {
            "kind": "box",
            "center": [0.06, 0.1, 0.1],
            "size": [0.04, 0.04, 0.04],
            "velocity": [0.1, 0, 0],
            "clamped": True,
        },
        {"kind": "box", "center": [0.11, 0.1, 0.1], "size": [0.06, 0.04, 0.04]},
    ]
    s = scenario(bodies=bodies, material={"density": 1000.0, "youngs_modulus": 1e5}, duration=0.05)
    sim = Simulation(s, method)
    before = sim.pool.snapshot()
    assert drive(sim).verdict is Verdict.COMPLETED
    after, clamped = sim.pool.snapshot(), before["held"] == CLAMPED
    moved = after["position"][clamped] - before["position"][clamped]
    assert np.allclose(moved, [0.1 * sim.now, 0.0, 0.0], atol=1e-5)
    assert np.allclose(after["velocity"][clamped], [0.1, 0.0, 0.0])


@pytest.mark.parametrize("method", NATIVE)
def test_a_path_with_travel_leaves_beads_where_it_extrudes_and_nothing_between(method, tmp_path):
    """Two strokes 40 mm apart in plan, the second with half the flow, as G-code; 3 particles across."""
    (tmp_path / "two.gcode").write_text(
        "M83\nG0 F6000 X0 Y0 Z4\nG1 F3000 X30 E30\nG1 E-2\nG0 Z8\nG0 X0 Y40\nG0 Z4\nG1 E2\nG1 F3000 X30 E15\n"
    )
    paste = {"density": 1000.0, "youngs_modulus": 6e3, "poisson_ratio": 0.45, "yield_stress": 60.0}
    path = {"kind": "gcode", "file": str(tmp_path / "two.gcode"), "filament": 6e-3}
    nozzle = {"diameter": 6e-3}
    two = scenario(material=paste, nozzle=nozzle, toolpath=path, bodies=[], spacing=2e-3, domain=None, duration=2.6)
    sim = Simulation(two, method)
    assert drive(sim).verdict == Verdict.COMPLETED
    end = sim.pool.snapshot()
    x, laid = end["position"], float(end["volume"].sum())
    disc = 2e-3 * np.pi * 9e-6  # one may be early, or hang on to what is in the nozzle
    assert laid == pytest.approx(45e-3 * np.pi * 9e-6, abs=disc)
    first, second = x[:, 1] < 0.02, x[:, 1] >= 0.02
    assert end["volume"][second].sum() == pytest.approx(15e-3 * np.pi * 9e-6, abs=1.01 * disc)
    for own, y in ((first, 0.0), (second, 0.04)):
        assert np.abs(x[own, 1] - y).max() < 8e-3
        assert x[own, 0].min() > -8e-3 and x[own, 0].max() < 38e-3
