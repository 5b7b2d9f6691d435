"""What a run was made by: the code, by the hash of its sources, and the machine."""

import functools
import hashlib
import os
import platform
import time
from collections.abc import Sequence
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path, PurePath

from ..method.target import BACKENDS, DEFAULT_BACKEND, Target
from ..registry import get_method
from ..scenario.library import reference_tables
from .interpreter import AT_A_TIME

IDLE = ("cli", "report", "study", "paper", "engines")  # rooms of the toolkit that no run of a native method enters
KERNELS = "solvers"  # the package of laws and kernels, which methods of others may use, too
HARDWARE = ("arch", "cores", "processor", "device")  # keys of a machine's description that decide what a run costs


@functools.cache
def code(method: str, backend: str, rooms: tuple[str, ...] = ()) -> dict[str, str]:
    """What decides a run's result beside its inputs: the sources of the toolkit and of the method's package, the
    reference tables, and the versions of the languages of its kernels and of its engine. `rooms` are those of the
    toolkit that are entered, too."""
    found = get_method(method)
    room = found.__module__.partition(".")[2] if found.__module__.startswith("fluidbench.") else ""
    packages = {kind.__module__.partition(".")[0] for kind in found.__mro__} - {"builtins", "abc"}
    languages = {name: version(BACKENDS[name]) for name in dict.fromkeys((DEFAULT_BACKEND, backend))}
    entered = (*rooms, room.partition(".")[0]) if room else rooms
    idle = tuple(room for room in IDLE if room not in entered)
    return {"sources": _hash_of(sorted({"fluidbench", KERNELS, *packages}), idle), **languages, **found.versions()}


def changed(method: str) -> str:
    """Why a stored run of other `code` does not serve."""
    return f"the code, or {' or '.join(['Warp', 'Taichi', *get_method(method).versions()])}, has changed since"


def _hash_of(packages: Sequence[str], idle: Sequence[str]) -> str:
    """Sixteen characters for all Python sources of these packages, and for what runs are compared with."""
    found = hashlib.sha256()
    for package in packages:
        for name, path in _sources(package):
            if package != "fluidbench" or name.parts[0] not in idle:
                found.update(f"{package}/{name.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    for path in reference_tables():
        found.update(f"{path.name}\0".encode() + path.read_bytes() + b"\0")
    return found.hexdigest()[:16]


def _sources(package: str) -> list[tuple[PurePath, Path]]:
    """(path inside the package, file) of its Python files, in order."""
    spec = find_spec(package)
    if spec is None:
        return []
    folders = [Path(folder) for folder in spec.submodule_search_locations or []]
    if not folders and spec.origin:
        return [(PurePath(Path(spec.origin).name), Path(spec.origin))]
    return sorted((path.relative_to(folder), path) for folder in folders for path in folder.rglob("*.py"))


def machine(target: Target) -> dict[str, str]:
    """What a run happens on, how busy that is, and with which versions."""
    versions = {name: version(package) for name, package in (("fluidbench", "fluidbench"), ("numpy", "numpy"))}
    return {
        **versions,
        "python": platform.python_version(),
        "warp": version(BACKENDS[DEFAULT_BACKEND]),
        "backend_version": version(BACKENDS[target.backend]),
        "platform": platform.platform(),
        **hardware(target),
        "load": _load(),
        "runs_at_a_time": os.environ.get(AT_A_TIME, "1"),
        "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }


def hardware(target: Target) -> dict[str, str]:
    """What decides what a run costs: processor and device; times from another machine are not comparable."""
    arch, name = platform.machine(), "CPU"
    if target.device != "cpu":
        import warp as wp

        from ..native.device import quiet_warp

        quiet_warp()
        device = wp.get_device(target.device)
        arch, name = f"sm_{device.arch}", device.name
    return {"arch": arch, "cores": str(os.cpu_count()), "processor": processor(), "device": name}


@functools.cache
def processor() -> str:
    """The processor's model."""
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        names = [line.partition(":")[2].strip() for line in listing.read_text().splitlines() if "model name" in line]
        if names:
            return names[0]
    return platform.processor() or platform.machine()


def _load() -> str:
    """Processes that wanted a core over the last minute, where the system says so."""
    return f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
