"""Broken output folders and failing disks: broken files, a child that runs in this process, writes that fail."""

import builtins
import contextlib
import errno
import io
import json
import os
import random
import resource
import shutil
import subprocess
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

TINY = (
    "--set",
    "spacing=0.004",
    "--set",
    "duration=0.06",
    "--set",
    "output_interval=0.03",
    "--set",
    "toolpath.end=[0.03, 0.0]",
    "--set",
    "domain.upper=[0.06, 0.03, 0.03]",
)
RESULTS = ("record.json", "series.parquet", "final.npz")  # without them a run is not finished
BESIDE = ("job.json", "log.txt")
PAGES = ("run-mpm.parquet", "run-mpm.csv", "run-mpm.html", "run-mpm-views.png")
SHAPES = (
    "[]",
    "5",
    "{}",
    "null",
    '"completed"',
    "NaN",
    '{"verdict": "completed"}',
    '{"verdict": 5}',
    '{"verdict": ["completed"]}',
    '{"verdict": null}',
    '[{"verdict": "completed"}]',
    '{"verdict": "completed", "measures": null, "cost": null}',
    '{"verdict": "completed", "measures": [], "cost": [], "method": "mpm", "device": "cpu", "backend": "warp"}',
    '{"verdict": "diverged"}',
    '{"verdict": "refused"}',
    "[" * 5000,
    "9" * 5000,
    '{"a": ' * 2000,
)
PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108060000001f15c4890000000d49444154789c6360606060000000050001a5f645400000"
    "000049454e44ae426082"
)


@dataclass(frozen=True)
class Fault:
    """A way to break one file of a finished study; `redone`: the run must be run again, and the user told."""

    file: str
    way: str
    value: str = ""

    def __str__(self) -> str:
        return f"{self.file} {self.way} {self.value[:40]}".strip()

    @property
    def redone(self) -> bool:
        return self.file in RESULTS and self.way != "edited"

    @property
    def silent(self) -> bool:
        """Whether it looks just like a run that was never finished, of which there is nothing to say."""
        return self.file == "record.json" and self.way in ("missing", "dangling link")

    def apply(self, root: Path, rng: random.Random) -> None:
        """Break the file, wherever it lies below `root`."""
        path = next(p for p in sorted(root.rglob(self.file)))
        data = path.read_bytes()
        if self.way == "edited":
            text = data.decode()
            i = rng.choice([i for i, c in enumerate(text) if c.isdigit()])
            path.write_text(text[:i] + str((int(text[i]) + 1) % 10) + text[i + 1 :])
            return
        path.unlink()
        new: dict[str, Callable[[], Any]] = {
            "missing": lambda: None,
            "empty": path.touch,
            "folder": path.mkdir,
            "truncated": lambda: path.write_bytes(data[: rng.randrange(1, max(2, len(data) - 1))]),
            "binary": lambda: path.write_bytes(rng.randbytes(len(data))),
            "full folder": lambda: (path.mkdir(), (path / "mine.txt").write_text("mine")),
            "shape": lambda: path.write_text(self.value),
            "dangling link": lambda: path.symlink_to("nowhere"),
        }
        new[self.way]()


def faults() -> list[Fault]:
    """Every file broken in every way."""
    ways = ("empty", "truncated", "binary", "folder", "missing", "full folder", "dangling link")
    found = [Fault(file, way) for file in (*RESULTS, *BESIDE, *PAGES) for way in ways]
    found += [Fault("record.json", "shape", shape) for shape in SHAPES]
    found += [Fault("job.json", "shape", shape) for shape in SHAPES[:3]]
    return found + [Fault("record.json", "edited", str(i)) for i in range(6)]


class Child:
    """The child process of a run, in this process: fluidbench.run.main, its output caught, its errors in the log."""

    started = 0

    def __init__(self, command: Any, **given: Any) -> None:
        from fluidbench.runs import process as run

        Child.started += 1
        said, self.returncode, self.pid = io.StringIO(), 0, os.getpid()
        try:
            with contextlib.redirect_stdout(said):
                run.main([command[-2]])
        except SystemExit as end:
            self.returncode = end.code if isinstance(end.code, int) else int(end.code is not None)
        except Exception:
            self.returncode = 1
            with contextlib.suppress(OSError):
                given["stderr"].write(traceback.format_exc())
                given["stderr"].flush()
        self.stdout, self.stdin = io.StringIO(said.getvalue()), io.StringIO()

    def wait(self, timeout: float | None = None) -> int:
        return self.returncode

    poll = wait

    def kill(self) -> None:
        """It has ended."""


