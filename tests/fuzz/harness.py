"""One hostile command line, run in this process as `fluidbench` would run it, and judged."""

import contextlib
import importlib
import io
import json
import os
import pkgutil
import re
import resource
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

SEED = int(os.environ.get("FUZZ_SEED", "20250611"))
REFUSED, EITHER, ACCEPTED = "refused", "either", "accepted"
LINES, CHARACTERS = 6, 2000  # a handful of lines, and what fits on a screen
MEMORY = 3 * 2**30  # bytes that a case may ask for: on a bigger wish Python says MemoryError and the machine lives
STUBS = {
    "fluidbench.runs.execute": ("execute",),
    "fluidbench.study.validate": ("run",),
    "fluidbench.runs.process": ("launch",),
    "fluidbench.runs.child": ("perform",),
}
"""What runs simulations: the entrances of the studies, and the child behind them."""


class WouldRun(BaseException):
    """Input was accepted and a simulation would start; a BaseException, so that no handler takes it for a fault."""


class TooLong(BaseException):
    """A case went on for longer than its limit."""


@dataclass(frozen=True)
class Case:
    """A command line with the files that it needs and what must come of it.

    `names`: a refusal holds one of these words (none given: any text does); `says`: and matches this expression.
    `{base}` in an argument or a file stands for the folder two above the one where the command runs.
    """

    sort: str
    arguments: tuple[str, ...]
    expect: str = REFUSED
    names: tuple[str, ...] = ()
    says: str = ""
    files: Mapping[str, bytes | Callable[[], bytes]] = field(default_factory=dict)
    folders: tuple[str, ...] = ()
    limit: int = 10

    def __str__(self) -> str:
        words = [a if len(a) <= 120 else f"{a[:80]}...({len(a)} characters)" for a in self.arguments]
        shown = {n: d[:160] if isinstance(d, bytes) else "(big)" for n, d in sorted(self.files.items())[:2]}
        return f"[{self.sort}] fluidbench {' '.join(map(repr, words))}" + (f" with {shown}" if shown else "")


@dataclass
class Outcome:
    """How a command ended: exit code, or a traceback; `ran` when a simulation would have started."""

    code: int | None = None
    out: str = ""
    err: str = ""
    crash: str = ""
    ran: bool = False
    wrong: list[str] = field(default_factory=list)

    @property
    def accepted(self) -> bool:
        return self.ran or self.code == 0


class Kept(io.BytesIO):
    """What was printed, whatever becomes of the stream that it went through."""

    def close(self) -> None:
        pass


