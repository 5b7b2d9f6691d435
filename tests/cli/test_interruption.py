"""Runs that are killed, interrupted or shared: nothing is lost, nothing is done twice, and the reason is told."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from .test_cli import TINY, fluidbench

EVERY = ["--checkpoint-every", "0.05"]
LONGER = [*TINY, "--set", "duration=0.48"]  # or a run is over before it can be killed
FOAM = [
    "--set",
    "spacing=0.003",
    "--set",
    "duration=0.3",
    "--set",
    "output_interval=0.03",
    "--set",
    "toolpath.end=[0.03, 0.0]",
    "--set",
    "domain.upper=[0.06, 0.03, 0.06]",
    "--set",
    "pool=4000",
    "--set",
    'material.expansion={kind="growth", ratio=3.0, time=0.2, delay=0.05, jitter=0.02}',
    "--set",
    'material.cure={kind="linear", time=0.2, delay=0.1, youngs_modulus=1e4, yield_stress=300.0}',
]


def start(*arguments):
    """A process group of its own, so that a kill reaches the child of the run too, as that of a batch system does."""
    return subprocess.Popen(
        [sys.executable, "-m", "fluidbench", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def final(root):
    (path,) = root.glob("runs/*/final.npz")
    with np.load(path) as data:
        return {key: data[key] for key in data.files}


def same(a, b):
    return a.keys() == b.keys() and all(np.array_equal(a[key], b[key]) for key in a)


def killed(command, out, rng, times):
    """Kill a run -9 at random moments after its first checkpoint, then let it end; how often it went on from one."""
    for _ in range(times):
        process = start(*command, "--out", str(out))
        deadline = time.monotonic() + 120
        while process.poll() is None and time.monotonic() < deadline and not list(out.glob("runs/*/checkpoint.npz")):
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.3))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    done = fluidbench(*command, "--out", str(out))
    assert done.returncode == 0, done.stdout + done.stderr
    (record,) = out.glob("runs/*/record.json")
    assert not list(out.glob("runs/*/checkpoint.npz")) and not list(out.glob("runs/*/*.part"))
    return json.loads(record.read_text())["resumed"]


@pytest.mark.parametrize(
    ("solver", "settings", "backend"),
    [("mpm", FOAM, "warp"), ("sph", LONGER, "warp"), ("pbd", FOAM, "warp"), ("sph", LONGER, "taichi")],
)
def test_a_killed_run_goes_on_bit_for_bit(solver, settings, backend, tmp_path):
    if backend == "taichi":
        pytest.importorskip("taichi")
    command = ["run", "line_bead", *settings, "--solver", solver, "--backend", backend]
    assert fluidbench(*command, "--checkpoint-every", "0", "--out", str(tmp_path / "whole")).returncode == 0
    resumed = killed([*command, *EVERY], tmp_path / "killed", random.Random(1), 2)
    assert same(final(tmp_path / "whole"), final(tmp_path / "killed"))
    assert resumed >= 1
    (a,), (b,) = (list((tmp_path / name).glob("runs/*/series.parquet")) for name in ("whole", "killed"))
    pd.testing.assert_frame_equal(pd.read_parquet(a), pd.read_parquet(b))


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["mpm", "sph", "pbd"])
def test_twenty_kills(solver, tmp_path):
    command = ["run", "line_bead", "--spacing", "0.002", "--solver", solver]
    assert fluidbench(*command, "--checkpoint-every", "0", "--out", str(tmp_path / "whole")).returncode == 0
    killed([*command, *EVERY], tmp_path / "killed", random.Random(2), 20)
    assert same(final(tmp_path / "whole"), final(tmp_path / "killed"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_an_interruption_says_what_is_finished_and_the_same_command_resumes(number, tmp_path):
    command = ["compare", "line_bead", *TINY, "--out", str(tmp_path)]
    process = start(*command)
    deadline = time.monotonic() + 120
    while len(list(tmp_path.glob("runs/*/job.json"))) < 2 and time.monotonic() < deadline:  # the second has begun
        time.sleep(0.02)
    os.kill(process.pid, number)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in errors
    (line,) = [line for line in errors.splitlines() if "interrupted" in line]
    assert "1 of 3 runs are finished" in line and "resumes" in line
    (first,) = tmp_path.glob("runs/line_bead-mpm-*/record.json")
    stamp = first.stat().st_mtime_ns
    assert fluidbench(*command).returncode == 0 and first.stat().st_mtime_ns == stamp


def test_a_child_that_is_killed_is_called_what_it_was(tmp_path):
    process = start("run", "line_bead", *TINY, "--set", "duration=3.0", "--solver", "sph", "--out", str(tmp_path))
    deadline, child = time.monotonic() + 60, ""
    while not child and time.monotonic() < deadline:
        found = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=False).stdout
        child = found.split()[0] if found.split() and list(tmp_path.glob("runs/*/job.json")) else ""
        time.sleep(0.05)
    time.sleep(0.5)
    os.kill(int(child), signal.SIGKILL)
    out, _ = process.communicate(timeout=60)
    (path,) = tmp_path.glob("runs/*/record.json")
    record = json.loads(path.read_text())
    assert process.returncode == 1 and record["verdict"] == "error" and "SIGKILL" in record["reason"]
    assert "wall-limit" not in out and "SIGKILL" in out


def test_film_drawers_end_with_their_run_however_it_ends(tmp_path):
    command = ["run", "line_bead", *TINY, "--set", "duration=3.0", "--solver", "pbd", "--render-every", "0.01"]
    process = start(*command, "--out", str(tmp_path))
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("runs/*/film/*.png")) and time.monotonic() < deadline:
        time.sleep(0.05)
    found = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=False).stdout
    child = int(found.split()[0])
    drawers = subprocess.run(["pgrep", "-P", str(child)], capture_output=True, text=True, check=False).stdout.split()
    assert drawers
    os.kill(child, signal.SIGKILL)
    process.communicate(timeout=60)
    deadline = time.monotonic() + 10
    while any(os.path.exists(f"/proc/{pid}") for pid in drawers) and time.monotonic() < deadline:  # noqa: PTH110
        time.sleep(0.05)
    assert not [pid for pid in drawers if os.path.exists(f"/proc/{pid}")]  # noqa: PTH110


def test_two_studies_in_one_folder_make_each_run_once(tmp_path):
    command = ["compare", "line_bead", *TINY, "--solvers", "mpm,pbd", "--out", str(tmp_path)]
    both = [start(*command), start(*command)]
    ends = [process.communicate(timeout=200) for process in both]
    assert [process.returncode for process in both] == [0, 0], ends
    reused = sum(err.count("(20") for _, err in ends)  # one a run, with the time at which it was made
    assert reused == 2 and len(list(tmp_path.glob("runs/*/record.json"))) == 2


def test_a_run_leaves_the_tables_of_a_comparison_alone(tmp_path):
    command = ["compare", "line_bead", *TINY, "--solvers", "mpm,pbd", "--out", str(tmp_path)]
    assert fluidbench(*command).returncode == 0
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()}
    assert fluidbench("run", "line_bead", *TINY, "--solver", "pbd", "--out", str(tmp_path)).returncode == 0
    assert before == {name: (tmp_path / name).read_bytes() for name in before}
    assert len(pd.read_parquet(tmp_path / "compare.parquet")) == 2
    assert len(pd.read_parquet(tmp_path / "run-pbd.parquet")) == 1


def test_a_child_runs_with_no_standard_input_and_in_any_folder(tmp_path):
    """As a batch system starts it; and whatever the user's folder holds."""
    for name in ("profile", "types", "random", "warp", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('a file of the user')\n")
    done = subprocess.run(
        [sys.executable, "-P", "-m", "fluidbench", "run", "line_bead", *TINY, "--out", "out"],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (folder,) = (tmp_path / "out" / "runs").iterdir()
    (folder / "record.json").unlink()
    alone = [sys.executable, "-P", "-m", "fluidbench.runs.process", str(folder)]
    done = subprocess.run(alone, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and json.loads((folder / "record.json").read_text())["verdict"] == "completed"
