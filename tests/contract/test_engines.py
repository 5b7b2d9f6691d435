"""The contract with engines that others wrote, each in a process of its own. Run with -m slow, once it is added."""

import pytest

from fluidbench.registry import get_method
from fluidbench.study.compare import compare

A = 0.05715  # width of Martin & Moyce's column [m]
NAMES = ("splishsplash-wcsph", "splishsplash-dfsph")


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_dam_breaks_as_measured(name, tmp_path):
    """Mass is kept, the front is within 15 % of Martin & Moyce, and the steps reported are those that were taken."""
    if reason := get_method(name).missing():
        pytest.skip(reason)
    from fluidbench.scenario.library import load

    made = compare(load("dam_break", {"spacing": A / 12}), [name], out=tmp_path, progress=False)
    run, body = made.runs[0], made.runs[0].scenario.bodies[0]
    record, cost = run.record, run.cost
    assert run.ok, run.reason
    assert record.measures["mass_kg"] == pytest.approx(1000.0 * body.volume, rel=1e-6)
    (front,) = record.answers
    assert front.error < 0.15
    assert cost.substeps > 50 and cost.mean_dt_s == pytest.approx(cost.simulated_s / cost.substeps)
    assert record.bounds_s == {} and sum(record.binding_s.values()) == pytest.approx(cost.simulated_s)
    assert record.code["pysplishsplash"] and "Akinci" in record.approximations[0]
    assert "SPlisHSPlasH" in (run.folder / "log.txt").read_text()
    frame = run.frame()
    assert (frame["origin"] == range(len(frame["origin"]))).all() and (frame["density"] > 0).all()
    assert compare(run.scenario, [name], out=tmp_path, progress=False).runs[0].reused
