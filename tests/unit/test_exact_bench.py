"""`bench`: what is measured, against what, and what it says where nothing could be."""

import math

import pandas as pd
import pytest

from fluidbench.errors import UserError
from fluidbench.method.target import Target
from fluidbench.runs.experiment import CRASH
from fluidbench.study import bench as module
from fluidbench.study.bench import sides_of
from fluidbench.study.bench_report import PUBLISHED
from fluidbench.study.speed import MATERIALS, block, measure_speed, speed_tasks

from ..conftest import NATIVE
from .made import working

FAST = {
    "substeps_per_s": 2000.0,
    "particle_substeps_per_s": 2e6,
    "particle_substeps_per_cpu_s": 1e6,
    "bytes_per_particle": 300.0,
    "limit_substeps_per_s": 4000.0,
    "share_of_limit": 0.5,
    "prepare_s": 1.0,
    "memory_GB_per_s": 10.0,
    "cache_GB_per_s": 20.0,
}


def test_a_block_fills_its_box():
    for material in MATERIALS:
        made = block(material, 6)
        (body,) = made.bodies
        assert body.volume == pytest.approx(216 * made.spacing**3) and set(made.domain.walls.faces()) == {"slip"}
        assert tuple(body.size) == pytest.approx(made.domain.upper) and made.domain.lower == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("method", NATIVE)
def test_a_speed_is_held_against_what_memory_allows(method, material):
    ((_, task),) = [t for t in speed_tasks([method], [6], 0.02, Target()) if t[1]["material"] == material]
    found = measure_speed(task)
    assert (found["method"], found["material"], found["particles"]) == (method, material, 216)
    assert found["particle_substeps_per_s"] == pytest.approx(216 * found["substeps_per_s"])
    assert 0 < found["share_of_limit"] < 1.5  # few particles: all of it in the innermost cache
    assert found["share_of_limit"] == pytest.approx(found["substeps_per_s"] / found["limit_substeps_per_s"])
    assert found["memory_GB_per_s"] > 0.1 and found["cache_GB_per_s"] > 0.1 and found["bytes_per_particle"] > 100


def test_sizes_are_cubes_and_never_twice():
    assert sides_of(None, Target()) == [13, 26] and sides_of(None, Target("cuda:0")) == [26, 67]
    assert sides_of([216, 300_000, 301_000, 1000], Target()) == [6, 67, 10]
    for wrong in (0, 1.5, True, 10**10):
        with pytest.raises(UserError, match="particles"):
            sides_of([wrong], Target())


@pytest.mark.parametrize(
    ("answer", "missing"),
    [(FAST, 0), ({CRASH: "it died"}, 2), ({"reason": "it picks its own step", "refused": True}, 0)],
)
def test_what_could_not_be_measured_is_missing_unless_it_was_refused(tmp_path, monkeypatch, answer, missing):
    def told(work):
        return (
            answer
            if CRASH in answer
            else {k: work.task[k] for k in ("method", "material")} | {"particles": 216} | answer
        )

    calls = working(monkeypatch, told)
    made = module.bench(["mpm"], particles=[216], out=tmp_path, progress=False)
    assert len(made.table) == 2 and len(made.missing) == missing and made.ok is (not missing)
    assert [call.workers for call in calls] == [1], "times mean something one at a time only"
    text = repr(made)
    assert ("50%" in text) is (answer is FAST) and ("died" in text) is bool(missing)
    assert made.save(tmp_path / "kept").is_file()


def test_published_speeds_are_there_for_scale():
    from fluidbench.measure.reference import table

    found = table(PUBLISHED)
    assert isinstance(found, pd.DataFrame) and found.mps.max() > 100 and math.isnan(found.mps.min()) is False
