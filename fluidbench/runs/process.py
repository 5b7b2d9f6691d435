"""One piece of work in one child process: job.json in, record out.

The child gets clean peak memory and a wall limit; whatever happens to it, there is a record that says so. It reports
progress as lines of JSON on its standard output. `python -m fluidbench.runs.process FOLDER` is such a child.
"""

import json
import math
import signal
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..errors import Interrupted, Obstacle, UserError
from ..files import make_way, write_atomically
from ..method.target import Target
from .experiment import Experiment
from .interpreter import ALONE, Seat, command, end_with_parent, environment
from .job import Job
from .work import WORK, Report, Work

PROGRESS, OBSTACLE = "@progress ", "@obstacle "
ATTENDED = "--attended"  # to a child: end when standard input closes, which then is the parent's end
GRACE = 120.0  # seconds beyond the wall limit for compiling, measuring and writing
_children: set[subprocess.Popen] = set()  # that run now, on whatever thread
OOM_COUNTERS = (Path("/sys/fs/cgroup/memory.events"), Path("/sys/fs/cgroup/memory/memory.oom_control"))


def launch(work: Work, folder: Path, progress: Report | None = None, seat: Seat = ALONE) -> Any:
    """Have a piece of work done in a child process and return its result; whatever happens to the child, there is one.

    Raises Obstacle where a result cannot be written.
    """
    write_atomically(folder / WORK, json.dumps({"kind": type(work).__name__} | asdict(work), indent=1))
    _clear(folder, work)
    kills = _oom_kills()
    code, timed, obstacle = _attend(work, folder, progress, seat)
    if obstacle:
        raise Obstacle(obstacle)
    result = work.left(folder) if code == 0 else None
    return result if result is not None else work.bury(folder, timed, _cause(work, folder, code, timed, kills))


def stop_children() -> None:
    """Kill every child that runs now: whoever waits for one learns that it was interrupted."""
    for child in list(_children):
        _children.discard(child)
        child.kill()


def _clear(folder: Path, work: Work) -> None:
    """Remove what an earlier run has left where results will be; raises Obstacle where that cannot be."""
    for path in (folder / name for name in work.leaves):
        try:
            make_way(path)
            path.unlink(missing_ok=True)
        except OSError as error:
            raise Obstacle(f"cannot write {path}: {error.strerror}") from None


def _attend(work: Work, folder: Path, progress: Report | None, seat: Seat) -> tuple[int, bool, str]:
    """Start the child and listen until it ends: (exit code, whether it was stopped for its time, what kept it)."""
    limit = None if work.limit is None else work.limit + GRACE
    timed, obstacle = threading.Event(), ""
    try:
        log = (folder / "log.txt").open("w")
    except OSError as error:
        raise Obstacle(f"cannot write {folder / 'log.txt'}: {error.strerror}") from None
    with log:
        child = subprocess.Popen(
            command("fluidbench.runs.process", str(folder), ATTENDED, python=work.interpreter),
            env=environment(seat),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            errors="replace",
        )

        def stop() -> None:
            timed.set()
            child.kill()

        killer = threading.Timer(math.inf if limit is None else limit, stop)
        killer.daemon = True
        try:  # an interruption may come at any point from here on, within the timer's start, too
            _children.add(child)
            if limit is not None:
                killer.start()
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
            killer.cancel()
    return child.returncode, timed.is_set(), obstacle


def _oom_kills() -> int:
    """How many processes of this control group the system has killed for want of memory; 0 where it does not say."""
    for path in OOM_COUNTERS:
        try:
            counts = dict(line.split() for line in path.read_text().splitlines())
            return int(counts.get("oom_kill", 0))
        except (OSError, ValueError):
            continue
    return 0


def _cause(work: Work, folder: Path, code: int, timed: bool, kills: int) -> str:
    """What became of a child, in words."""
    if timed:
        return f"its process was stopped {GRACE:g} s after the wall limit of {work.limit:g} s; raise --wall-limit"
    if code < 0:
        starved = "the system ran out of memory"
        name = signal.Signals(-code).name if -code in {*signal.Signals} else f"signal {-code}"
        why = {
            "SIGKILL": starved if _oom_kills() > kills else "by somebody, or by the system for its memory",
            "SIGSEGV": "it touched memory that is not its own: please report it",
            "SIGBUS": "a bus error",
            "SIGILL": "an instruction that this processor does not know",
            "SIGTERM": "it was asked to end",
            "SIGINT": "it was interrupted",
            "SIGABRT": "it gave up",
        }.get(name, "")
        return f"its process was killed ({name})" + (f": {why}" if why else "")
    lines = (folder / "log.txt").read_text(errors="replace").strip().splitlines()
    last = lines[-1] if lines else "no message"
    return f"its process ended with code {code}: {last}" if code else f"its process left no whole record: {last}"


def main(arguments: list[str]) -> None:
    """The child's entry point."""
    folder = Path(arguments[0])
    if ATTENDED in arguments[1:]:
        end_with_parent()
    table = json.loads((folder / WORK).read_text())
    kind = {kind.__name__: kind for kind in (Job, Experiment)}[table.pop("kind")]
    work = kind(**table | {"target": Target(**table["target"])})

    def report(state: dict[str, Any]) -> None:
        print(PROGRESS + json.dumps(state), flush=True)

    try:
        work.perform(folder, report)
    except UserError as error:
        work.refuse(folder, " ".join(str(error).splitlines()))
    except Obstacle as error:
        print(OBSTACLE + str(error), flush=True)
        sys.exit(1)
    except OSError as error:
        print(f"{OBSTACLE}{error.strerror or error}: {error.filename or folder}", flush=True)
        sys.exit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
