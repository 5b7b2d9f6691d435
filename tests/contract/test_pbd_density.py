"""How PBD reads the density of paste: on a lattice as it is, in disorder as a kernel with a flat top reads it on the
mean, at a free surface not at all."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from solvers.pbd.numbers import DRAWING, face_level, lattice_sum, moments
from solvers.smoothing import cusp, poly6

from ..conftest import scenario

D, SIDE = 0.01, 0.1
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
FACES = ("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper")
PASTE = {"density": 1000.0, "youngs_modulus": 6e3, "yield_stress": 60.0}


def block(device, walls, room, side=SIDE, material=PASTE, **more):
    """A cube of paste in a domain that leaves so much room on all sides, read twice: what disorder adds to the
    density is that of a substep before."""
    made = scenario(
        material=material,
        domain={"lower": [-room] * 3, "upper": [side + room] * 3, "walls": walls},
        bodies=[{"kind": "box", "center": [side / 2] * 3, "size": [side] * 3}],
        gravity=[0, 0, 0],
        spacing=D,
        **more,
    )
    sim = Simulation(made, "pbd", Target(device), graphs=False)
    sim.prepare()
    sim.placed = False  # read as it was shaken, before it settles
    sim.begin()
    sim.scene.set_dt(1e-9)
    sim.solver.predict()
    sim.solver.lists()
    for _ in range(2):
        sim.solver.pack()
        (sim.solver.surround if sim.solver.elastic is None else sim.solver.strain)()
    sim.solver.multipliers()
    sim.solver.backend.wait()
    count = sum(sim.pool.counts)
    fields = {name: sim.pool.fields[name].numpy()[:count] for name in ("position", "bias", "overread", "enclosure")}
    return sim, fields | {"fill": sim.solver.fill.numpy()[:count]}


def sums(x, kernel, support, period):
    """Kernel sum over all others [1/m^3] in a periodic cube."""
    r = x[:, None] - x[None]
    r -= period * np.round(r / period)
    values = np.vectorize(kernel)(np.linalg.norm(r, axis=2), support)
    return values.sum(axis=1) - kernel(0.0, support)


@pytest.mark.parametrize("device", DEVICES)
def test_a_lattice_is_read_as_it_is_and_only_its_inside_is_enclosed(device):
    _, seen = block(device, {}, 0.06)
    depth = np.minimum(seen["position"], SIDE - seen["position"]).min(axis=1)
    outside, inside = depth < D, depth > D
    assert np.abs(seen["enclosure"][outside]).max() < 1e-4
    assert np.abs(seen["enclosure"][inside] - 1.0).max() < 1e-4
    assert np.abs(seen["overread"][depth > 2.0 * D]).max() < 1e-5
    assert np.abs(seen["bias"][depth > 4.0 * D]).max() < 1e-5


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("size", [1.0, 1.05])
def test_of_disorder_the_inside_is_enclosed_and_no_shell_below_its_surface(device, size):
    """A cube without the corners of its lattice, and the same stretched evenly."""
    sim, _ = block(device, {}, 0.06, 0.14, jitter=0.25, seed=1)
    pool, count = sim.pool, sum(sim.pool.counts)
    centre = 0.07
    position = pool.position.numpy()
    position[:count] = centre + size * (position[:count] - centre)
    pool.position.assign(position)
    for name in ("lists", "pack", "strain"):
        getattr(sim.solver, name)()
    sim.solver.backend.wait()
    enclosure = pool.fields["enclosure"].numpy()[:count]
    depth = 0.07 - np.abs((position[:count] - centre) / size).max(axis=1)
    assert enclosure[depth < D].mean() < 0.05
    assert enclosure[depth > 2.0 * D].mean() > 0.8


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("seed", [1, 2])
def test_disorder_is_read_as_a_flat_kernel_reads_it(seed, device):
    sim, seen = block(device, dict.fromkeys(FACES, "periodic"), 0.0, jitter=0.35, seed=seed)
    support, ratio = sim.solver.num.support, sim.solver.num.support / D
    sharp, flat = (
        D**3 * (sums(seen["position"].astype(float), kernel, support, SIDE) + kernel(0.0, support))
        / lattice_sum(kernel, ratio)
        for kernel in (cusp, poly6)
    )  # fmt: skip
    over = sharp.mean() / flat.mean() - 1.0
    assert over > 0.01
    assert seen["fill"].mean() == pytest.approx(flat.mean(), abs=0.1 * over)
    # what a particle reads beyond its neighbourhood stays the sharp kernel's: under the flat one pairs would not show
    assert seen["fill"] == pytest.approx(sharp / (1.0 + seen["bias"]), rel=1e-4)
    assert seen["bias"].std() < 0.5 * seen["overread"].std()


def squeezed(device, leaning, size=1.0, **more):
    """A cube squeezed by a fifth along an axis that leans by an angle [rad], and made so much smaller. Its solver after
    `multipliers`, the pool's fields of the fabric, and which particles have others all round that have, too."""
    side = 16 * D
    sim, _ = block(device, {}, 0.1, side, **more)
    pool, solver, count = sim.pool, sim.solver, sum(sim.pool.counts)
    turn = np.array([[np.cos(leaning), 0, np.sin(leaning)], [0, 1, 0], [-np.sin(leaning), 0, np.cos(leaning)]])
    stretch = size * turn @ np.diag([0.8**-0.5, 0.8**-0.5, 0.8]) @ turn.T
    position = pool.position.numpy()
    within = np.abs(position[:count] - side / 2).max(axis=1) < D
    position[:count] = side / 2 + (position[:count] - side / 2) @ stretch
    pool.position.assign(position)
    for name in ("predict", "lists", "pack", "strain", "multipliers"):
        getattr(solver, name)()
    solver.backend.wait()
    return (
        solver,
        [pool.fields[f"fabric_{part}"].numpy()[:count] for part in ("normal", "shear")],
        np.flatnonzero(within),
    )