def fluidbench(arguments: Iterable[str], limit: int = 60) -> Outcome:
    """`fluidbench ARGUMENTS` in this process and folder."""
    from fluidbench.cli import main

    done = Outcome()
    printed, complained = Kept(), Kept()
    out = io.TextIOWrapper(printed, "utf-8", "strict", write_through=True)
    err = io.TextIOWrapper(complained, "utf-8", "backslashreplace", write_through=True)  # as Python opens them
    with (
        patch.object(sys, "argv", ["fluidbench", *arguments]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
        _guarded(limit),
    ):
        warnings.simplefilter("ignore")  # pytest makes errors of them, the program does not
        try:
            main()
            done.code = 0
        except SystemExit as end:
            done.code = 0 if end.code is None else end.code if isinstance(end.code, int) else 1
        except WouldRun as end:
            done.ran, done.wrong = True, list(end.args)
        except TooLong:
            done.crash = f"went on for over {limit} s"
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            last = traceback.extract_tb(error.__traceback__)[-1]
            text = str(error)[:160]
            done.crash = f"{type(error).__name__}: {text} ({Path(last.filename).name}:{last.lineno})"
    done.out, done.err = (s.getvalue().decode("utf-8", "replace") for s in (printed, complained))
    return done


@contextlib.contextmanager
def _guarded(limit: int) -> Iterator[None]:
    """An alarm after `limit` s, and an end to memory."""

    def ring(*_: Any) -> None:
        raise TooLong

    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(limit)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@contextlib.contextmanager
def nothing_runs() -> Iterator[None]:
    """Whatever would start a simulation raises WouldRun instead, wherever it has been imported."""
    import fluidbench

    for module in pkgutil.walk_packages(fluidbench.__path__, "fluidbench."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    real = [getattr(importlib.import_module(m), name) for m, names in STUBS.items() for name in names]
    with contextlib.ExitStack() as stack:
        for name, module in list(sys.modules.items()):
            for key, value in list(vars(module).items()) if name.startswith("fluidbench") else ():
                if any(value is one for one in real):
                    stack.enter_context(patch.object(module, key, _would_run))
        yield


def _would_run(planned: Any = (), *_: Any, **__: Any) -> None:
    raise WouldRun(*dict.fromkeys(fault for table in _scenarios(planned) for fault in _unfit(table)))


def _scenarios(planned: Any) -> Iterator[dict[str, Any]]:
    """The scenario tables of jobs, of trials and of experiments."""
    for item in planned if isinstance(planned, list | tuple) else [planned]:
        if hasattr(item, "task"):
            item = item.task.get("scenario")
        for one in getattr(item, "jobs", {}).values() if hasattr(item, "jobs") else [item]:
            table = getattr(one, "scenario", one)
            if isinstance(table, dict):
                yield table


def _unfit(table: dict[str, Any]) -> Iterator[str]:
    """Why a table that was accepted should not have been: no folder can be called so, no number is one."""
    name = str(table.get("name", ""))
    if name != Path(name).name or not name.isprintable() or len(name.encode("utf-8", "replace")) > 235:
        yield f"accepted the name {name[:60]!r}"
    try:
        json.dumps(table, allow_nan=False)
    except ValueError:
        yield "accepted a number that no file can hold: NaN, infinity, or thousands of digits"


def attempt(case: Case, base: Path) -> tuple[Outcome, list[str]]:
    """(outcome, violations) of a case run two folders below `base`, which is made and emptied again."""
    work = base / "above" / "work"
    work.mkdir(parents=True)
    for folder in case.folders:
        (work / folder).mkdir(parents=True)
    for name, data in case.files.items():
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_bytes(data.replace(b"{base}", str(base).encode()) if isinstance(data, bytes) else data())
    before, home = listing(base), Path.cwd()
    os.chdir(work)
    try:
        done = fluidbench([a.replace("{base}", str(base)) for a in case.arguments], case.limit)
    finally:
        os.chdir(home)
    found = list(_violations(case, done, sorted(listing(base) ^ before)))
    shutil.rmtree(base)
    return done, found


def listing(root: Path) -> set[tuple[str, int]]:
    """Every path below a folder, with its size where it is a file."""
    return {(str(p.relative_to(root)), p.lstat().st_size if p.is_file() else -1) for p in root.rglob("*")}


def _violations(case: Case, done: Outcome, touched: list[tuple[str, int]]) -> Iterator[str]:
    if done.crash:
        yield f"crash: {done.crash}"
        return
    if done.accepted:
        yield from (f"accepted what it must refuse: {w}" for w in done.wrong)
        if case.expect == REFUSED:
            yield "accepted what it must refuse"
        outside = [path for path, _ in touched if not path.startswith(("above/work/out", "above/work/fluidbench-out"))]
        if outside and not any(word.startswith("--out=") for word in case.arguments):
            yield f"wrote outside its folder: {outside[:3]}"
        return
    text = done.err.strip()
    if case.expect == ACCEPTED:
        yield f"refused what is right: {text[:300]}"
    if done.code != 2:
        yield f"exit code {done.code}, not 2: {text[:200]}"
    if touched:
        yield f"left behind: {[path for path, _ in touched][:3]}"
    if len(text.splitlines()) > LINES or len(text) > CHARACTERS:
        yield f"{len(text.splitlines())} lines and {len(text)} characters of message"
    if not text or "Traceback" in text:
        yield f"no message, or a traceback: {text[:200]}"
    elif case.names and not any(name.lower() in text.lower() for name in case.names):
        yield f"does not name {' or '.join(case.names)}: {text[:300]}"
    elif case.says and not re.search(case.says, text):
        yield f"does not say /{case.says}/: {text[:300]}"


def told(found: list[str], most: int = 25) -> str:
    """Violations as an assertion shows them."""
    return f"{len(found)} violations:\n  " + "\n  ".join(found[:most])