@contextlib.contextmanager
def children_in_process() -> Iterator[None]:
    """Runs without starting processes, figures without drawing them: the same files by the same calls, in less time."""
    from matplotlib.figure import Figure

    real = subprocess.Popen

    def popen(command: Any, *rest: Any, **given: Any) -> Any:
        own = isinstance(command, list) and "fluidbench.runs.process" in command
        return Child(command, **given) if own else real(command, *rest, **given)

    def savefig(_: Any, target: Any, **__: Any) -> None:
        if hasattr(target, "write"):
            target.write(PNG)
        else:
            Path(target).write_bytes(PNG)

    with patch.object(subprocess, "Popen", popen), patch.object(Figure, "savefig", savefig):
        yield


@contextlib.contextmanager
def failing_writes(root: Path, first: int, code: int) -> Iterator[list[str]]:
    """From the `first` on, everything that opens for writing, makes a folder or renames below `root` fails; yields what
    was written and tried, as it grows."""
    tried: list[str] = []

    def guard(real: Callable[..., Any], which: int, writes: Callable[..., bool]) -> Callable[..., Any]:
        def call(*words: Any, **named: Any) -> Any:
            path = words[which] if len(words) > which else None
            inside = isinstance(path, str | os.PathLike) and Path(path).absolute().is_relative_to(root)
            if inside and writes(*words, **named):
                tried.append(str(path))
                if len(tried) >= first:
                    raise OSError(code, os.strerror(code), str(path))
            return real(*words, **named)

        return call

    def for_writing(_: Any, mode: str = "r", *__: Any, **___: Any) -> bool:
        return any(letter in mode for letter in "wax+")

    def for_writing_fd(_: Any, flags: int, *__: Any, **___: Any) -> bool:
        return bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))

    def always(*_: Any, **__: Any) -> bool:
        return True

    plan: list[tuple[Any, str, int, Callable[..., bool]]] = [
        (builtins, "open", 0, for_writing),
        (io, "open", 0, for_writing),
        (os, "open", 0, for_writing_fd),
        (os, "mkdir", 0, always),
        (os, "replace", 1, always),
        (os, "rename", 1, always),
    ]
    with contextlib.ExitStack() as stack:
        for module, name, which, writes in plan:
            stack.enter_context(patch.object(module, name, guard(getattr(module, name), which, writes)))
        yield tried


@contextlib.contextmanager
def small_files(size: int) -> Iterator[None]:
    """Every write beyond `size` bytes of a file fails in the kernel, as on a disk that is full (EFBIG for ENOSPC)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextlib.contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Callable[[str], None]]:
    """A memory disk of this size; yields what mounts it anew with other options. Raises OSError where we may not."""

    def mount(*words: str) -> None:
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", *words, str(folder)], capture_output=True, check=False)
        if done.returncode:
            raise OSError(errno.EPERM, done.stderr.decode())

    if shutil.which("mount") is None:
        raise OSError(errno.ENOENT, "no mount here")
    mount(f"size={kilobytes}k", "tmpfs")
    try:
        yield lambda options: mount(f"remount,{options}", "tmpfs")
    finally:
        subprocess.run(["umount", str(folder)], check=False)


def unwhole(out: Path) -> list[str]:
    """What is missing or broken in the folder of a study of one run."""
    import pandas as pd

    wrong = []
    folders = sorted((out / "runs").glob("*")) if (out / "runs").is_dir() else []
    if len(folders) != 1:
        return [f"{len(folders)} runs"]

    def check(name: str, read: Callable[[Path], Any], folder: Path) -> None:
        try:
            assert read(folder / name), "nothing in it"
        except Exception as error:
            wrong.append(f"{name}: {type(error).__name__}: {str(error)[:80]}")

    def record(path: Path) -> bool:
        table = json.loads(path.read_text())
        return table["verdict"] == "completed" and bool(table["measures"]) and bool(table["cost"])

    def snapshot(path: Path) -> bool:
        with np.load(path) as data:
            return all(len(np.atleast_1d(data[key])) for key in data.files)

    check("record.json", record, folders[0])
    check("series.parquet", lambda path: len(pd.read_parquet(path)), folders[0])
    check("final.npz", snapshot, folders[0])
    check("run-mpm.parquet", lambda path: len(pd.read_parquet(path)), out)
    check("run-mpm.csv", lambda path: len(pd.read_csv(path)), out)
    check("run-mpm.html", lambda path: "</html>" in path.read_text(), out)
    return wrong


def litter(out: Path) -> list[str]:
    """Temporary files that were left."""
    return [
        p.name for p in out.rglob("*") if p.name.startswith((".", "tmp")) or p.suffix in (".part", ".tmp", ".partial")
    ]
