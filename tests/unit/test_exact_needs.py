"""What a run needs, and what it was made by."""

import hashlib
import math
import os
import sys
import types
from pathlib import Path
from types import SimpleNamespace

import pytest

from fluidbench.errors import UserError
from fluidbench.method.target import HERE, Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.runs import interpreter as offspring
from fluidbench.runs import needs, provenance

from ..conftest import scenario
from ..contract.ballistic import Ballistic


@pytest.mark.parametrize(("free", "fits"), [(300 * 2**20 + 1000 * 2500, True), (300 * 2**20 + 1000 * 2500 - 1, False)])
def test_a_run_needs_a_process_and_its_particles(monkeypatch, free, fits):
    s = scenario(pool=1000)
    monkeypatch.setattr(needs, "available_memory", lambda target: float(free))
    method = type("Sized", (Ballistic,), {"typical_bytes": 2500.0})
    assert needs.memory_needed(s, method) == 300 * 2**20 + 1000 * 2500
    why = needs.shortage(s, method, HERE)
    assert (why is None) is fits
    if why:
        assert why == (
            "it needs about 0.295 GiB (1000 particles), and this machine has 0.295 GiB left; use a larger spacing or a "
            "smaller pool"
        )


def test_mpm_needs_its_particles_and_an_index_of_every_block():
    """10 cells of 0.02 m and 20 of 0.01 m along 0.2 m, and nodes behind the walls: 4 and 7 blocks; 1127 along 90 m."""
    mpm, s = get_method("mpm"), scenario()
    for ratio, edge in ((2.0, 4), (1.0, 7)):
        assert mpm.refuses(s, mpm.Config(grid_ratio=ratio)) is None
        assert mpm.memory(s, mpm.Config(grid_ratio=ratio), 100) == 100 * mpm.typical_bytes + 4 * edge**3
        implicit = mpm.Config(grid_ratio=ratio, viscosity="implicit")  # half a block of 64 nodes of 5 vec4 a particle
        assert mpm.memory(s, implicit, 100) == 100 * (mpm.typical_bytes + 0.5 * 64 * 5 * 16) + 4 * edge**3
        assert Simulation(s, mpm, config=mpm.Config(grid_ratio=ratio)).solver.table.size == edge**3
    vast = scenario(domain={"lower": [0.0] * 3, "upper": [90.0] * 3})
    assert mpm.refuses(vast, mpm.Config()) == (
        "the domain holds 1.43e+09 grid blocks; use a smaller domain or a larger spacing"
    )


@pytest.mark.parametrize(
    ("limit", "used", "left"), [(9.0, 4.0, 5.0), (90.0, 4.0, 7.0), (None, 4.0, 7.0), (9.0, None, 7.0)]
)
def test_memory_is_what_host_and_control_group_leave(monkeypatch, limit, used, left):
    psutil = types.ModuleType("psutil")
    psutil.virtual_memory = lambda: SimpleNamespace(available=7)
    monkeypatch.setitem(sys.modules, "psutil", psutil)
    monkeypatch.setattr(needs, "_cgroup", {"memory.max": limit, "memory.current": used}.get)
    assert needs.available_memory(HERE) == left


def test_a_target_in_words_and_its_other_backend():
    assert (HERE.suffix, HERE.options) == ("", "") and Target(backend="taichi", threads=3).suffix == " (taichi)"
    assert Target("cuda:0", "taichi").options == " --device cuda:0 --backend taichi"
    assert Target(backend="taichi", threads=3).options == " --backend taichi --threads 3"
    assert Target(threads=4).threads == 4 and Target("cuda:0", "taichi", 4).threads == 1
    assert Target(threads=4).options == " --threads 4"
    assert HERE.other == Target(backend="taichi") and Target(backend="taichi", threads=3).other == HERE
    with pytest.raises(UserError, match="runs on cuda:0 alone"):
        Target("cuda:1", "taichi")
    Target("cuda:1", "warp")


