"""The studies from the command line: they answer, write data and a page, and resume; the page opens in a browser."""

import json
import shutil
import subprocess

import pandas as pd
import pytest

from .test_cli import fluidbench

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def stability(tmp_path_factory):
    """A small stability study, run twice."""
    out = tmp_path_factory.mktemp("stability")
    command = ["stability", "--quick", "--axis", "density", "--solvers", "mpm", "--out", str(out)]
    first, second = fluidbench(*command), fluidbench(*command)
    return out, first, second


def test_stability_measures_holds_and_resumes(stability):
    out, first, second = stability
    assert first.returncode == 0, first.stdout + first.stderr
    assert "3 points tried, 3 held, 0 refused, 0 failed" in " ".join(first.stdout.split())
    rows = pd.read_parquet(out / "stability.parquet")
    points = rows[rows["axis"] == "density"]
    assert (points["dt_own_s"] < points["dt_lump_s"]).all() and (points["dt_own_s"] < points["dt_block_s"]).all()
    assert json.loads((out / "stability.json").read_text())["findings"]
    stamps = {p: p.stat().st_mtime for p in out.glob("runs/*/result.json")}
    assert second.returncode == 0 and len(stamps) == 6
    assert second.stdout == first.stdout


@pytest.mark.parametrize(
    ("command", "names"),
    [
        (["table1", "foam_tower", "--seed", "5"], "scenario, --seed"),
        (["table2", "--variants", "plain"], "--variants"),
        (["guide", "--quick", "--tolerance", "5%"], "--quick"),
    ],
)
def test_what_runs_nothing_refuses_what_would_have_no_effect(tmp_path, command, names):
    done = fluidbench(*command, "--from", str(tmp_path))
    assert done.returncode == 2 and f"--from runs nothing, and goes without {names}" in done.stderr


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")
def test_the_page_opens_without_a_network_or_an_error(stability, tmp_path):
    out, *_ = stability
    shot = tmp_path / "page.png"
    assert CHROMIUM is not None
    seen = subprocess.run(
        [
            CHROMIUM,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--enable-logging=stderr",
            "--v=0",
            "--virtual-time-budget=8000",
            "--host-resolver-rules=MAP * ~NOTFOUND",
            f"--screenshot={shot}",
            "--dump-dom",
            (out / "report.html").as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "CONSOLE" not in seen.stderr, seen.stderr
    assert seen.stdout.count('class="main-svg"') >= 1 and "Findings" in seen.stdout


def test_ablate_and_select_refuse_nonsense(tmp_path):
    for command in (
        ["select", "line_bead", "--budget", "soon"],
        ["ablate", "line_bead", "--tolerance", "much"],
        ["stability", "--axis", "viscocity"],
        ["table1", "--device", "cuda:9"],
    ):
        done = fluidbench(*command, "--out", str(tmp_path / "never"))
        assert done.returncode == 2 and "fluidbench: " in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "never").exists()


@pytest.mark.slow
def test_ablate_ends_with_a_confirmed_mix(tmp_path):
    done = fluidbench("ablate", "line_bead", "--solvers", "mpm", "--spacing", "2e-3", "--out", str(tmp_path))
    assert done.returncode == 0 and "leanest within 5%" in done.stdout


@pytest.mark.slow
def test_select_recommends_with_evidence(tmp_path):
    done = fluidbench("select", "line_bead", "--solvers", "mpm", "--tolerance", "10%", "--out", str(tmp_path))
    assert done.returncode == 0 and "Recommended: mpm" in done.stdout and "How sure" in done.stdout


def test_worlds_of_a_sweep_come_to_what_single_runs_do(tmp_path):
    import pandas as pd

    grid = ["--over", "material.yield_stress=20,200", "--spacing", "4mm", "--solvers", "mpm"]
    tables = {}
    for name, more in (("together", ["--worlds", "2"]), ("alone", [])):
        done = fluidbench("sweep", "line_bead", *grid, *more, "--out", str(tmp_path / name))
        assert done.returncode == 0, done.stderr
        assert "2 points, 2 runs: 2 completed." in done.stdout
        tables[name] = pd.read_parquet(tmp_path / name / "sweep.parquet")
    for key in ("bead_width_m", "bead_height_m"):
        assert tables["together"][key].tolist() == tables["alone"][key].tolist()
    again = fluidbench("sweep", "line_bead", *grid, "--out", str(tmp_path / "alone"))
    assert again.returncode == 0 and (tmp_path / "alone" / "report.html").exists()
