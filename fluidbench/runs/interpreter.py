"""Python processes of ours: the same code as here, whatever lies in the user's folder and environment."""

import os
import sys
import sysconfig
import threading
from dataclasses import dataclass
from pathlib import Path

from ..native.device import kernels

NOISE = (
    "PYTHONPATH",
    "PYTHONSTARTUP",
    "PYTHONINSPECT",
    "PYTHONWARNINGS",
    "PYTHONDEBUG",
    "PYTHONVERBOSE",
    "PYTHONPROFILEIMPORTTIME",
    "PYTHONOPTIMIZE",
    "PYTHONBREAKPOINT",
)
"""Variables that change what a Python process imports or prints."""
START = (
    "import sys; sys.path[:] = sys.argv[2].split(sys.argv[1]); module = sys.argv[3]; del sys.argv[1:4]; "
    "import runpy; runpy.run_module(module, run_name='__main__', alter_sys=True)"
)


@dataclass(frozen=True)
class Seat:
    """Where a child runs: the only GPU that it sees, in the words of CUDA_VISIBLE_DEVICES (all, if none is named), and
    how many may run at a time."""

    gpu: str = ""
    of: int = 1


ALONE = Seat()
AT_A_TIME = "FLUIDBENCH_AT_A_TIME"  # tells a child how many may run beside it, itself included


def environment(seat: Seat = ALONE) -> dict[str, str]:
    """The environment of a child: never the current folder on its path (PYTHONSAFEPATH), nothing of NOISE, numpy's
    products on one thread unless told (others spin for cores that are timed), a folder for compiled kernels, and its
    seat. Raises Obstacle where there is no such folder."""
    kept = {k: v for k, v in os.environ.items() if k not in NOISE} | {"PYTHONSAFEPATH": "1", AT_A_TIME: str(seat.of)}
    kept |= kernels().variables
    if not {"OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"} & set(kept):
        kept["OPENBLAS_NUM_THREADS"] = "1"
    return kept | ({"CUDA_VISIBLE_DEVICES": seat.gpu} if seat.gpu else {})


def search_path() -> list[str]:
    """Where a child looks for modules: first the standard library, then the package that runs here, then what the
    parent has, so that no file of the user's can take the place of one of ours or of Python's."""
    own = str(Path(__file__).resolve().parents[2])
    given = [os.path.realpath(entry) for entry in sys.path if entry]
    libraries = {os.path.realpath(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")}
    standard = [e for e in given if e in libraries or Path(e).parent.as_posix() in libraries or e.endswith(".zip")]
    standard = [e for e in standard if Path(e).name not in ("site-packages", "dist-packages")]
    installed = [e for e in given if Path(e).name in ("site-packages", "dist-packages")]
    user = [e for e in given if e not in (*standard, *installed, own)]
    return list(dict.fromkeys([*standard, own, *installed, *user]))


def packages_of(python: Path) -> str:
    """Where the packages of a virtual environment lie; `python` is its interpreter, of the version that runs here."""
    root = str(python.parent.parent)
    return sysconfig.get_path("purelib", "venv", vars={"base": root, "platbase": root})


def command(module: str, *arguments: str, python: Path | None = None) -> list[str]:
    """The command line that runs a module of ours in a process of its own: by the Python that runs here, or by that of
    an environment, from which then comes only what ours lacks."""
    path = search_path() + ([] if python is None else [packages_of(python)])
    return [str(python or sys.executable), "-P", "-c", START, os.pathsep, os.pathsep.join(path), module, *arguments]


def end_with_parent() -> None:
    """Leave as soon as the parent is gone: its end of our standard input closes, however it ended."""

    def wait() -> None:
        sys.stdin.read()
        os._exit(3)

    threading.Thread(target=wait, daemon=True).start()
