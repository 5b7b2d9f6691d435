"""The command line end to end, in processes of their own."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pandas as pd
import pytest

TINY = [
    "--set",
    "spacing=0.003",
    "--set",
    "duration=0.12",
    "--set",
    "output_interval=0.03",
    "--set",
    "toolpath.end=[0.03, 0.0]",
    "--set",
    "domain.upper=[0.06, 0.03, 0.03]",
]


def fluidbench(*arguments, timeout=300):
    return subprocess.run(
        [sys.executable, "-m", "fluidbench", *arguments], capture_output=True, text=True, timeout=timeout, check=False
    )


MISTAKES = [
    (["compare", "line_bead", "--set", "material.densty=1"], "did you mean 'density'"),
    (["compare", "no_such_scenario"], "no scenario named 'no_such_scenario'"),
    (["compare", "line_bead", "--solvers", "mpn"], "did you mean 'mpm'"),
    (["compare", "line_bead", "--set", "numerics.mpm.grid_rato=2"], "did you mean 'grid_ratio'"),
    (["compare", "line_bead", "--device", "cuda:7"], "no device 'cuda:7'"),
    (["compare", "line_bead", "--backend", "warp,taichy"], "did you mean 'taichi'"),
    (["compare", "line_bead", "--backend", "warp,warp"], "names warp twice"),
    (["compare", "line_bead", "--backend", ","], "names no backend"),
    (["run", "line_bead", "--threads", "4000"], "4000 threads are more than this machine's"),
    (["table2", "--pools", "298k"], "--pools takes whole numbers"),
    (["run", "line_bead", "--out", "/proc/nowhere"], "cannot write"),
    (["show", "line_bead", "--set", "material.density=-3"], "material.density"),
    (["validate", "free_fal"], "did you mean 'free_fall'"),
    (["validate", "free_fall", "--levels", "finest"], "no level 'finest'; did you mean 'fine'?"),
    (["validate", "free_fall", "--levels", "foo"], "no level 'foo'; known: coarse, fine, medium, rough"),
]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_mistakes_are_one_line_and_exit_code_2(arguments, words, tmp_path):
    if "--out" not in arguments and arguments[0] == "compare":
        arguments = [*arguments, "--out", str(tmp_path / "out")]
    done = fluidbench(*arguments)
    assert done.returncode == 2
    assert words in done.stderr and "Traceback" not in done.stderr
    assert all(line.startswith("fluidbench: ") for line in done.stderr.splitlines())  # nor a word of Warp's
    assert not (tmp_path / "out").exists()


def test_compare_writes_tables_figures_and_a_self_contained_page(tmp_path):
    done = fluidbench("compare", "line_bead", *TINY, "--out", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    table = pd.read_parquet(tmp_path / "compare.parquet")
    assert list(table["method"]) == ["mpm", "sph", "pbd"] and (table["verdict"] == "completed").all()
    assert (table["bead_width_m"] > 0).all()
    page = (tmp_path / "report.html").read_text()
    assert "Plotly" in page and 'src="http' not in page and "data:image/png;base64" in page
    for name in ("views", "cross_section", "width", "cost"):
        assert (tmp_path / f"{name}.png").stat().st_size > 5000
    before = {p: p.stat().st_mtime for p in tmp_path.glob("runs/*/record.json")}
    assert (table["machine_runs_at_a_time"] == "1").all() and "runs at a time" not in done.stdout
    again = fluidbench("compare", "line_bead", *TINY, "--out", str(tmp_path))
    assert again.returncode == 0
    assert before == {p: p.stat().st_mtime for p in tmp_path.glob("runs/*/record.json")}


def test_methods_side_by_side_give_the_same_and_say_so(tmp_path):
    given = ["compare", "line_bead", *TINY, "--solvers", "mpm,pbd"]
    alone = fluidbench(*given, "--out", str(tmp_path / "0"))
    beside = fluidbench(*given, "--jobs", "2", "--out", str(tmp_path / "2"))
    assert alone.returncode == beside.returncode == 0, beside.stdout + beside.stderr
    tables = [pd.read_parquet(tmp_path / name / "compare.parquet") for name in ("0", "2")]
    assert [list(t["machine_runs_at_a_time"]) for t in tables] == [["1", "1"], ["2", "2"]]
    assert list(tables[0]["bead_width_m"]) == list(tables[1]["bead_width_m"])
    assert "runs at a time" in beside.stdout and "beside others" in (tmp_path / "2" / "report.html").read_text()


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="Taichi has no wheels for Python 3.14")
def test_two_backends_are_two_rows_with_cost_ratio_and_the_same_lengths(tmp_path):
    arguments = [*TINY, "--solvers", "mpm,pbd", "--backend", "warp,taichi", "--threads", "2", "--out", str(tmp_path)]
    done = fluidbench("compare", "line_bead", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Backends" in done.stdout and "second / first" in done.stdout
    table = pd.read_parquet(tmp_path / "compare.parquet")
    assert list(zip(table["method"], table["backend"], table["threads"], strict=True)) == [
        ("mpm", "warp", 2),
        ("mpm", "taichi", 2),
        ("pbd", "warp", 2),
        ("pbd", "taichi", 2),
    ]
    assert (table["verdict"] == "completed").all() and table["machine_arch"].notna().all()
    assert table["machine_backend_version"].nunique() == 2
    for method in ("mpm", "pbd"):
        width = table.loc[table["method"] == method, "bead_width_m"]
        assert abs(width.iloc[1] - width.iloc[0]) < table["resolution_m"].iloc[0]


def test_measurements_stand_beside_runs_that_do_not_depend_on_them(tmp_path):
    row = "quantity, place, value, uncertainty\nwidth, , 16 mm, 1 mm\nwidth, {}, 16 mm, 1 mm\n"
    (tmp_path / "m.csv").write_text(row.format("15 mm"))
    (tmp_path / "far.csv").write_text(row.format("45 mm"))
    arguments = ["compare", "line_bead", *TINY, "--solvers", "mpm", "--out", str(tmp_path / "out")]
    far = fluidbench(*arguments, "--measured", str(tmp_path / "far.csv"))
    assert far.returncode == 2 and "far.csv, line 3: place: beads are measured from 0 to 30 mm" in far.stderr
    assert not (tmp_path / "out").exists()  # refused before anything runs
    plain = fluidbench(*arguments)
    told = fluidbench(*arguments, "--measured", str(tmp_path / "m.csv"))
    assert plain.returncode == told.returncode == 0, told.stdout + told.stderr
    assert "Against measurements" not in plain.stdout and "reused" in told.stderr
    rows = [line for line in told.stdout.splitlines() if "16 ± 1" in line]
    assert len(rows) == 2 and all(" u)" in line for line in rows)
    assert (tmp_path / "out" / "measured.png").exists()


def test_resume_after_a_kill(tmp_path):
    """kill -9 in the middle of a run: the finished run is kept, the half-finished one is run again."""
    command = [sys.executable, "-m", "fluidbench", "compare", "line_bead", *TINY, "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.time() + 200
    while time.time() < deadline and not list(tmp_path.glob("runs/line_bead-mpm-*/record.json")):
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    (first,) = tmp_path.glob("runs/line_bead-mpm-*/record.json")
    stamp = first.stat().st_mtime
    assert not list(tmp_path.glob("runs/line_bead-pbd-*/record.json"))
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    assert first.stat().st_mtime == stamp
    assert len(list(tmp_path.glob("runs/*/record.json"))) == 3


def test_a_run_that_cannot_make_it_is_a_timeout_not_a_result(tmp_path):
    done = fluidbench(
        "run",
        "line_bead",
        *TINY,
        "--set",
        "material.viscosity=1e4",
        "--set",
        "numerics.mpm.viscosity=explicit",
        "--wall-limit",
        "3",
        "--out",
        str(tmp_path),
    )
    (record,) = tmp_path.glob("runs/*/record.json")
    record = json.loads(record.read_text())
    assert done.returncode == 1 and record["verdict"] == "timeout" and record["measures"] == {}
    assert "wall-limit" in done.stdout


def test_list_show_and_doctor_answer():
    assert "line_bead" in fluidbench("list").stdout and "mpm" in fluidbench("list").stdout
    shown = fluidbench("show", "dam_break").stdout
    assert "wave speed" in shown and "acoustic" in shown and "substeps" in shown
    told = fluidbench("doctor")
    assert "warp-lang" in told.stdout and told.stderr == ""


def test_the_version_is_told():
    done = fluidbench("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"fluidbench {version('fluidbench')}\n", "")


def test_what_a_terminal_cannot_show_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = fluidbench("run", "line_bead", *TINY, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "bead area [mm?]" in done.stdout and done.stdout.isascii() and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        ("show line_bead >&-", 0, ""),
        ("show line_bead >/dev/full", 1, "fluidbench: cannot print to standard output: No space left on device\n"),
        (">/dev/full", 1, "fluidbench: cannot print to standard output: No space left on device\n"),
        ("init /proc/x.toml --defaults", 1, "fluidbench: cannot write /proc/x.toml: No such file or directory\n"),
        ("run nope >&- 2>&-", 2, ""),
        ("list >/dev/full 2>&1", 1, ""),
        ("init x.toml <&- >&-", 2, "fluidbench: question 1 was not answered; --defaults asks none\n"),
    ],
)
def test_what_is_closed_full_or_read_only_is_one_line_that_promises_nothing(words, code, says, tmp_path):
    command = f"{shlex.quote(sys.executable)} -m fluidbench {words}"
    env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(command, shell=True, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, says)


def test_validate_writes_its_table_and_page_and_resumes(tmp_path):
    command = ["validate", "constitutive_driver", "elliptic_drop", "--solvers", "mpm", "--out", str(tmp_path)]
    done = fluidbench(*command)
    assert done.returncode == 0, done.stdout + done.stderr
    table = pd.read_parquet(tmp_path / "validate.parquet")
    assert list(table["case"]) == ["constitutive_driver", "elliptic_drop"]
    assert (table["verdict"] == "pass").all() and (table["error"] > 0).all()
    rows = json.loads((tmp_path / "validate.json").read_text())["rows"]
    assert json.loads(rows[0]["numbers"]) and (tmp_path / json.loads(rows[1]["runs"])["drop"] / "record.json").is_file()
    assert "| elliptic_drop | liquid | mpm |" in " ".join((tmp_path / "validate.md").read_text().split())
    page = (tmp_path / "report.html").read_text()
    assert "Known answers" in page and 'src="http' not in page
    records = {p: p.stat().st_mtime for p in tmp_path.glob("runs/*/record.json")}
    assert fluidbench(*command).returncode == 0
    assert records == {p: p.stat().st_mtime for p in tmp_path.glob("runs/*/record.json")}
