"""The programs in benchmarks/ run, small: nothing else in the suite does."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
SMALL = {
    "mpm_block": ["--particles", "1000", "--steps", "2", "--warmup", "1"],
    "sph_dam": ["--particles", "1000", "--simulated", "0.005", "--support", "3"],
}


def ran(name: str, *arguments: str) -> str:
    command = [sys.executable, str(BENCHMARKS / f"{name}.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=600).stdout


@pytest.mark.parametrize("name", SMALL)
def test_one_that_counts_particle_steps_tells_of_a_sound_run(name):
    row = json.loads(ran(name, *SMALL[name]).splitlines()[-1])
    assert row["benchmark"] == name and row["particles"] > 500
    assert row.get("complaint") is None and row.get("verdict", "completed") == "completed"
    assert row[next(key for key in row if key.startswith("particle_") and key.endswith("per_s"))] > 0


@pytest.mark.parametrize("name", ["backends", "extremes"])
def test_those_that_take_long_can_be_started(name):
    """Arguments are read before anything is run, after all is imported."""
    assert "usage" in ran(name, "--help")
