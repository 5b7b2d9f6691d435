"""One run in one child process: scenario and method in, record out.

The child gets clean peak memory and a wall limit; whatever happens to it, there is a record that says so. It reports
progress as lines of JSON on its standard output. `python -m fluidbench.run FOLDER` is such a child: it takes job.json
from the folder and leaves record.json there.
"""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .errors import Interrupted, Obstacle, UserError
from .job import Job
from .offspring import command, end_with_parent, environment
from .store import make_way, write_atomically, write_record
from .target import Target

PROGRESS, OBSTACLE = "@progress ", "@obstacle "
ATTENDED = "--attended"  # to a child: end when standard input closes, which then is the parent's end
GRACE = 120.0  # seconds beyond the wall limit for compiling, measuring and writing
_children: set[subprocess.Popen] = set()  # that run now, on whatever thread
OOM_COUNTERS = (Path("/sys/fs/cgroup/memory.events"), Path("/sys/fs/cgroup/memory/memory.oom_control"))


def launch(job: Job, folder: Path, progress: Callable[[dict[str, Any]], None] | None = None) -> dict[str, Any]:
    """Run a job in a child process and return its record; whatever happens to the child, there is a record.

    Raises Obstacle where a result cannot be written.
    """
    write_atomically(folder / "job.json", json.dumps(asdict(job), indent=1))
    _clear(folder)
    kills = _oom_kills()
    code, timed, obstacle = _attend(job, folder, progress)
    if obstacle:
        raise Obstacle(obstacle)
    record = _read(folder)
    return record if record is not None and code == 0 else _post_mortem(job, folder, code, timed, _oom_kills() > kills)


def stop_children() -> None:
    """Kill every child that runs now: whoever waits for one learns that it was interrupted."""
    for child in list(_children):
        _children.discard(child)
        child.kill()


def _clear(folder: Path) -> None:
    """Remove what an earlier run has left where results will be; raises Obstacle where that cannot be."""
    for path in (folder / name for name in ("record.json", "series.parquet", "final.npz", "log.txt")):
        try:
            make_way(path)
            path.unlink(missing_ok=True)
        except OSError as error:
            raise Obstacle(f"cannot write {path}: {error.strerror}") from None


def _attend(
    job: Job, folder: Path, progress: Callable[[dict[str, Any]], None] | None
) -> tuple[int, bool, str]:  # fmt: skip
    """Start the child and listen until it ends: (exit code, whether it was stopped for its time, what kept it)."""
    limit = None if job.wall_limit is None else job.wall_limit + GRACE
    timed, obstacle = threading.Event(), ""
    try:
        log = (folder / "log.txt").open("w")
    except OSError as error:
        raise Obstacle(f"cannot write {folder / 'log.txt'}: {error.strerror}") from None
    with log:
        child = subprocess.Popen(
            command("fluidbench.run", str(folder), ATTENDED), env=environment(),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True, errors="replace",
        )  # fmt: skip

        def stop() -> None:
            timed.set()
            child.kill()

        _children.add(child)
        killer = threading.Timer(limit, stop) if limit is not None else None
        if killer is not None:
            killer.start()
        try:
            assert child.stdout is not None
            for line in child.stdout:
                if line.startswith(PROGRESS):
                    if progress is not None:
                        progress(json.loads(line[len(PROGRESS) :]))
                elif line.startswith(OBSTACLE):
                    obstacle = line[len(OBSTACLE) :].strip()
                else:
                    log.write(line)
            child.wait()
            if child not in _children:
                raise Interrupted
        except BaseException:
            child.kill()
            child.wait()
            raise
        finally:
            _children.discard(child)
            if killer is not None:
                killer.cancel()
    return child.returncode, timed.is_set(), obstacle


def _read(folder: Path) -> dict[str, Any] | None:
    """The record that a child has left, if it is whole."""
    from .store import read_record

    return read_record(folder)[0]


def _oom_kills() -> int:
    """How many processes of this control group the system has killed for want of memory; 0 where it does not say."""
    for path in OOM_COUNTERS:
        try:
            counts = dict(line.split() for line in path.read_text().splitlines())
            return int(counts.get("oom_kill", 0))
        except (OSError, ValueError):
            continue
    return 0


def _post_mortem(job: Job, folder: Path, code: int, timed: bool, starved: bool) -> dict[str, Any]:
    """The record of a child that left none."""
    return write_record(
        folder, job.heading() | {"verdict": "timeout" if timed else "error",
                                 "reason": _cause(job, folder, code, timed, starved)},
    )  # fmt: skip


def _cause(job: Job, folder: Path, code: int, timed: bool, starved: bool) -> str:
    """What became of a child, in words."""
    if timed:
        return f"its process was stopped {GRACE:g} s after the wall limit of {job.wall_limit:g} s; raise --wall-limit"
    if code < 0:
        name = signal.Signals(-code).name if -code in {*signal.Signals} else f"signal {-code}"
        why = {
            "SIGKILL": "the system ran out of memory" if starved else "by somebody, or by the system for its memory",
            "SIGSEGV": "it touched memory that is not its own: please report it", "SIGBUS": "a bus error",
            "SIGILL": "an instruction that this processor does not know", "SIGTERM": "it was asked to end",
            "SIGINT": "it was interrupted", "SIGABRT": "it gave up",
        }.get(name, "")  # fmt: skip
        return f"its process was killed ({name})" + (f": {why}" if why else "")
    lines = (folder / "log.txt").read_text(errors="replace").strip().splitlines()
    last = lines[-1] if lines else "no message"
    return f"its process ended with code {code}: {last}" if code else f"its process left no whole record: {last}"


def main(arguments: list[str]) -> None:
    """The child's entry point."""
    from .child import perform

    folder = Path(arguments[0])
    if ATTENDED in arguments[1:]:
        end_with_parent()
    table = json.loads((folder / "job.json").read_text())
    job = Job(**table | {"target": Target(**table["target"])})

    def report(state: dict[str, Any]) -> None:
        print(PROGRESS + json.dumps(state), flush=True)

    try:
        perform(job, folder, report)
    except UserError as error:
        write_record(folder, job.heading() | {"verdict": "refused", "reason": " ".join(str(error).splitlines())})
    except Obstacle as error:
        print(OBSTACLE + str(error), flush=True)
        sys.exit(1)
    except OSError as error:
        print(f"{OBSTACLE}{error.strerror or error}: {error.filename or folder}", flush=True)
        sys.exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
