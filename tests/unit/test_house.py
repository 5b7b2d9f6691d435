"""The house keeps its rules: what may import what, and what stays unloaded."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOREIGN = ("nozzle", "toolpath", "bead", "report")


def python_files(folder):
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("path", python_files("solvers"), ids=lambda p: str(p.relative_to(ROOT)))
def test_methods_know_nothing_of_printing(path):
    text = path.read_text().lower()
    assert not [word for word in FOREIGN if word in text]


@pytest.mark.parametrize("path", python_files("fluidbench"), ids=lambda p: str(p.relative_to(ROOT)))
def test_toolkit_never_imports_a_method(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) and node.level == 0 else []
        assert not [n for n in names if n.split(".")[0] == "solvers"]


@pytest.mark.parametrize("path", python_files("fluidbench"), ids=lambda p: str(p.relative_to(ROOT)))
def test_no_room_but_the_papers_names_a_method(path):
    """What a study must know of a method, the method says; the command line's defaults are words for people."""
    if path.parts[-2] in ("paper", "engines", "cli") or path.name == "__init__.py":
        return
    constants = [n.value for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Constant)]
    assert not {"mpm", "sph", "pbd"} & {value for value in constants if isinstance(value, str)}


@pytest.mark.parametrize(
    "module", ["fluidbench", "fluidbench.cli", "fluidbench.scenario.scenario", "fluidbench.native.solver"]
)
def test_heavy_packages_stay_unloaded(module):
    code = f"import sys, {module}; print([m for m in ('warp', 'pandas', 'matplotlib', 'plotly') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
