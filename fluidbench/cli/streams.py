"""Standard streams as the system gives them: closed, full, or without the letters that are printed."""

import io
import os
import sys
from pathlib import Path


class Printed(io.TextIOWrapper):
    """Standard output that remembers what kept it from printing: the error itself names no file, and what a stream of
    Python cannot write it forgets."""

    stuck: OSError | None = None

    def write(self, text: str, /) -> int:
        try:
            return super().write(text)
        except OSError as error:
            self.stuck = error
            raise

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            self.stuck = error
            raise


def ready() -> None:
    """Give a stream that is closed a place to go to or come from, and have characters replaced that standard output
    cannot show."""
    if sys.stdin is None:
        sys.stdin = Path(os.devnull).open()  # noqa: SIM115
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    out = sys.stdout
    if type(out) is io.TextIOWrapper:
        encoding, lines, through = out.encoding, out.line_buffering, out.write_through
        sys.stdout = Printed(out.detach(), encoding, "replace", line_buffering=lines, write_through=through)


def unprintable() -> str:
    """Why standard output took no more, and nothing where it took all. What was not printed is thrown away then, or
    Python would fail at it once more as it ends."""
    try:
        sys.stdout.flush()
        stuck = sys.stdout.stuck if isinstance(sys.stdout, Printed) else None
    except OSError as error:
        stuck = error
    if stuck is None:
        return ""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return stuck.strerror or str(stuck)
