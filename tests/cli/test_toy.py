"""A fourth method, registered by a package of somebody's: every verb takes it as it takes ours."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[2]
SMALL = ["--spacing", "0.004", "--set", "duration=0.3"]


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A folder with an installed package `toy` that registers the method `ballistic`."""
    folder = tmp_path_factory.mktemp("toy")
    shutil.copy(ROOT / "tests" / "contract" / "ballistic.py", folder / "toy.py")
    info = folder / "toy-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text("[fluidbench.solvers]\nballistic = toy:Ballistic\n")
    return folder


def fluidbench(package, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "fluidbench", *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(package), str(ROOT)])},
    )


@pytest.mark.parametrize(
    ("verb", "arguments"),
    [
        ("compare", ["line_bead", *SMALL, "--solvers", "mpm,ballistic"]),
        ("run", ["line_bead", *SMALL, "--solver", "ballistic"]),
        ("validate", ["free_fall", "--solvers", "ballistic"]),
        ("stability", ["--quick", "--axis", "viscosity", "--solvers", "ballistic"]),
        ("ablate", ["line_bead", *SMALL, "--solvers", "ballistic"]),
        ("select", ["line_bead", *SMALL, "--solvers", "ballistic"]),
        ("table2", ["--quick", "--solvers", "ballistic", "--pools", "fit", "--repeats", "1"]),
    ],
)
def test_every_verb_takes_a_method_of_others(package, tmp_path, verb, arguments):
    done = fluidbench(package, verb, *arguments, "--out", str(tmp_path))
    assert "Traceback" not in done.stderr and done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (path,) = (p for p in tmp_path.glob("*.parquet") if p.with_suffix(".csv").is_file())
    assert "ballistic" in set(pd.read_parquet(path)["method"])


def test_it_is_listed_and_shown(package):
    assert "ballistic" in fluidbench(package, "list").stdout
    assert "ballistic" in fluidbench(package, "show", "line_bead").stdout