def moved_by(solver, axis, fabric):
    """Corrections [m] by a multiplier that falls evenly along an axis."""
    rows = solver.pushes.numpy().reshape(-1, DRAWING)
    rows[: len(fabric), 8:14] = rows[: len(fabric), [axis]] * fabric
    solver.pushes.assign(rows.reshape(-1, 4))
    solver.correct()
    solver.backend.wait()
    return solver.correction.numpy()


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("leaning", [0.0, 0.5])
def test_squeezed_paste_is_pressed_alike_on_all_sides(leaning, device):
    """And no harder, on the mean over the axes, than along the lines to partners."""
    solver, fabric, inner = squeezed(device, leaning)
    assert len(inner) == 8
    even = np.hstack(fabric)
    alike = np.stack([moved_by(solver, axis, even)[inner] for axis in range(3)], axis=1)
    plain = np.stack(
        [moved_by(solver, axis, np.tile([1, 1, 1, 0, 0, 0], (len(even), 1)))[inner] for axis in range(3)], 1
    )
    size = np.trace(plain, axis1=1, axis2=2) / 3.0
    assert alike == pytest.approx(size[:, None, None] * np.eye(3), abs=1e-3 * float(np.abs(size).max()))
    assert np.abs(plain / size[:, None, None] - np.eye(3)).max() > 0.03


@pytest.mark.parametrize("material", [{"youngs_modulus": 6e3}, PASTE | {"expansion": {"ratio": 2.0, "time": 1.0}}])
def test_solids_and_what_expands_are_pushed_along_the_lines_to_partners(material):
    solver, (normal, shear), inner = squeezed("cpu", 0.5, 0.9, material={"density": 1000.0} | material)
    rows = solver.pushes.numpy().reshape(-1, DRAWING)[inner]
    assert (rows[:, 8:11] == rows[:, [8]]).all() and (rows[:, 11:14] == 0.0).all() and (rows[:, 8] < 0.0).any()
    if "expansion" in material:
        assert (normal == 1.0).all() and (shear == 0.0).all()


LIQUID = {"density": 1000.0, "viscosity": 2.0}


@pytest.mark.parametrize("device", DEVICES)
def test_a_viscous_liquid_is_read_as_paste_is(device):
    """Its own pass and the strain's find the same surroundings; one that carries no tension has neither."""
    more = {"walls": {"z_lower": "stick"}, "room": 0.06, "jitter": 0.3, "seed": 3}
    found = []
    for material in (LIQUID | {"tension_limit": 10.0}, PASTE):
        sim, seen = block(device, material=material, **more)
        assert ("pulled" in sim.pool.fields) == (material is PASTE)
        shear = sim.pool.fields["fabric_shear"].numpy()[: len(seen["fill"])]
        found.append((*(seen[key] for key in ("position", "bias", "overread", "enclosure", "fill")), shear))
    for liquid, paste in zip(*found, strict=True):
        assert liquid == pytest.approx(paste, abs=2e-5 * max(1.0, float(np.abs(paste).max())))
    sim = Simulation(scenario(material=LIQUID | {"tension_limit": 0.0}), "pbd", Target(device), graphs=False)
    assert sim.solver.around is None and "enclosure" not in sim.pool.fields


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("limit", "answered"), [(1e9, 0.05), (1.0, None), (0.0, 0.0)])
def test_no_more_tension_is_pulled_with_than_the_material_carries(device, limit, answered):
    """A stretched cube: its multipliers grow with the lack up to the limit over K."""
    sim, _ = block(device, {}, 0.06, material=PASTE | {"tension_limit": limit}, jitter=0.0)
    pool, solver, count = sim.pool, sim.solver, sum(sim.pool.counts)
    bulk = float(sim.scene.phases.numpy()["bulk_modulus"].max())
    asked = np.zeros(pool.size, np.float32)
    inner = np.abs(pool.position.numpy()[:count] - SIDE / 2).max(axis=1) < D
    found = []
    for lack in (0.05, answered if answered is not None else limit / bulk):
        asked[:] = lack
        pool.fields["lack"].assign(asked)
        solver.multipliers()
        solver.backend.wait()
        found.append(solver.pushes.numpy().reshape(-1, DRAWING)[:count][inner, 8])
    assert found[0] == pytest.approx(found[1], rel=1e-5, abs=1e-12)
    assert (found[0] > 0.0).all() == (limit > 0.0)


@pytest.mark.parametrize("sum_at_face", [face_level, lambda ratio: moments(ratio)[0] / moments(ratio)[1]])
def test_a_face_is_half_a_lattice_and_its_own_plane(sum_at_face):
    """In the continuum a half; the plane counts the less the further a kernel reaches: with one over its reach."""
    beyond = np.array([sum_at_face(ratio) - 0.5 for ratio in (4.0, 8.0, 16.0)])
    assert (beyond > 0.0).all() and beyond[:-1] / beyond[1:] == pytest.approx(2.0, rel=0.15)
