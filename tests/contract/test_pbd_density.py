"""How PBD reads the density of paste: on a lattice as it is, in disorder as a kernel with a flat top reads it on the
mean, at a free surface not at all."""

import numpy as np
import pytest

from fluidbench.method.target import Target
from fluidbench.native.simulation import Simulation
from solvers.pbd.numbers import face_level, lattice_sum, moments
from solvers.smoothing import cusp, poly6

from ..conftest import scenario

D, SIDE = 0.01, 0.1
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
FACES = ("x_lower", "x_upper", "y_lower", "y_upper", "z_lower", "z_upper")
PASTE = {"density": 1000.0, "youngs_modulus": 6e3, "yield_stress": 60.0}


def block(device, walls, room, **more):
    """A cube of paste in a domain that leaves so much room on all sides, read twice: what disorder adds to the
    density is that of a substep before."""
    made = scenario(
        material=PASTE,
        domain={"lower": [-room] * 3, "upper": [SIDE + room] * 3, "walls": walls},
        bodies=[{"kind": "box", "center": [SIDE / 2] * 3, "size": [SIDE] * 3}],
        gravity=[0, 0, 0],
        spacing=D,
        **more,
    )
    sim = Simulation(made, "pbd", Target(device), graphs=False)
    sim.prepare()
    sim.begin()
    sim.scene.set_dt(1e-9)
    sim.solver.predict()
    sim.solver.lists()
    for _ in range(2):
        sim.solver.pack()
        sim.solver.strain()
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


@pytest.mark.parametrize("sum_at_face", [face_level, lambda ratio: moments(ratio)[0] / moments(ratio)[1]])
def test_a_face_is_half_a_lattice_and_its_own_plane(sum_at_face):
    """In the continuum a half; the plane counts the less the further a kernel reaches: with one over its reach."""
    beyond = np.array([sum_at_face(ratio) - 0.5 for ratio in (4.0, 8.0, 16.0)])
    assert (beyond > 0.0).all() and beyond[:-1] / beyond[1:] == pytest.approx(2.0, rel=0.15)
