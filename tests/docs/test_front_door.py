"""The Python of the front page does what it says, and everything at the front door says what it takes."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import fluidbench as fb

ROOT = Path(__file__).parents[2]
END = 'fb.validate(["dam_break"], methods=["mpm"])'  # what follows takes arguments that nobody has written yet
HEAVY = ("warp", "taichi", "pandas", "numpy", "plotly", "scipy", "matplotlib", "pydantic")
CLASSES = [name for name in fb.__all__ if inspect.isclass(getattr(fb, name))]
VERBS = [name for name in fb.__all__ if name not in CLASSES]


def front_page():
    """The first Python block of docs/index.md, up to the first validate."""
    text = (ROOT / "docs" / "index.md").read_text()
    block = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert block is not None
    code, found, _ = block[1].partition(END)
    assert found
    return code + END


def executed(code, folder, monkeypatch):
    monkeypatch.chdir(folder)
    names = {}
    exec(compile(code.replace(END, f"checked = {END}"), "docs/index.md", "exec"), names)
    return names


def check(names, folder):
    result, run = names["result"], names["run"]
    assert len(result.runs) == 6 and all(r.ok for r in result.runs)
    assert isinstance(result.table, pd.DataFrame) and {"bead_width_m", "wall_s"} <= set(result.table)
    assert result.figures["cross_section"].data and "<table" in result._repr_html_()
    assert (folder / "out" / "report.html").is_file() and (folder / "out" / "compare.parquet").is_file()
    assert len(list((folder / "out" / "runs").iterdir())) == 6
    assert run.record.measures["mass_kg"] > 0 and run.series["time_s"].iloc[-1] == pytest.approx(
        names["scenario"].duration
    )
    assert len(run.frame()["position"]) == run.record.measures["particles"]
    assert names["checked"].ok and list(names["checked"].table["case"]) == ["dam_break"]


def test_the_front_page_runs_at_a_coarse_spacing(tmp_path, monkeypatch):
    code = front_page()
    assert code.count('"spacing": 1e-3') == 1
    check(
        executed(code.replace('"spacing": 1e-3', '"spacing": 3e-3, "duration": 0.6'), tmp_path, monkeypatch), tmp_path
    )


@pytest.mark.slow
def test_the_front_page_runs_as_it_stands(tmp_path, monkeypatch):
    check(executed(front_page(), tmp_path, monkeypatch), tmp_path)


def test_what_the_front_page_leaves_open_is_at_the_front_door():
    text = (ROOT / "docs" / "index.md").read_text()
    assert set(re.findall(r"fb\.(\w+)\(", text)) <= set(fb.__all__)


@pytest.mark.parametrize("name", fb.__all__)
def test_public_names_say_what_they_are_with_units(name):
    text = inspect.getdoc(getattr(fb, name)) or ""
    assert re.search(r"\[[^\]\"]+\]|SI units", text), text


@pytest.mark.parametrize("name", VERBS)
def test_public_functions_name_their_arguments_and_errors(name):
    found = getattr(fb, name)
    text = inspect.getdoc(found) or ""
    missing = [p for p in inspect.signature(found).parameters if not re.search(rf"\b{p}\b", text)]
    assert not missing and re.search(r"\b[Rr]aises \w+Error\b", text), missing


def test_the_front_door_is_light():
    code = f"import sys, fluidbench; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_what_is_named_is_there_and_nothing_else():
    assert set(fb.__all__) <= set(dir(fb))
    with pytest.raises(AttributeError, match="no attribute 'sweep_the_floor'"):
        fb.sweep_the_floor  # noqa: B018
