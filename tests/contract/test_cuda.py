"""What runs on a GPU compiles for one, on a machine that has none: NVRTC comes with Warp."""

import importlib
import pkgutil
import sys

import pytest
import warp as wp

import fluidbench.native
import solvers
from solvers.pbd import kernels_warp as pbd
from solvers.sph import kernels_warp as sph

ARCHITECTURE = 90  # Hopper
pytestmark = pytest.mark.skipif(sys.platform == "darwin", reason="Warp has no CUDA there")


def modules():
    """Names of modules of ours that hold kernels, those for engines and Taichi aside."""
    for package in (solvers, fluidbench.native):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if "taichi" not in found.name and "engine" not in found.name:
                held = vars(importlib.import_module(found.name)).values()
                if any(isinstance(kernel, wp.Kernel) and kernel.module.name == found.name for kernel in held):
                    yield found.name


def compiles(module, folder):
    folder.mkdir()
    wp.compile_aot_module(module, arch=ARCHITECTURE, module_dir=folder)
    return any(folder.glob("*.cubin")) or any(folder.glob("*.ptx"))


@pytest.mark.parametrize("name", list(modules()))
def test_kernels_compile(name, tmp_path):
    assert compiles(name, tmp_path / "built")


@pytest.mark.parametrize(
    ("method", "variant"),
    [
        ("sph", (False, False, False, False, True, False)),
        ("sph", (False, False, True, True, True, True)),
        ("sph", (False, True, True, False, True, True)),
        ("sph", (True, True, False, False, True, False)),
        ("sph", (True, True, True, False, True, False)),
        ("sph", (True, True, True, True, True, True)),
        ("pbd", (False, False, False)),
        ("pbd", (False, True, True)),
        ("pbd", (True, True, False)),
        ("pbd", (True, True, True)),
    ],
)
def test_passes_compile(method, variant, tmp_path):
    """SPH's: strength, tension, viscosity, changes, settling and a body; PBD's: strength, tension, a body."""
    passes = {"sph": sph, "pbd": pbd}[method].passes(*variant, False)
    built = {kernel.module.name: kernel.module for kernel in vars(passes).values()}
    assert len(built) > 1
    for k, module in enumerate(built.values()):
        assert compiles(module, tmp_path / f"{k}")
