"""Runs that happen elsewhere: in workers of dask, in jobs of submitit; the answers are those of this machine."""

import pytest

import fluidbench as fb
from fluidbench.errors import UserError
from fluidbench.runs.cluster import executor_of

CASES = ["free_fall", "emission_mass_rate"]


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    return answers(tmp_path_factory.mktemp("here"))


def answers(out, **more):
    found = fb.validate(CASES, ["mpm"], quick=True, out=out, progress=False, **more)
    assert found.ok and not found.missing and len(found.runs) == 3
    return found.table[["case", "method", "error", "verdict"]].to_dict("records")


def test_a_dask_client_is_an_executor(tmp_path, here):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert answers(tmp_path, executor=client) == here
        again = fb.validate(CASES, ["mpm"], quick=True, out=tmp_path, progress=False, executor=client)
    assert all(run.reused for run in again.runs)


def test_submitits_jobs_are_an_executor(tmp_path, here):
    pytest.importorskip("submitit")
    assert answers(tmp_path, executor="local:timeout_min=5") == here


def test_what_is_no_executor_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"the interface of concurrent\.futures; got int"):
        fb.validate(CASES, ["mpm"], quick=True, out=tmp_path, executor=3)
    with pytest.raises(UserError, match="no 'slrum'; did you mean 'slurm'"):
        fb.validate(CASES, ["mpm"], quick=True, out=tmp_path / "out", executor="slrum")
    for wrong in ("local:fast", "local:no_such_key=1", "here:x=1"):
        with pytest.raises(UserError, match="--executor"):
            fb.validate(CASES, ["mpm"], quick=True, out=tmp_path / "out", executor=wrong)
    assert not (tmp_path / "out").exists() and executor_of("here", tmp_path) is None
