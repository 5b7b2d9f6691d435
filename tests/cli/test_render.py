"""Towers from the command line: success criteria, pictures taken beside the run, pictures and films afterwards."""

import json

import imageio.v2 as imageio
import numpy as np
import pytest

from .test_cli import fluidbench


@pytest.fixture(scope="module")
def tower(tmp_path_factory):
    """A small growing, curing tower of two rings."""
    out = tmp_path_factory.mktemp("tower")
    done = fluidbench(
        "run",
        "ring_tower_expansion_curing",
        "--quick",
        "--set",
        "duration=2.4",
        "--set",
        "toolpath.radius=0.05",
        "--set",
        "toolpath.pause=0.2",
        "--set",
        "output_interval=0.4",
        "--frames",
        "--render-every",
        "0.8",
        "--out",
        str(out),
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done, next((out / "runs").iterdir())


def test_each_criterion_of_success_is_listed_alone(tower):
    done, folder = tower
    assert "Success, each criterion alone" in done.stdout
    record = json.loads((folder / "record.json").read_text())
    names = [c["name"] for c in record["success"]]
    assert names[0] == "layers laid" and record["success"][0]["met"] and "worst radius error" in names
    assert record["measures"]["volume_growth"] > 5.0
    assert record["launches"]["per_substep"] > 4 and any(key.startswith("curing") for key in record["bytes"])


def test_pictures_are_taken_beside_the_run(tower):
    _, folder = tower
    pictures = sorted((folder / "film").glob("*.png"))
    assert len(pictures) == 4 and not list((folder / "film").glob("*.npz"))


def test_a_run_is_rendered_filmed_and_exported(tower):
    _, folder = tower
    done = fluidbench("render", str(folder), "--no-turntable", "--film", "--export", "--colour", "stress")
    assert done.returncode == 0, done.stdout + done.stderr
    image = np.asarray(imageio.imread(folder / "render.png"))
    assert image.shape[:2] == (960, 1280) and image.std() > 5
    assert imageio.get_reader(folder / "film.mp4").count_frames() == 2.4 * 20 + 1  # in real time
    assert (folder / "paraview" / "series.pvd").read_text().count("<DataSet") >= 5


def test_rendering_nothing_says_what_is_missing(tmp_path):
    done = fluidbench("render", str(tmp_path))
    assert done.returncode == 2 and "no run here" in done.stderr and "Traceback" not in done.stderr
