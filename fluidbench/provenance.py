"""What a run was made by: the code, by the hash of its sources, and the machine."""

import functools
import hashlib
import os
import platform
import time
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from . import __version__
from .solver import get_solver
from .target import BACKENDS, DEFAULT_BACKEND, Target

IDLE = ("cli", "report")  # rooms of the toolkit that no run enters
HARDWARE = ("arch", "cores", "processor", "device")  # keys of a machine's description that decide what a run costs


@functools.cache
def code(method: str, backend: str) -> dict[str, str]:
    """What decides a run's result beside its inputs: the sources of the toolkit and of the method's package, and the
    versions of the languages of its kernels."""
    package = get_solver(method).__module__.partition(".")[0]
    languages = {name: version(BACKENDS[name]) for name in dict.fromkeys((DEFAULT_BACKEND, backend))}
    return {"sources": _hash_of(("fluidbench", package)), **languages}


def _hash_of(packages: tuple[str, ...]) -> str:
    """Sixteen characters for all Python sources of these packages."""
    found = hashlib.sha256()
    for package in packages:
        spec = find_spec(package)
        folders = list(spec.submodule_search_locations or []) if spec else []
        files = sorted(path for folder in folders for path in Path(folder).rglob("*.py"))
        if spec is not None and spec.origin and not folders:
            files = [Path(spec.origin)]
        for path in files:
            root = next((Path(folder) for folder in folders if path.is_relative_to(folder)), path.parent)
            inside = path.relative_to(root)
            if package != "fluidbench" or inside.parts[0] not in IDLE:
                found.update(f"{package}/{inside.as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return found.hexdigest()[:16]


def machine(target: Target) -> dict[str, str]:
    """What a run happens on, how busy that is, and with which versions."""
    import numpy as np
    import warp as wp

    device = wp.get_device(target.device)
    return {
        "fluidbench": __version__, "python": platform.python_version(), "warp": str(wp.config.version),
        "backend_version": version(BACKENDS[target.backend]), "numpy": np.__version__, "platform": platform.platform(),
        **hardware(target, device), "load": _load(), "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }  # fmt: skip


def hardware(target: Target, device: object = None) -> dict[str, str]:
    """What decides what a run costs: processor and device; times from another machine are not comparable."""
    arch, name = platform.machine(), "CPU"
    if target.device != "cpu":
        import warp as wp

        device = device or wp.get_device(target.device)
        arch, name = f"sm_{device.arch}", device.name  # type: ignore[attr-defined]
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
