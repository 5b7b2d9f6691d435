"""What a child leaves, what it cost, what a run needs and what it was made by."""

import hashlib
import math
import os
import sys
import threading
import types
from pathlib import Path
from types import SimpleNamespace

import pytest

from fluidbench.errors import Interrupted, Obstacle, UserError
from fluidbench.method.target import HERE, Target
from fluidbench.native.simulation import Simulation
from fluidbench.registry import get_method
from fluidbench.runs import child, needs, process, provenance
from fluidbench.runs import interpreter as offspring
from fluidbench.runs.job import Job
from fluidbench.runs.record import Record, keep, recall

from ..conftest import scenario
from ..contract.ballistic import Ballistic
from .made import BEAD

TABLE = BEAD.model_dump(mode="json")


# --- what a child leaves


def job_in(folder, **more):
    folder.mkdir(exist_ok=True)
    return Job(TABLE, "mpm", **more)


@pytest.mark.parametrize(
    ("code", "timed", "starved", "log", "words"),
    [
        (1, True, False, "x", "its process was stopped 120 s after the wall limit of 9 s; raise --wall-limit"),
        (-9, False, True, "", "its process was killed (SIGKILL): the system ran out of memory"),
        (-9, False, False, "", "its process was killed (SIGKILL): by somebody, or by the system for its memory"),
        (
            -11,
            False,
            False,
            "",
            "its process was killed (SIGSEGV): it touched memory that is not its own: please report it",
        ),
        (-99, False, False, "", "its process was killed (signal 99)"),
        (3, False, False, "a\nb\n", "its process ended with code 3: b"),
        (3, False, False, "", "its process ended with code 3: no message"),
        (0, False, False, "a", "its process left no whole record: a"),
    ],
)
def test_a_post_mortem_says_why(tmp_path, monkeypatch, code, timed, starved, log, words):
    (tmp_path / "log.txt").write_text(log)
    job = Job(TABLE, "mpm", wall_limit=9.0)
    monkeypatch.setattr(process, "_oom_kills", lambda: 3)
    reason = process._cause(job, tmp_path, code, timed, 2 if starved else 3)
    record = job.bury(tmp_path, timed, reason)
    assert record.reason == reason == words and record.verdict == ("timeout" if timed else "error")
    assert recall(tmp_path) == (record, "") and record.key == job.key and record.cost is None


def test_killings_for_want_of_memory_are_counted(tmp_path, monkeypatch):
    (tmp_path / "events").write_text("low 0\noom_kill 3\n")
    monkeypatch.setattr(process, "OOM_COUNTERS", (tmp_path / "none", tmp_path / "events"))
    assert process._oom_kills() == 3
    (tmp_path / "events").write_text("low 0\n")
    assert process._oom_kills() == 0
    monkeypatch.setattr(process, "OOM_COUNTERS", ())
    assert process._oom_kills() == 0


def launched(tmp_path, monkeypatch, script, **more):
    """Launch a child of Python that is given the folder and runs this script."""
    monkeypatch.setattr(
        process, "command", lambda module, folder, flag, python: [sys.executable, "-c", script, folder, flag]
    )
    job, told = Job(TABLE, "mpm", **more), []
    return job, told, lambda: process.launch(job, tmp_path / "run", told.append)


def test_a_child_reports_progress_and_leaves_its_record(tmp_path, monkeypatch):
    script = (
        f"import sys, json; sys.path.insert(0, {str(Path(process.__file__).parents[2])!r})\n"
        "from fluidbench.runs.job import Job; from fluidbench.runs.record import Record, keep\n"
        "from fluidbench.runs.provenance import machine; from fluidbench.method.target import Target\n"
        "from pathlib import Path; folder = Path(sys.argv[1]); table = json.loads((folder / 'job.json').read_text())\n"
        "job = Job(**{k: v for k, v in table.items() if k != 'kind'} | {'target': Target(**table['target'])})\n"
        "assert table['kind'] == 'Job'\n"
        "print('@progress {\"time\": 0.5}'); print('hello'); assert sys.argv[2] == '--attended'\n"
        "keep(folder, Record(**job.heading(), verdict='completed', machine=machine(job.target)))"
    )
    (tmp_path / "run").mkdir()
    for name in ("record.json", "series.parquet", "final.npz", "log.txt"):
        (tmp_path / "run" / name).write_text("of an earlier run")
    _, told, launch = launched(tmp_path, monkeypatch, script, repeat=4)
    record = launch()
    assert (record.verdict, record.repeat) == ("completed", 4) and told == [{"time": 0.5}]
    assert (tmp_path / "run" / "log.txt").read_text() == "hello\n"
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["job.json", "log.txt", "record.json"]
    _, _, launch = launched(tmp_path, monkeypatch, script + "; sys.exit(3)")
    assert launch().reason.startswith("its process ended with code 3")


@pytest.mark.parametrize("verdict", ["timeout", "diverged", "out_of_capacity", "refused"])
def test_what_a_child_says_of_its_run_is_what_became_of_it(tmp_path, monkeypatch, verdict):
    """Whether another call would reuse it is another question: a run that stopped itself in time is no error."""
    job, _, launch = launched(tmp_path, monkeypatch, "pass")
    left = Record(**job.heading(), verdict=verdict, reason="as it said", machine=provenance.machine(job.target))

    def attend(job, folder, progress, gpu):
        (folder / "log.txt").write_text("a warning")
        keep(folder, left)
        return 0, False, ""

    monkeypatch.setattr(process, "_attend", attend)
    made = launch()
    assert (made.verdict, made.reason) == (verdict, "as it said")


