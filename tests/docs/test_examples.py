"""The examples: two cases of one's own, from files, through a method."""

from pathlib import Path

import pytest

import fluidbench as fb

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize(("name", "error"), [("vortex", 0.2), ("sloshing", 0.03)])
def test_an_example_is_judged(name, error, tmp_path):
    found = fb.validate([EXAMPLES / f"{name}.py"], ["mpm"], out=tmp_path, progress=False)
    (trial,) = found.trials
    assert trial.case.name == name and 0 < trial.error < error and trial.verdict in ("pass", "MISS")


@pytest.mark.parametrize("name", ["vortex", "sloshing"])
def test_an_example_is_short(name):
    code = (EXAMPLES / f"{name}.py").read_text().split('"""')[2]
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 30
