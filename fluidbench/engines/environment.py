"""The virtual environments of engines, below the user's data folder: whole or not there."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import Obstacle
from ..files import write_atomically
from .catalogue import Engine

DATA = "FLUIDBENCH_DATA"  # overrides the folder, for tests and for disks that are full
MARK = "engine.json"  # written last: an environment without it is half-made
OFFLINE = (
    "NewConnectionError",
    "NameResolutionError",
    "name resolution",
    "ConnectTimeout",
    "ProxyError",
    "Max retries",
    "Connection refused",
    "unreachable",
)
"""What pip says where no index answers."""


@dataclass(frozen=True)
class Installed:
    """What a whole environment holds: the engine's version, and the version of Python that it was made for."""

    version: str
    python: str


def home(engine: Engine) -> Path:
    """The folder of an engine's environment."""
    import platformdirs

    data = os.environ.get(DATA) or platformdirs.user_data_dir("fluidbench", appauthor=False)
    return Path(data).absolute() / "engines" / engine.name


def python_of(environment: Path) -> Path:
    """The interpreter of an environment."""
    return environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def installed(engine: Engine) -> Installed | None:
    """What is there of an engine; None where it was never added, or not to the end."""
    folder = home(engine)
    try:
        table = json.loads((folder / MARK).read_text())
        found = Installed(str(table["version"]), str(table["python"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return found if python_of(folder).exists() else None


def missing(engine: Engine) -> str | None:
    """Why an engine cannot be used by the Python that runs here, and the command that helps; None where it can."""
    found = installed(engine)
    if found is None:
        return f"{engine.title} is not installed: fluidbench engines add {engine.name}"
    if found.python != _series():
        return (
            f"{engine.title} was added for Python {found.python}, and this is {_series()}: "
            f"fluidbench engines add {engine.name}"
        )
    return None


def add(engine: Engine, tell: Callable[[str], None]) -> Installed:
    """Make an engine's environment anew; the one that is there, if any, stays until the new one is whole.

    Raises Obstacle where it cannot be made: no network, no wheel for this Python, a library of the system's missing.
    """
    from filelock import FileLock, Timeout

    folder = home(engine)
    part, old = (folder.with_name(f".{engine.name}.{word}") for word in ("part", "old"))
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(folder.with_name(f".{engine.name}.lock"), timeout=0):
            for left in (part, old):
                shutil.rmtree(left, ignore_errors=True)
            try:
                version = _make(engine, part, tell)
            except BaseException:
                shutil.rmtree(part, ignore_errors=True)
                raise
            made = Installed(version, _series())
            write_atomically(part / MARK, json.dumps({"version": made.version, "python": made.python}))
            if folder.exists():
                folder.rename(old)
            part.rename(folder)
            shutil.rmtree(old, ignore_errors=True)
    except Timeout:
        raise Obstacle(f"{engine.title} is being added by another process") from None
    except OSError as error:
        raise Obstacle(f"cannot write {error.filename or folder}: {error.strerror or error}") from None
    return made


def remove(engine: Engine) -> bool:
    """Remove an engine's environment, half-made or whole; whether there was one. Raises Obstacle where it stays."""
    folder = home(engine)
    part = folder.with_name(f".{engine.name}.part")
    there = folder.exists() or part.exists()
    try:
        (folder / MARK).unlink(missing_ok=True)  # first: what is half removed is not whole
        for path in (part, folder):
            if path.exists():
                shutil.rmtree(path)
    except OSError as error:
        raise Obstacle(f"cannot remove {error.filename or folder}: {error.strerror or error}") from None
    return there


def _series() -> str:
    """The Python that runs here, as far as compiled packages care: "3.11"."""
    return ".".join(platform.python_version_tuple()[:2])


def _make(engine: Engine, folder: Path, tell: Callable[[str], None]) -> str:
    """Make an environment in a folder; the version of the engine that it then holds."""
    python = str(python_of(folder))
    tell(f"making an environment below {folder.parent}")
    _call(engine, [sys.executable, "-m", "venv", str(folder)])
    tell(f"installing {engine.requirement} ({engine.licence}, {engine.address})")
    _call(engine, [python, "-m", "pip", "install", "--progress-bar", "off", engine.requirement])
    tell(f"trying it: {engine.package}")
    _call(engine, [python, "-c", f"{engine.trial}; import os; os._exit(0)"])  # no teardown: that is not what is tried
    said = f"from importlib.metadata import version; print(version({engine.package!r}))"
    return _call(engine, [python, "-c", said]).strip()


def _call(engine: Engine, command: list[str]) -> str:
    """What a command prints; raises Obstacle, with the line that tells most, where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL)
    if done.returncode == 0:
        return done.stdout
    said = done.stderr + done.stdout
    if any(word in said for word in OFFLINE):
        raise Obstacle(f"{engine.title} was not added: no package index answers; is there a network?")
    lines = [line.strip() for line in said.splitlines() if line.strip()] or [f"exit code {done.returncode}"]
    if "(from versions: none)" in said:
        raise Obstacle(
            f"{engine.title} was not added: no package index that answers has {engine.requirement} for Python "
            f"{_series()}"
        )
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    raise Obstacle(f"{engine.title} was not added: {errors[0] if errors else lines[-1]}")