def test_a_child_that_meets_an_obstacle_or_takes_too_long(tmp_path, monkeypatch):
    *_, launch = launched(tmp_path, monkeypatch, "print('@obstacle the disk is full ')")
    with pytest.raises(Obstacle, match=r"^the disk is full$"):
        launch()
    monkeypatch.setattr(process, "GRACE", 0.1)
    *_, launch = launched(tmp_path, monkeypatch, "import time; time.sleep(60)", wall_limit=0.1)
    assert launch().verdict == "timeout"


def test_an_interruption_while_the_wall_limit_is_set_leaves_no_child_and_no_clock(tmp_path, monkeypatch):
    """As by a signal that comes while a thread starts: its clock kept the command alive for half an hour."""
    started = []

    def start(timer, begin=threading.Timer.start):
        begin(timer)
        started.append((timer, *process._children))
        raise Interrupted

    monkeypatch.setattr(threading.Timer, "start", start)
    *_, launch = launched(tmp_path, monkeypatch, "import time; time.sleep(60)", wall_limit=600.0)
    with pytest.raises(Interrupted):
        launch()
    ((timer, child),) = started
    timer.join(10.0)
    assert not timer.is_alive() and child.returncode is not None and not process._children


def pictured(device=None, **outcome):
    """Cost of a run that took 4 s for 2 s in 10 substeps."""
    usual = {
        "time": 1.9,  # of the verdict, which came later than what it is of
        "simulated": 2.0,
        "wall": 4.0,
        "cpu": 5.0,
        "prepare_wall": 0.5,
        "substeps": 10,
        "particle_substeps": 600,
        "peak_particles": 70,
    }
    made = SimpleNamespace(footprint=lambda: {"a": 300, "b": 340}, capacity=64, peak_device_bytes=lambda: device)
    return child.cost(SimpleNamespace(**usual | outcome), made, 9.0)


def test_cost_is_of_the_loop_alone(monkeypatch):
    monkeypatch.setattr(child, "peak_memory", lambda: 3.0 * 2**20)
    assert pictured().model_dump(exclude_none=True) == {
        "simulated_s": 2.0,
        "wall_s": 4.0,
        "cpu_s": 5.0,
        "prepare_s": 0.5,
        "total_s": 9.0,
        "substeps": 10,
        "mean_dt_s": 0.2,
        "steps_per_s": 2.5,
        "particle_substeps_per_s": 150.0,
        "particle_substeps_per_cpu_s": 120.0,
        "wall_per_simulated_s": 2.0,
        "simulated_to_real": 0.5,
        "peak_particles": 70,
        "bytes_per_particle": 10.0,
        "peak_memory_MiB": 3.0,
    }
    assert pictured(device=5 * 2**20) == pictured().model_copy(update={"peak_device_MiB": 5.0})
    nothing = pictured(simulated=0.0, wall=0.0, cpu=0.0, substeps=0, particle_substeps=0)
    assert nothing.mean_dt_s == nothing.steps_per_s == nothing.simulated_to_real == 0.0
    assert nothing.wall_per_simulated_s == pytest.approx(1e3) and nothing.wall_s == 0.0  # a billionth of a second


def test_peak_memory_is_in_bytes(monkeypatch):
    import resource

    monkeypatch.setattr(resource, "getrusage", lambda who: SimpleNamespace(ru_maxrss=5))
    monkeypatch.setattr(sys, "platform", "linux")
    assert child.peak_memory() == 5 * 1024.0
    monkeypatch.setattr(sys, "platform", "darwin")
    assert child.peak_memory() == 5.0


# --- what a run needs, and what made it


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
    """10 cells of 0.02 m and 20 of 0.01 m along 0.2 m, and nodes behind the walls: 6 and 8 blocks; 1128 along 90 m."""
    mpm, s = get_method("mpm"), scenario()
    for ratio, edge in ((2.0, 6), (1.0, 8)):
        assert mpm.refuses(s, mpm.Config(grid_ratio=ratio)) is None
        assert mpm.memory(s, mpm.Config(grid_ratio=ratio), 100) == 100 * mpm.typical_bytes + 4 * edge**3
        implicit = mpm.Config(grid_ratio=ratio, viscosity="implicit")  # half a block of 64 nodes of 5 vec4 a particle
        assert mpm.memory(s, implicit, 100) == 100 * (mpm.typical_bytes + 0.5 * 64 * 5 * 16) + 4 * edge**3
        assert Simulation(s, mpm, config=mpm.Config(grid_ratio=ratio)).solver.table.size == edge**3
    vast = scenario(domain={"lower": [0.0] * 3, "upper": [90.0] * 3})
    assert mpm.refuses(vast, mpm.Config()) == (
        "the domain holds 1.44e+09 grid blocks; use a smaller domain or a larger spacing"
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
    assert seen["OPENBLAS_NUM_THREADS"] == "1"
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
