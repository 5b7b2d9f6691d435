"""Warp as a guest: what it says of itself belongs in no result, and what it compiles needs a folder."""

import contextlib
import functools
import os
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from ..errors import Obstacle

CACHE, TAICHI_CACHE = "WARP_CACHE_PATH", "TI_OFFLINE_CACHE_FILE_PATH"  # variables that name a folder for kernels
CURE = f"set {CACHE} or XDG_CACHE_HOME to a folder that can be written"


@dataclass(frozen=True)
class Kernels:
    """The folder of compiled kernels; the variables that a process of ours needs to find it; where it is not the one
    that was meant, a sentence that says so and names the cure."""

    folder: Path
    variables: dict[str, str]
    note: str = ""


@functools.cache
def kernels() -> Kernels:
    """Where kernels are compiled into: the user's cache folder or, where none can be made, a temporary folder of this
    user's. Taichi's lie beside Warp's where it has no folder of its own.

    Raises Obstacle, with the cure, where there is no such folder either.
    """
    import platformdirs

    given = os.environ.get(CACHE)
    folder = Path(given) if given else platformdirs.user_cache_path("warp", "NVIDIA")
    variables, note = {}, ""
    if given == "":  # of which Warp makes the current folder
        variables[CACHE] = str(folder)
    if why := _refused(folder):
        meant, folder = folder, _own_temporary(why)
        variables[CACHE] = str(folder)
        note = f"no kernels can be compiled into {meant} ({why}); they go to {folder}: {CURE}"
    beside = os.environ.get(TAICHI_CACHE)
    if _refused(Path(beside) if beside else platformdirs.user_cache_path("taichi")):
        variables[TAICHI_CACHE] = str(folder / "taichi")
    return Kernels(folder, variables, note)


def _refused(folder: Path) -> str:
    """Why nothing can be written to a folder, which is made; empty where something can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _own_temporary(why: str) -> Path:
    """A temporary folder that is this user's alone: what lies in it is loaded as machine code."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    try:
        folder = Path(tempfile.gettempdir()) / f"fluidbench-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        alone = os.name == "nt" or (found.st_uid == user and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
        trouble = _refused(folder) if alone and stat.S_ISDIR(found.st_mode) else f"{folder} is not this user's alone"
    except OSError as error:
        trouble = error.strerror or str(error)
    if trouble:
        raise Obstacle(f"no folder for compiled kernels: {why}, and for a temporary one {trouble}; {CURE}")
    return folder


def quiet_warp() -> None:
    """Keep Warp from announcing itself, its modules and missing GPUs, of which `fluidbench doctor` tells."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR


def start_warp() -> None:
    """Start Warp with a folder for kernels, quietly: on a machine without a GPU its library would write so to standard
    error by itself. Raises Obstacle where there is no such folder."""
    import warp as wp

    quiet_warp()
    if CACHE in kernels().variables and wp.config.kernel_cache_dir is None:  # Warp has not settled on one
        wp.config.kernel_cache_dir = str(kernels().folder)
    with _hushed():
        wp.init()


@contextlib.contextmanager
def _hushed() -> Iterator[None]:
    """What any library writes to standard error goes nowhere meanwhile; errors are exceptions all the same."""
    try:
        kept = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def note_launch() -> None:
    """Count a launch that is not Warp's."""
    for counter in CountedLaunches.entered:
        counter.count += 1


class CountedLaunches:
    """Counts kernel launches while it is entered; adds up over several entries."""

    entered: ClassVar[list["CountedLaunches"]] = []

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> "CountedLaunches":
        import warp as wp

        self._launch = wp.launch

        def launch(*args, **kwargs):
            self.count += 1
            return self._launch(*args, **kwargs)

        wp.launch = launch
        self.entered.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        import warp as wp

        wp.launch = self._launch
        self.entered.remove(self)
