"""What a child leaves, what it cost, and where its kernels are compiled into."""

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
import warp as wp

from fluidbench.errors import Interrupted, Obstacle
from fluidbench.native import device
from fluidbench.runs import child, execute, interpreter, process, provenance
from fluidbench.runs.job import Job
from fluidbench.runs.record import Record, keep, recall
from fluidbench.study.preview import diagnosis

from .made import BEAD

TABLE = BEAD.model_dump(mode="json")


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

    def attend(job, folder, progress, seat):
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


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """A user whose home takes no folder, and whose temporary folder is empty."""
    wp.init()  # by then Warp has its own folder, which these tests leave to it
    for name in (device.CACHE, device.TAICHI_CACHE, "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/dev/null")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(execute, "_told", set())
    monkeypatch.setattr("warp.config.kernel_cache_dir", None)
    device.kernels.cache_clear()
    yield tmp_path / f"fluidbench-kernels-{os.getuid()}"
    device.kernels.cache_clear()


def test_without_a_cache_folder_kernels_go_to_a_temporary_one_and_that_is_said_once(homeless, monkeypatch):
    found = device.kernels()
    assert found.folder == homeless and homeless.stat().st_mode & 0o777 == 0o700
    assert device.CACHE in found.note and "XDG_CACHE_HOME" in found.note and "/dev/null/.cache/warp" in found.note
    given = interpreter.environment()
    assert given[device.CACHE] == str(homeless) and given[device.TAICHI_CACHE] == str(homeless / "taichi")
    said: list[str] = []
    for _ in range(2):
        execute._tell_of_kernels(said.append)
    assert said == [found.note] and f"kernels: {found.note}" in diagnosis()
    for name, value in given.items():  # a child finds it, and has nothing to say
        monkeypatch.setenv(name, value)
    device.kernels.cache_clear()
    assert device.kernels() == device.Kernels(homeless, {})


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", device.CACHE])
def test_a_variable_names_the_folder_of_kernels(homeless, tmp_path, monkeypatch, variable):
    monkeypatch.setenv(variable, str(tmp_path / "mine"))
    found = device.kernels()
    assert found.folder in (tmp_path / "mine", tmp_path / "mine" / "warp") and not found.note
    assert interpreter.environment().get(device.CACHE) == os.environ.get(device.CACHE)
    assert not homeless.exists() and f"kernels: compiled into {found.folder}" in diagnosis()


def test_an_empty_variable_is_none(homeless, tmp_path, monkeypatch):
    """Warp would take it for the current folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    monkeypatch.setenv(device.CACHE, "")
    assert device.kernels() == device.Kernels(
        tmp_path / "mine" / "warp", {device.CACHE: str(tmp_path / "mine" / "warp")}
    )


@pytest.mark.parametrize(("command", "code"), [("list", 0), ("show line_bead", 0), ("run line_bead --quick", 1)])
def test_what_compiles_nothing_needs_no_folder_for_kernels(tmp_path, command, code):
    (tmp_path / f"fluidbench-kernels-{os.getuid()}").write_text("")
    nowhere = {
        device.CACHE: "/dev/null/x",
        "XDG_CACHE_HOME": "/dev/null/y",
        "HOME": "/dev/null",
        "TMPDIR": str(tmp_path),
    }
    words = [sys.executable, "-m", "fluidbench", *command.split(), *(["--out", str(tmp_path / "out")] if code else [])]
    done = subprocess.run(
        words, capture_output=True, text=True, env=os.environ | nowhere, cwd=Path(__file__).parents[2]
    )
    assert done.returncode == code, done.stderr
    assert ("no folder for compiled kernels" in done.stderr) == bool(code)


@pytest.mark.parametrize("trap", ["file", "open to all", "link"])
def test_a_temporary_folder_that_others_can_write_to_takes_no_kernels(homeless, tmp_path, trap):
    (tmp_path / "other").mkdir()
    if trap == "link":
        homeless.symlink_to(tmp_path / "other")
    elif trap == "file":
        homeless.write_text("")
    else:
        homeless.mkdir()
        homeless.chmod(0o777)
    with pytest.raises(Obstacle, match=r"no folder for compiled kernels.*set WARP_CACHE_PATH or XDG_CACHE_HOME"):
        device.kernels()
    assert diagnosis()[-1].startswith("kernels: no folder for compiled kernels")
