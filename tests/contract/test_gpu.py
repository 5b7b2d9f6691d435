"""The same answers on CUDA as on the CPU, within the measure's resolution. Run with -m gpu."""

import pytest

from fluidbench.measure.ledger import ledger, lengths
from fluidbench.method.target import Target
from fluidbench.method.verdict import Verdict
from fluidbench.native.simulation import Simulation

from ..conftest import NATIVE, bead, drive


@pytest.mark.gpu
@pytest.mark.parametrize("name", NATIVE)
def test_cuda_agrees_with_the_cpu(name):
    s = bead(duration=0.4)
    rows = []
    for device in ("cpu", "cuda:0"):
        sim = Simulation(s, name, Target(device))
        assert drive(sim).verdict is Verdict.COMPLETED
        frame = sim.frame()
        rows.append({**ledger(frame, s), **lengths(frame, s)})
    assert rows[0]["mass_kg"] == rows[1]["mass_kg"]
    for key in ("top_m", "center_x_m", "center_z_m"):
        assert rows[0][key] == pytest.approx(rows[1][key], abs=s.spacing / 2)