def test_children_find_our_code_before_the_users(monkeypatch, tmp_path):
    own, standard = str(Path(offspring.__file__).parents[2]), os.path.realpath(Path(os.__file__).parent)
    monkeypatch.setattr(
        sys,
        "path",
        [
            "",
            str(tmp_path),
            "/x/site-packages",
            own,
            standard,
            f"{standard}/lib-dynload",
            "/y/python311.zip",
            str(tmp_path),
        ],
    )
    found = offspring.search_path()
    assert found == [standard, f"{standard}/lib-dynload", "/y/python311.zip", own, "/x/site-packages", str(tmp_path)]
    monkeypatch.setenv("PYTHONPATH", "/elsewhere")
    monkeypatch.setenv("KEPT", "1")
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    seen = offspring.environment()
    assert seen["OPENBLAS_NUM_THREADS"] == "1" and seen[offspring.AT_A_TIME] == "1"
    seat = offspring.environment(offspring.Seat("GPU-1", 3))
    assert seat[offspring.AT_A_TIME] == "3" and seat["CUDA_VISIBLE_DEVICES"] == "GPU-1"
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert "OPENBLAS_NUM_THREADS" not in offspring.environment()
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert offspring.environment()["OPENBLAS_NUM_THREADS"] == "3"
    assert "PYTHONPATH" not in seen and seen["PYTHONSAFEPATH"] == "1" and seen["KEPT"] == "1"
    made = offspring.command("a.b", "c", "d")
    assert made[0] == sys.executable and made[1:3] == ["-P", "-c"] and made[-3:] == ["a.b", "c", "d"]
    assert made[-5:-3] == [os.pathsep, os.pathsep.join(found)]


def test_what_a_run_was_made_by():
    found = provenance.hardware(HERE)
    assert list(found) == ["arch", "cores", "processor", "device"] and found["cores"] == str(os.cpu_count())
    assert found["device"] == "CPU" and found["processor"] == provenance.processor() != ""
    about = provenance.machine(Target(backend="taichi"))
    assert about["backend_version"] == provenance.code("mpm", "taichi")["taichi"] and found.items() <= about.items()
    assert math.isfinite(float(about["load"])) and len(provenance.code("mpm", "warp")["sources"]) == 16


def test_processors_and_devices_have_names(tmp_path, monkeypatch):
    listing = tmp_path / "cpuinfo"
    listing.write_text("processor : 0\nmodel name : Fast One\n\nprocessor : 1\nmodel name : Fast Two\n")
    monkeypatch.setattr(provenance, "Path", lambda _: listing)
    assert provenance.processor.__wrapped__() == "Fast One"
    monkeypatch.setattr(provenance.platform, "processor", lambda: "plain")
    listing.write_text("processor : 0\n")
    assert provenance.processor.__wrapped__() == "plain"
    listing.unlink()
    assert provenance.processor.__wrapped__() == "plain"
    monkeypatch.setattr("warp.get_device", {"cuda:0": SimpleNamespace(arch=90, name="GPU")}.get)
    found = provenance.hardware(Target("cuda:0"))
    assert (found["arch"], found["device"]) == ("sm_90", "GPU")


def test_every_source_counts_by_its_place_and_content(tmp_path, monkeypatch):
    for name in ("fluidbench", "other"):
        (tmp_path / name / "cli").mkdir(parents=True)
    (tmp_path / "single.py").write_text("x = 1")

    def spec(name):
        alone = name == "single"
        return SimpleNamespace(
            origin=str(tmp_path / "single.py"), submodule_search_locations=None if alone else [str(tmp_path / name)]
        )

    tables = []
    monkeypatch.setattr(provenance, "find_spec", spec)
    monkeypatch.setattr(provenance, "reference_tables", lambda: tables)
    seen = [provenance._hash_of(("fluidbench", "other", "single"), provenance.IDLE)]

    def changed(path, text):
        (tmp_path / path).write_text(text)
        seen.append(provenance._hash_of(("fluidbench", "other", "single"), provenance.IDLE))
        return len(set(seen)) == len(seen)

    assert changed("fluidbench/a.py", "1") and changed("other/cli/b.py", "2") and changed("single.py", "x = 2")
    assert not changed("fluidbench/cli/c.py", "3")  # no run enters the command line
    seen.pop()
    rooms = [tuple(room for room in provenance.IDLE if room != entered) for entered in ("cli", "paper")]
    entered = [provenance._hash_of(("fluidbench", "other", "single"), idle) for idle in rooms]
    assert entered[0] not in seen and entered[1] == seen[-1]  # unless it is entered
    (tmp_path / "fluidbench" / "a.py").rename(tmp_path / "fluidbench" / "d.py")
    assert provenance._hash_of(("fluidbench", "other", "single"), provenance.IDLE) not in seen
    expected = hashlib.sha256(b"single/single.py\0x = 2\0").hexdigest()[:16]
    assert provenance._hash_of(("single",), provenance.IDLE) == expected
    tables.append(tmp_path / "known.csv")
    tables[0].write_text("1,2")
    expected = hashlib.sha256(b"single/single.py\0x = 2\0known.csv\x001,2\0").hexdigest()[:16]
    assert provenance._hash_of(("single",), provenance.IDLE) == expected  # and what runs are compared with
